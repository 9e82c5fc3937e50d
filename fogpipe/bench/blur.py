"""Blur of a varying width: time against error for every solver, and the paper's Figures 6 and 7 as curves.

The yardstick is one ordinary Gaussian blur of the largest width, by OpenCV, of the same float32 RGBA frame. The
reference is the equation in float64 (solver ``reference``), and in the figures the exact Gaussian.
"""

from __future__ import annotations

import itertools
import math
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from fogpipe.bench.chart import curves
from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.io.atomic import atomic_write_text
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion import SOLVERS, reference

FINEST = 1.0
TOLERANCES = (1e-2, 4e-3, 2e-3, 1e-3, 3e-4)
OTHERS = ("invariant", "invariant-corrected", "fed", "adi", "mipmap")
FIGURES = "figures 6 and 7, σ"
YARDSTICK = "cv2.GaussianBlur of the largest width"


def measure(quick: bool) -> Iterator[Row]:
    """Time against error on the yardstick frames, size, share of sharp pixels, number formats, Figures 6 and 7."""
    height, width = (560, 800) if quick else (1120, 1600)
    repeats = 3 if quick else 7
    for name in ("motorcycle", "outdoor"):
        layer, ratio = premultiplied(name, height, width)
        for largest in (25.0,) if quick else (8.5, 16.0, 25.0):
            scale = (FINEST + ratio**1.5 * (largest - FINEST)).astype(np.float32)
            # The picture is of the largest width; for the others three repeats do.
            count = repeats if largest == 25 else min(repeats, 3)
            yield from against_reference(f"{name} {width}×{height}, σmax {largest:g}", layer, scale, count)
    layer, ratio = premultiplied("motorcycle", height, width)
    yield from sizes(layer, ratio, 3, (0.25, 1) if quick else (1, 4, 16))
    yield from widths(layer, ratio, repeats)
    yield from sharp_parts(layer, repeats)
    yield from number_formats(layer[:280, :400])
    yield from figures(layer, (2.0, 8.0, 25.0) if quick else (2.0, 5.0, 10.0, 15.0, 20.0, 25.0), 3)


def draw(folder: Path, quick: bool, rows: Sequence[Row]) -> None:
    """Figures 6 and 7 of the paper: error and time over the width of the blur, for each scheme."""
    own = [row for row in rows if row.case.startswith(FIGURES)]
    sigmas = list(dict.fromkeys(float(row.case.rpartition(" ")[2]) for row in own))

    def line(way: str, value: Callable[[Row], float | None]) -> list[float]:
        found = {row.case: value(row) for row in own if row.way == way}
        return [found.get(f"{FIGURES} {sigma:g}") or math.nan for sigma in sigmas]

    ways = list(dict.fromkeys(row.way for row in own))
    for name, title, up, value in (
        ("6", "Figure 6: error against the exact Gaussian", "RMS error", lambda row: row.error),
        ("7", "Figure 7: time", "milliseconds", lambda row: row.seconds * 1e3),
    ):
        lines = {way: line(way, value) for way in ways}
        text = curves(title, ("standard deviation of the blur, px", sigmas), up, lines)
        atomic_write_text(folder / f"blur-figure-{name}.svg", text)


def premultiplied(name: str, height: int, width: int) -> tuple[FloatArray, FloatArray]:
    """A sample scene behind haze: (H, W, 4) premultiplied float32, and the range as a share of the farthest."""
    import cv2
    from scipy.ndimage import distance_transform_edt

    values = open_scene(f"sample:{name}").load("linear").values
    range_map = np.where(np.isinf(values["range_map"]), np.nan, values["range_map"])
    farthest = np.nanpercentile(range_map, 99)
    if name.startswith("outdoor"):
        range_map = np.nan_to_num(range_map, nan=farthest)  # sky
    nearest = distance_transform_edt(np.isnan(range_map), return_distances=False, return_indices=True)
    ratio = np.minimum(range_map[tuple(np.asarray(nearest))] / farthest, 1).astype(np.float32)
    ratio = cv2.resize(ratio, (width, height), interpolation=cv2.INTER_NEAREST)
    image = np.clip(cv2.resize(values["image"], (width, height), interpolation=cv2.INTER_CUBIC), 0, 1)
    transmission = np.exp(-ratio)[..., None]
    return np.concatenate([image * transmission, transmission], axis=2).astype(np.float32), ratio


def against_reference(case: str, layer: FloatArray, scale: FloatArray, repeats: int) -> Iterator[Row]:
    """The solvers with what they cost and how far they are from the equation."""
    ways: dict[str, Callable[[], FloatArray]] = {
        f"auto {tolerance:g}": partial(SOLVERS["auto"], layer, scale, FINEST, 0.25, tolerance)
        for tolerance in TOLERANCES
    }
    ways |= {name: partial(SOLVERS[name], layer, scale, FINEST, 0.25, 1.0) for name in OTHERS}
    yield from compared(case, ways, layer, float(scale.max()), reference(layer, scale, FINEST), repeats)


def sizes(layer: FloatArray, ratio: FloatArray, repeats: int, megapixels: tuple[float, ...]) -> Iterator[Row]:
    """The same picture with more pixels: the time should grow as they do."""
    import cv2

    for millions in megapixels:
        across = math.sqrt(millions * 1e6 / ratio.size)
        more = np.asarray(cv2.resize(layer, None, fx=across, fy=across), np.float32)
        scale = FINEST + cv2.resize(ratio, more.shape[1::-1], interpolation=cv2.INTER_NEAREST) ** 1.5 * 24
        ways = {"auto 0.002": partial(SOLVERS["auto"], more, scale, FINEST, 0.25, 2e-3)}
        yield from compared(f"{millions:g} MP, σmax 25", ways, more, 25.0, None, repeats)


