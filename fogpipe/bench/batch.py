"""A batch over a data set: workers against one worker, a sweep against one value, and what the framework adds.

Times are those of a run in its stride: they count from the first items, during which each worker imports and compiles.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from fogpipe.batch.prepare import prepare
from fogpipe.batch.run import Batch, Watcher, run_batch
from fogpipe.batch.variation import Variation
from fogpipe.batch.work import Done
from fogpipe.bench.table import Row
from fogpipe.datasets.catalogue import Dataset, open_dataset

VISIBILITY = "fog.visibility=150"
SWEEP = "fog.visibility=50,100,200,400"


def measure(quick: bool) -> Iterator[Row]:
    """Throughput with one and two workers, a sweep of four visibilities, overhead, and memory over many images."""
    width, height, count = (640, 360, 12) if quick else (1280, 720, 24)
    with tempfile.TemporaryDirectory(prefix="fogpipe-bench-") as folder:
        root = Path(folder)
        data = street(root / "large", width, height, count)
        case = f"hansard2019, {width}×{height}"
        one, stride = timed(data, root / "one", [VISIBILITY], workers=1)
        two, _ = timed(data, root / "two", [VISIBILITY], workers=2)
        four, _ = timed(data, root / "four", [SWEEP], workers=1)
        yield Row(case, "1 worker", one, 1.0, "1 worker", note="seconds for each image")
        yield Row(case, "2 workers", two, two / one, "1 worker", note=f"throughput {one / two:.2f} times")
        yield Row(case, "1 worker, 4 visibilities", four, four / one, "1 worker", note="target: below 2.5")
        inside = sum(sum(s for name, s in done.seconds.items() if name != "whole") for done in stride)
        stages = sum(
            sum(s for name, s in done.seconds.items() if name not in ("whole", "reading", "writing")) for done in stride
        )
        added = one * len(stride) - inside
        yield Row(
            case, "framework", added / len(stride), note=f"{added / stages:.2%} of the time in stages; target 3 %"
        )
        yield from memory(root, 200 if quick else 2000)


def memory(root: Path, count: int) -> Iterator[Row]:
    """The most that a worker has held, early and at the end of many small images."""
    data = street(root / "small", 64, 48, count)
    seconds, done = timed(data, root / "many", [VISIBILITY], workers=1)
    peaks = [each.memory or 0 for each in done]
    early, last = peaks[len(peaks) // 10], peaks[-1]
    yield Row(
        f"{count} images, 64×48",
        "memory of a worker",
        seconds,
        note=f"{early / 2**20:.0f} MiB after a tenth, {last / 2**20:.0f} MiB at the end",
    )


def timed(data: Dataset, out: Path, sweeps: Sequence[str], workers: int) -> tuple[float, list[Done]]:
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
    variation = Variation.parse(sweeps)
    job = prepare("hansard2019", data, str(out), variation=variation)
    run_batch(Batch(job, data, variation, workers=workers), clock)
    first = 2 * workers  # each has begun and ended an item, and the second of them was compiled
    return (clock.times[-1] - clock.times[first - 1]) / (len(clock.times) - first), clock.items[first:]


def street(root: Path, width: int, height: int, count: int) -> Dataset:
    """A data set of one street, shifted from picture to picture so that no two files are the same."""
    import cv2

    from fogpipe.io.scenes import open_scene
    from fogpipe.kernels.srgb import srgb_levels_from_linear

    values = open_scene(f"sample:outdoor:7:{max(width, 320)}x{max(height, 200)}").load("linear").values
    frame = cv2.resize(srgb_levels_from_linear(values["image"]), (width, height), interpolation=cv2.INTER_AREA)
    metres = cv2.resize(values["range_map"], (width, height), interpolation=cv2.INTER_NEAREST)
    codes = np.where(np.isfinite(metres), metres * 256, 0).clip(0, 65535).astype(np.uint16)
    for folder in ("images", "depth"):
        (root / folder).mkdir(parents=True)
    for number in range(count):
        shift = number * 7 % width
        cv2.imwrite(str(root / f"images/{number:05}.png"), np.roll(frame, shift, axis=1)[..., ::-1])
        cv2.imwrite(str(root / f"depth/{number:05}.png"), np.roll(codes, shift, axis=1))
    return open_dataset(f"folder:{root}", {"depth": "depth/{id}.png", "encoding": "kitti"})
