"""Fog on one photograph: the stages before the fog, whole pipelines, and how well the depth orders the scene.

The yardstick is OpenCV's mean shift of the same photo at full size, ``cv2.pyrMeanShiftFiltering(image, 16, 24)``.
References are the exact bilateral filter and mean shift at full size; the depth is held against the true range
of the samples, where the error is 1 − Spearman.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Literal

import numpy as np

import fogpipe
from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.io.scenes import open_scene
from fogpipe.stages import depth, haziness, refine, segments

YARDSTICK = "cv2.pyrMeanShiftFiltering(image, 16, 24)"


def measure(quick: bool) -> Iterator[Row]:
    """Smoothing, segments and pipelines in time and error; depth in its order."""
    photo = rocket(320, 240) if quick else rocket(640, 480)
    levels = np.rint(photo * 255).astype(np.uint8)
    yield from smoothing(photo, levels, repeats=1 if quick else 5)
    yield from pipelines(photo, levels, repeats=1 if quick else 5)
    for name in ("motorcycle", *(f"outdoor:{seed}:640x400" for seed in (() if quick else range(1, 7)))):
        yield from orders(name)


def rocket(width: int, height: int) -> np.ndarray:
    """The sample photo at another size, display values."""
    import cv2

    image = open_scene("sample:rocket").load("srgb").values["image"]
    return np.clip(cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC), 0, 1)


def size(photo: np.ndarray) -> str:
    """Width and height, for people."""
    return f"{photo.shape[1]}×{photo.shape[0]}"


def smoothing(photo: np.ndarray, levels: np.ndarray, repeats: int) -> Iterator[Row]:
    """Bilateral filter and mean shift, against the exact ones."""
    import cv2

    initial = np.rint((1 - photo.mean(axis=2)) * 31).astype(np.float32) / 31
    bilateral = partial(refine.bilateral, initial)
    filters: dict[str, Callable[[], np.ndarray]] = {
        "exact": partial(bilateral, solver="exact"),
        **{
            f"fast, tolerance {tolerance:g}": partial(bilateral, tolerance=tolerance)
            for tolerance in (1e-2, 2e-3, 2e-4)
        },
        "cv2.bilateralFilter, 19 px": lambda: cv2.bilateralFilter(initial, 19, 0.4, 3, borderType=cv2.BORDER_REFLECT),
    }
    shift = partial(segments.mean_shift, photo)
    shifts = {"cap 1 MP": partial(shift, cap=1), **{f"cap {cap} MP": partial(shift, cap=cap) for cap in (0.08, 0.02)}}
    times = alternating({YARDSTICK: lambda: cv2.pyrMeanShiftFiltering(levels, 16, 24), **filters, **shifts}, repeats)
    for case, ways in (("bilateral, σc 3, σs 0.4", filters), ("mean shift", shifts)):
        reference = next(iter(ways.values()))().astype(np.float64)
        for way, call in ways.items():
            error = call() - reference
            rms, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
            yield Row(f"{case}, {size(photo)}", way, times[way], times[way] / times[YARDSTICK], YARDSTICK, rms, largest)


def pipelines(photo: np.ndarray, levels: np.ndarray, repeats: int) -> Iterator[Row]:
    """Whole pipelines in memory, from photo to fog."""
    import cv2

    ways: dict[str, Callable[[], object]] = {YARDSTICK: lambda: cv2.pyrMeanShiftFiltering(levels, 16, 24)}
    for name in ("guo2014-paper", "guo2014", "photo-fog"):
        ways[name] = partial(fogpipe.load(name).run, image=photo.astype(np.float32))
    times = alternating(ways, repeats)
    for way in ways:
        yield Row(f"pipeline, {size(photo)}", way, times[way], times[way] / times[YARDSTICK], YARDSTICK)


def orders(name: str) -> Iterator[Row]:
    """Every way to a depth, in a scene with true range."""
    values = open_scene(f"sample:{name}").load("srgb").values
    step = max(1, values["image"].shape[1] // 800)
    image, true_range = np.clip(values["image"][::step, ::step], 0, 1), values["range_map"][::step, ::step]
    for way, guess in guesses().items():
        time = alternating({way: partial(guess, image)}, repeats=1)[way]
        agreement = depth.agreement(true_range, guess(image), rng=np.random.default_rng(0))
        note = f"Spearman {agreement.spearman:.2f}, pairs in order {agreement.pairwise:.2f}"
        yield Row(f"depth, {name}", way, time, error=1 - float(agreement.spearman), note=note)


def guesses() -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """The ways to a relative depth, by name."""

    def labelled(image: np.ndarray, scale: Literal["grey-levels", "unit"]) -> np.ndarray:
        return depth.from_transmission(haziness.mrf(image, scale=scale).transmission)

    return {
        "rows": depth.row_prior,
        "published energy": partial(labelled, scale="grey-levels"),
        "published energy, unit scale": partial(labelled, scale="unit"),
        "from_photo": lambda image: depth.from_photo(image).depth,
    }