def widths(layer: FloatArray, ratio: FloatArray, repeats: int) -> Iterator[Row]:
    """The same picture blurred more and more, all as a ratio to one Gaussian of 25 px."""
    ways = {
        f"auto 0.002, σmax {largest:g}": partial(
            SOLVERS["auto"], layer, (FINEST + ratio**1.5 * (largest - FINEST)).astype(np.float32), FINEST, 0.25, 2e-3
        )
        for largest in (6.0, 12.0, 25.0, 50.0)
    }
    yield from compared("growth with σmax", ways, layer, 25.0, None, repeats)


def sharp_parts(layer: FloatArray, repeats: int) -> Iterator[Row]:
    """A frame of which four fifths, in one piece, need no blur, against one that needs it everywhere."""
    for sigma, share in itertools.product((6.0, 25.0), (0.0, 0.8)):
        scale = np.full(layer.shape[:2], sigma, np.float32)
        scale[round(layer.shape[0] * (1 - share)) :] = FINEST
        ways = {f"auto {t:g}": partial(SOLVERS["auto"], layer, scale, FINEST, 0.25, t) for t in (2e-3, 3e-4)}
        exact = reference(layer, scale, FINEST)
        yield from compared(f"{share:.0%} of the pixels sharp, σ {sigma:g}", ways, layer, sigma, exact, repeats)


def number_formats(layer: FloatArray) -> Iterator[Row]:
    """What is stored between steps or stretches in 16, 32 and 64 bits, computed in float32 or better."""
    scale = np.full(layer.shape[:2], 10.0)
    exact = reference(layer, scale, FINEST)
    # One step of Euler is a blur to σ² = σ0² + 2ρ, so that storing between steps needs no other solver. The others
    # are called in four stretches of time, with what is between two of them stored.
    rate, steps = 0.2, round((10.0**2 - FINEST**2) / 0.4)
    for name, count in (("euler", steps), ("invariant-corrected", 4), ("fed", 4), ("adi", 4), ("auto", 4)):
        added = 2 * rate if name == "euler" else (10.0**2 - FINEST**2) / count
        part = np.full(layer.shape[:2], math.sqrt(FINEST**2 + added * (1 - 1e-6)))
        for dtype in (np.float16, np.float32, np.float64):
            now = layer.astype(dtype)
            for _ in range(count):
                now = SOLVERS[name](now, part, FINEST, rate, 1e-4).astype(dtype)
            difference = now.astype(np.float64) - exact
            yield Row(
                "storage, σ 10",
                f"{name}, {np.dtype(dtype).name}",
                0.0,
                error=rms(difference),
                largest_error=float(np.abs(difference).max()),
                note=f"stored {count} times, not timed; mean drifts by {abs(difference.mean()):.1g}",
            )


def figures(layer: FloatArray, sigmas: tuple[float, ...], repeats: int) -> Iterator[Row]:
    """Figures 6 and 7: error against the exact Gaussian, and time, at one σ for the whole frame."""
    from scipy.ndimage import gaussian_filter

    for sigma in sigmas:
        width = math.sqrt(sigma**2 - FINEST**2)
        exact = gaussian_filter(layer.astype(np.float64), (width, width, 0), mode="reflect")
        scale = np.full(layer.shape[:2], sigma, np.float32)
        names = ["invariant", "invariant-corrected", *(["euler"] if sigma <= 10 else [])]
        ways = {name: partial(SOLVERS[name], layer, scale, FINEST, 0.25, 1.0) for name in names}
        ways["auto 0.002"] = partial(SOLVERS["auto"], layer, scale, FINEST, 0.25, 2e-3)
        yield from compared(f"{FIGURES} {sigma:g}", ways, layer, sigma, exact, min(repeats, 3))


def compared(
    case: str,
    ways: dict[str, Callable[[], FloatArray]],
    layer: FloatArray,
    largest: float,
    exact: FloatArray | None,
    repeats: int,
) -> Iterator[Row]:
    """Each way with its time, as a ratio to one Gaussian blur, and its distance from what is exact."""
    import cv2

    times = alternating({YARDSTICK: lambda: cv2.GaussianBlur(layer, (0, 0), largest), **ways}, repeats)
    for way, call in ways.items():
        error = largest_error = None
        if exact is not None:
            difference = call() - exact
            error, largest_error = rms(difference), float(np.abs(difference).max())
        note = ""
        if exact is not None and way.startswith("auto") and not case.startswith(FIGURES):
            kept = error is not None and error <= float(way.split()[1])
            note = "keeps its promise" if kept else "BREAKS ITS PROMISE"
        scores = {"extra memory, frames": extra(call, layer)}
        ratio = times[way] / times[YARDSTICK]
        yield Row(case, way, times[way], ratio, YARDSTICK, error, largest_error, note, scores=scores)


def extra(call: Callable[[], FloatArray], layer: FloatArray) -> float:
    """Memory that a way takes beyond its result, in frames."""
    tracemalloc.start()
    try:
        result = call()
        return (tracemalloc.get_traced_memory()[1] - result.nbytes) / layer.nbytes
    finally:
        tracemalloc.stop()


def rms(difference: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))
