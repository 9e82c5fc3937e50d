"""The field of Guo 2014: energy gap against time for every solver, on photographs that scikit-image ships.

The yardstick is OpenCV's mean shift of the same 8-bit photo, with which the paper begins. The reference is the best
lower bound that any solver proves, so a gap is certified, and an energy can only be nearer to the least one.
"""

from __future__ import annotations

import importlib
import importlib.util
import statistics
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.kernels.mrf import SOLVERS, Field, Solution
from fogpipe.stages.haziness import field_of

PHOTOGRAPHS = ("astronaut", "camera", "chelsea", "coffee", "coins", "rocket")
YARDSTICK = "cv2.pyrMeanShiftFiltering(image, 16, 24)"
Solve = Callable[[Field], Solution]


def measure(quick: bool) -> Iterator[Row]:
    """Gaps over photographs, with little, some and much smoothness."""
    size = (320, 240) if quick else (640, 480)
    photographs = {name: photograph(name, size) for name in (PHOTOGRAPHS[2:4] if quick else PHOTOGRAPHS)}
    yardsticks = {name: mean_shift_seconds(image) for name, image in photographs.items()}
    for smoothness in (0.01, 0.5, 2.0):
        fields = {name: field_with(image, smoothness) for name, image in photographs.items()}
        case = f"g {smoothness:g}, {len(fields)} photographs {size[0]}×{size[1]}"
        yield from compared(case, fields, yardsticks, solvers(quick))


def photograph(name: str, size: tuple[int, int]) -> np.ndarray:
    """A photograph in 8-bit RGB, resized to (width, height)."""
    import cv2
    from skimage import data

    image = getattr(data, name)()
    image = np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image
    return np.ascontiguousarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def field_with(image: np.ndarray, smoothness: float) -> Field:
    """The field of the paper's parameters but for g."""
    return field_of(
        (image / 255).astype(np.float32), 32, 1.0, smoothness, 100.0, 15.0, 15.0, "grey-levels", "vertical-order"
    )


def mean_shift_seconds(image: np.ndarray) -> float:
    """Seconds of the yardstick, the median of three."""
    import cv2

    return alternating({"mean shift": lambda: cv2.pyrMeanShiftFiltering(image, 16, 24)}, 3)["mean shift"]


def solvers(quick: bool) -> dict[str, Solve]:
    """Every solver with several numbers of passes; α-expansion where its package is installed, if there is time."""
    passes = {"chains": (1, 2, 4, 8) if quick else (1, 2, 4, 8, 16, 32), "trws": (2, 8) if quick else (4, 32)}
    ways = {f"{name} {count}": with_passes(name, count) for name, counts in passes.items() for count in counts}
    ways |= {"columns": with_passes("columns", 1), "icm": with_passes("icm", 50)}
    if not quick and importlib.util.find_spec("fogpipe_graphcut"):
        expand_all = importlib.import_module("fogpipe_graphcut.expansion").expand_all
        ways |= {"expansion": lambda field: expand_all(field, 1)}
    return ways


def with_passes(name: str, count: int) -> Solve:
    """A solver that stops after so many passes, whatever its gap."""
    return lambda field: SOLVERS[name](field, 0.0, count)


def compared(
    case: str, fields: dict[str, Field], yardsticks: dict[str, float], ways: dict[str, Solve]
) -> Iterator[Row]:
    """Each way with its median gap and its worst over the fields, and median times."""
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    ratios: dict[str, list[float]] = {way: [] for way in ways}
    gaps: dict[str, list[float]] = {way: [] for way in ways}
    own: dict[str, list[float]] = {way: [] for way in ways}
    for name, field in fields.items():
        found: dict[str, Solution] = {}

        def keep(way: str, solve: Solve, field: Field = field, found: dict[str, Solution] = found) -> None:
            found[way] = solve(field)

        times = alternating({way: partial(keep, way, solve) for way, solve in ways.items()}, 1)
        bound = max(solution.bound for solution in found.values())
        for way, solution in found.items():
            seconds[way].append(times[way])
            ratios[way].append(times[way] / yardsticks[name])
            gaps[way].append(1 - bound / solution.energy)
            own[way].append(solution.gap)
    for way in ways:
        yield Row(
            case,
            way,
            statistics.median(seconds[way]),
            statistics.median(ratios[way]),
            YARDSTICK,
            statistics.median(gaps[way]),
            max(gaps[way]),
            f"its own bound certifies {statistics.median(own[way]):.2%}, {max(own[way]):.2%} at worst",
            "energy above the best bound, median",
        )
