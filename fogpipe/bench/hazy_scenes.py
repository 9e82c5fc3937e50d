"""Hazy pictures whose truth is known: clear pictures with true range, made hazy and noisy by formula."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from fogpipe.io.scenes import open_scene
from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.compositing import blend
from fogpipe.stages.noise import gaussian, quantise

REPORTED = ("motorcycle", "outdoor:1", "outdoor:2", "outdoor:3", "outdoor:4", "outdoor:5")
"""Sample scenes of the published table. No setting may be chosen by how it does on them."""
TUNING = ("outdoor:11", "outdoor:12", "outdoor:13", "outdoor:14")
"""Sample scenes to choose settings on."""
THICKNESSES = (1.0, 2.0, 3.0)
"""η, optical thickness from the nearest to the farthest point."""
NOISES = (0.0, 5.0, 10.0)
"""σ of the noise, in levels of 8 bit."""
AIRLIGHT = (0.9, 0.9, 0.9)
HORIZON = 100.0
"""Metres; what is farther, and the sky, counts as this far."""


@dataclass(frozen=True, eq=False)
class HazyScene:
    """A hazy picture and its truth, all in display values.

    Attributes
    ----------
    name, thickness, noise : the scene, η, and σ in levels of 8 bit.
    hazy : (H, W, 3) float32, what a method is given: I = tJ + (1 − t)B with noise, rounded to 8 bit.
    clear : (H, W, 3) float32, J in [0, 1].
    transmission : (H, W) float32, t = e^(−η d).
    airlight : (3,) float32, B.
    """

    name: str
    thickness: float
    noise: float
    hazy: FloatArray
    clear: FloatArray
    transmission: FloatArray
    airlight: FloatArray


def hazy_scenes(
    names: Sequence[str],
    thicknesses: Sequence[float] = THICKNESSES,
    noises: Sequence[float] = NOISES,
    size: tuple[int, int] = (640, 480),
) -> Iterator[HazyScene]:
    """Every scene in every haze and noise; the noise is the same at each thickness, up to its strength."""
    for name in names:
        clear, distance = clear_scene(name, *size)
        for thickness in thicknesses:
            for noise in noises:
                yield make_hazy(name, clear, distance, thickness, noise)


def make_hazy(name: str, clear: FloatArray, distance: FloatArray, thickness: float, noise: float) -> HazyScene:
    """One clear picture behind haze and noise, in 8 bit."""
    airlight = np.array(AIRLIGHT, np.float32)
    t = np.exp(-np.float32(thickness) * distance)
    noisy = gaussian(blend(clear, t, airlight), rng=np.random.default_rng(7), sigma=noise / 255)
    return HazyScene(name, thickness, noise, quantise(noisy), clear, t, airlight)


@cache
def clear_scene(name: str, width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """A sample in display values in [0, 1], and its normalised distance: 0 at the nearest point, 1 at the farthest.

    Holes of a measured range take the nearest measured one; the sky is at the horizon.
    """
    import cv2
    from scipy.ndimage import distance_transform_edt

    sample = f"sample:{name}:{width}x{height}" if name.startswith("outdoor") else f"sample:{name}"
    values = open_scene(sample).load("srgb").values
    image, range_map = values["image"], values["range_map"]
    if name.startswith("outdoor"):
        range_map = np.nan_to_num(range_map, nan=HORIZON)
    nearest = distance_transform_edt(np.isnan(range_map), return_distances=False, return_indices=True)
    range_map = np.minimum(range_map[tuple(np.asarray(nearest))], HORIZON)
    if image.shape[:2] != (height, width):
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
        range_map = cv2.resize(range_map, (width, height), interpolation=cv2.INTER_NEAREST)
    distance = (range_map - range_map.min()) / (range_map.max() - range_map.min())
    return np.clip(image, 0, 1), distance.astype(np.float32)
