"""What the runner itself costs for each stage, without cache."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.pipeline.check import check
from fogpipe.pipeline.plan import make_plan
from fogpipe.pipeline.spec import spec_from_data
from fogpipe.registry import Registry
from fogpipe.runtime.runner import execute


def measure(quick: bool) -> Iterator[Row]:
    """A chain and a fan of stages on one pixel, against the same calls in a loop."""
    count = 200 if quick else 1000
    registry = Registry()
    layer = np.ones((1, 1, 4), np.float32)
    add = registry.find("composite.add").function

    def loop() -> None:
        for _ in range(count):
            add(layer, layer)

    for case, feed in (
        ("chain of stages", lambda i: f"s{i - 1}" if i else "layer"),
        ("fan of stages", lambda i: "layer"),
    ):
        stages = {f"s{i}": {"use": "composite.add", "in": {"layer": feed(i), "other": "layer"}} for i in range(count)}
        outputs = {f"o{i}": f"s{i}" for i in range(count)} if case.startswith("fan") else {"o": f"s{count - 1}"}
        data = {"fogpipe": 1, "inputs": {"layer": "Layer"}, "stages": stages, "outputs": outputs}
        plan = make_plan(check(spec_from_data(data, "overhead"), registry))

        def run(plan=plan) -> None:
            execute(plan, {"layer": layer})

        times = alternating({"loop": loop, "runner": run}, repeats=5 if quick else 11)
        added = (times["runner"] - times["loop"]) / count
        yield Row(case, "runner, per stage", added, note="target: below 0.1 ms")
