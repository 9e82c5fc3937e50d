"""Density as noise: time beside a Gaussian blur, and the error of integrals along rays.

The yardstick is ``cv2.GaussianBlur`` with σ = 5 px on an RGB picture of the same size in float32. The reference of the
rays has steps of a hundredth of the distance, and the error is that of the transmission at an extinction of 0.03
per metre.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np

from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.io.scenes import open_scene
from fogpipe.stages.density import along_rays, perlin
from fogpipe.stages.medium import transmission

BLUR = "cv2.GaussianBlur, σ = 5 px, RGB float32"
EXTINCTION = np.array(0.03)


def measure(quick: bool) -> Iterator[Row]:
    """Noise over the image at several periods, and noise in the world at several lengths of step."""
    height, width = (560, 893) if quick else (1120, 1786)
    yield from _over_the_image(height, width, repeats=5 if quick else 9)
    yield from _along_rays("320x200" if quick else "960x600", repeats=1 if quick else 3)


def _over_the_image(height: int, width: int, repeats: int) -> Iterator[Row]:
    image = np.random.default_rng(0).random((height, width, 3), np.float32)
    ways = {BLUR: lambda: cv2.GaussianBlur(image, (0, 0), 5)} | {
        f"density.perlin, 5 octaves from {period} px": partial(_perlin, image, period) for period in (1000, 250, 64, 16)
    }
    for way, seconds in (times := alternating(ways, repeats)).items():
        yield Row(f"{width}×{height}", way, seconds, seconds / times[BLUR], BLUR)


def _perlin(image: np.ndarray, period: float) -> np.ndarray:
    return perlin(image, period=period, rng=np.random.default_rng(7))


def _along_rays(size: str, repeats: int) -> Iterator[Row]:
    values = open_scene(f"sample:outdoor:{size}").load("linear").values
    image, range_map, camera = (values[name] for name in ("image", "range_map", "camera"))
    rays = {
        f"density.along_rays, growth {growth}": partial(_rays, range_map, camera, growth)
        for growth in (0.4, 0.2, 0.1, 0.05)
    }
    times = alternating({BLUR: lambda: cv2.GaussianBlur(image, (0, 0), 5)} | rays, repeats)
    reference = transmission(range_map, EXTINCTION, _rays(range_map, camera, 0.01)).astype(np.float64)
    for way, call in rays.items():
        error = np.nan_to_num(transmission(range_map, EXTINCTION, call()) - reference)
        yield Row(
            f"street {size}",
            way,
            times[way],
            times[way] / times[BLUR],
            BLUR,
            float(np.sqrt(np.mean(error**2))),
            float(np.abs(error).max()),
        )


def _rays(range_map: np.ndarray, camera: np.ndarray, growth: float) -> np.ndarray:
    return along_rays(range_map, camera, growth=growth, rng=np.random.default_rng(7))
