"""A batch over a data set: workers against one worker, a sweep against one value, and what the framework adds.

Times are those of a run in its stride: they count from the first items, during which each worker imports and compiles.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fogpipe.batch.prepare import prepare
from fogpipe.batch.run import Batch, Watcher, run_batch
from fogpipe.batch.variation import Variation
from fogpipe.batch.work import Done
from fogpipe.bench.table import Row
from fogpipe.datasets.catalogue import Dataset, open_dataset


@dataclass(frozen=True)
class Case:
    """A scene as a data set of its own.

    Attributes
    ----------
    scene : sample that the pictures are made of.
    size : width and height that it is brought to; as it is where None.
    encoding : of its depth, which is 16-bit codes of ``scale`` to the metre.
    fog : one fog.
    fogs : four, about that one.
    """

    name: str
    scene: str
    size: tuple[int, int] | None
    encoding: str
    scale: float
    fog: str
    fogs: str


STREET = Case(
    "street, 1280×720",
    "sample:outdoor:7:1280x720",
    None,
    "kitti",
    256,
    "fog.visibility=150",
    "fog.visibility=50,100,200,400",
)
"""A third of it is sky, which is filled in once for all fogs."""
MOTORCYCLE = Case(
    "Motorcycle, 741×500",
    "sample:motorcycle",
    None,
    "millimetres",
    1000,
    "fog.optical_thickness=1.4",
    "fog.optical_thickness=0.5,1,2,4",
)
"""Dense depth, of which little is left to be shared."""


def measure(quick: bool) -> Iterator[Row]:
    """Throughput with one and two workers, sweeps of four fogs, overhead, and memory over many images."""
    count = 12 if quick else 24
    with tempfile.TemporaryDirectory(prefix="fogpipe-bench-") as folder:
        root = Path(folder)
        for case in (STREET, MOTORCYCLE):
            place = root / case.scene.replace(":", "-")
            yield from workers_and_sweeps(case, dataset(place / "data", case, count), place)
        yield from memory(root, 200 if quick else 2000)


def workers_and_sweeps(case: Case, data: Dataset, out: Path) -> Iterator[Row]:
    """Two workers and four fogs, each against one; and what the framework adds."""
    one, stride = timed(data, out / "one", case.fog, workers=1)
    two, _ = timed(data, out / "two", case.fog, workers=2)
    four, _ = timed(data, out / "four", case.fogs, workers=1)
    name = f"hansard2019, {case.name}"
    yield Row(name, "1 worker", one, 1.0, "1 worker", note="seconds for each image")
    yield Row(name, "2 workers", two, two / one, "1 worker", note=f"throughput {one / two:.2f} times; target 1.8")
    yield Row(name, "1 worker, 4 fogs", four, four / one, "1 worker", note="target: below 2.5")
    inside = sum(seconds for done in stride for stage, seconds in done.seconds.items() if stage != "whole")
    files = sum(done.seconds["reading"] + done.seconds["writing"] for done in stride)
    added = one * len(stride) - inside
    share = added / (inside - files)
    yield Row(name, "framework", added / len(stride), note=f"{share:.2%} of the time in stages; target 3 %")


def memory(root: Path, count: int) -> Iterator[Row]:
    """The most that a worker has held, early and at the end of many small images."""
    data = dataset(root / "small", replace(STREET, size=(64, 48)), count)
    seconds, done = timed(data, root / "many", STREET.fog, workers=1)
    peaks = [each.memory or 0 for each in done]
    early, last = peaks[len(peaks) // 10], peaks[-1]
    yield Row(
        f"{count} images, 64×48",
        "memory of a worker",
        seconds,
        note=f"{early / 2**20:.0f} MiB after a tenth, {last / 2**20:.0f} MiB at the end",
    )


def timed(data: Dataset, out: Path, fogs: str, workers: int) -> tuple[float, list[Done]]:
    """Seconds of wall time for each item in the stride of a run, and those items."""

    class Clock(Watcher):
        def __init__(self) -> None:
            self.times: list[float] = []
            self.items: list[Done] = []

        def done(self, done: Done) -> None:
            if done.error:
                raise RuntimeError(f"{done.item}: {done.error}")
            self.times.append(time.perf_counter())
            self.items.append(done)

    clock = Clock()
    variation = Variation.parse([fogs])
    job = prepare("hansard2019", data, str(out), variation=variation)
    run_batch(Batch(job, data, variation, workers=workers), clock)
    first = 2 * workers  # each has begun and ended an item, and the second of them was compiled
    return (clock.times[-1] - clock.times[first - 1]) / (len(clock.times) - first), clock.items[first:]


def dataset(root: Path, case: Case, count: int) -> Dataset:
    """A data set of one scene, shifted from picture to picture so that no two files are the same."""
    import cv2

    from fogpipe.io.scenes import open_scene
    from fogpipe.kernels.srgb import srgb_levels_from_linear

    values = open_scene(case.scene).load("linear").values
    frame, metres = srgb_levels_from_linear(values["image"])[..., ::-1], values["range_map"]
    if case.size:
        frame = cv2.resize(frame, case.size, interpolation=cv2.INTER_AREA)
        metres = cv2.resize(metres, case.size, interpolation=cv2.INTER_NEAREST)
    codes = np.where(np.isfinite(metres), metres * case.scale, 0).clip(0, 65535).astype(np.uint16)
    for folder in ("images", "depth"):
        (root / folder).mkdir(parents=True)
    for number in range(count):
        shift = number * 7 % frame.shape[1]
        cv2.imwrite(str(root / f"images/{number:05}.png"), np.roll(frame, shift, axis=1))
        cv2.imwrite(str(root / f"depth/{number:05}.png"), np.roll(codes, shift, axis=1))
    return open_dataset(f"folder:{root}", {"depth": "depth/{id}.png", "encoding": case.encoding})
