"""Airlight estimators on hazy pictures whose airlight is known, with a lamp, and with a white wall near by.

The haze is white, or brown as dust; the sky is airlight. Motorcycle has no sky and keeps a transmission of 0.22 or 0.02
at its farthest point.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from fogpipe.bench.hazy_scenes import REPORTED, clear_scene
from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.compositing import blend
from fogpipe.stages import airlight
from fogpipe.stages.metric import airlight_error
from fogpipe.stages.noise import gaussian, quantise

COLOURS = ((0.78, 0.80, 0.84), (0.60, 0.55, 0.50))
THICKNESSES = (1.5, 4.0)
EXTRAS = ("nothing else", "a lamp", "a white wall")
YARDSTICK = "a mean over the image"
ESTIMATORS: dict[str, Callable[[FloatArray], airlight.AirlightEstimate]] = {
    "brightest": airlight.brightest,
    "dark channel, brightest": lambda image: airlight.dark_channel(image, take="brightest"),
    "dark channel, median": airlight.dark_channel,
    "quad tree": airlight.quad_tree,
    "fading": airlight.fading,
    "fading, drawn to grey": lambda image: drawn_to_grey(airlight.fading(image), airlight.dark_channel(image)),
}


def drawn_to_grey(found: airlight.AirlightEstimate, other: airlight.AirlightEstimate) -> airlight.AirlightEstimate:
    """As in ``yan2013``."""
    return found._replace(airlight=airlight.greyer(found.airlight, other.airlight))


def measure(quick: bool) -> Iterator[Row]:
    """Mean and worst error of every estimator, with a sky and without."""
    outdoors = [name for name in REPORTED if name.startswith("outdoor")][: 1 if quick else None]
    for place, names in (("outdoors", outdoors), ("no sky", ["motorcycle"])):
        for extra in EXTRAS:
            yield from compare(f"{place}, {extra}", names, extra, (320, 240) if quick else (640, 480))


def compare(case: str, names: list[str], extra: str, size: tuple[int, int]) -> Iterator[Row]:
    """A row for each estimator."""
    errors: dict[str, list[tuple[float, float]]] = defaultdict(list)
    pictures = list(hazy_pictures(names, extra, size))
    for image, truth in pictures:
        for way, estimate in ESTIMATORS.items():
            distance, angle = airlight_error(estimate(image).airlight, truth)
            errors[way].append((float(distance), float(angle)))
    image = pictures[-1][0]
    ways = {way: partial(estimate, image) for way, estimate in ESTIMATORS.items()}
    times = alternating({YARDSTICK: lambda: image.mean(axis=(0, 1)), **ways}, 3)
    for way, found in errors.items():
        (distance, angle), (worst, _) = np.mean(found, axis=0), np.max(found, axis=0)
        scores = {"distance": float(distance), "worst distance": float(worst), "angle": float(angle)}
        yield Row(case, way, times[way], times[way] / times[YARDSTICK], YARDSTICK, scores=scores)


def hazy_pictures(names: list[str], extra: str, size: tuple[int, int]) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Hazy pictures of 8 bit with noise of σ = 5 levels, and the airlight of each, (3,)."""
    for name in names:
        clear, distance = clear_scene(name, *size)
        for colour in COLOURS:
            for thickness in THICKNESSES:
                t = np.exp(-np.float32(thickness) * distance)
                if name.startswith("outdoor"):
                    t[distance == 1] = 0
                truth = np.array(colour, np.float32)
                hazy = with_extra(blend(clear, t, truth), truth, extra)
                yield quantise(gaussian(hazy, rng=np.random.default_rng(5), sigma=5 / 255)), truth


def with_extra(hazy: FloatArray, airlight: FloatArray, extra: str) -> FloatArray:
    """The picture with a lamp of 1/20 of its height, or with a wall in the sun that fills a seventh of it."""
    height, width, _ = hazy.shape
    if extra == "a lamp":
        rows, columns = np.ogrid[:height, :width]
        hazy[(rows - height // 4) ** 2 + (columns - 2 * width // 3) ** 2 <= (height / 40) ** 2] = 1
    elif extra == "a white wall":
        wall = hazy[5 * height // 12 : 5 * height // 6, 3 * width // 5 : 19 * width // 20]
        shade = np.linspace(0.97, 0.94, wall.shape[1], dtype=np.float32)[:, None]
        wall[...] = 0.9 * shade + np.float32(0.1) * airlight
    return hazy
