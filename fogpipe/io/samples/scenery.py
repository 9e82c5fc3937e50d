"""What stands in the outdoor sample is built from patches and capsules; here also lamps, signs, posts and fences.

World coordinates are x right, y up from the road, z forward, in metres. Every function adds to a :class:`Scenery`.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from fogpipe.kernels.raycast import ELLIPSE, RECTANGLE
from fogpipe.kernels.surfaces import LAMP, PLAIN, SIGN

WOOD = (0.20, 0.15, 0.105)
GALVANISED = (0.33, 0.35, 0.37)
WHITE_PAINT = (0.72, 0.71, 0.67)
LAMPLIGHT = (7.0, 5.2, 3.0)
"""Radiance of a lit lamp, far above display white (1)."""
UP = np.array([0.0, 1.0, 0.0])


class Scenery:
    """Patches and capsules, piece by piece, each with its material and tint (linear RGB reflectance)."""

    def __init__(self) -> None:
        self._patches: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        self._capsules: list[tuple[np.ndarray, int, np.ndarray]] = []

    def add_patches(
        self, origin: ArrayLike, a: ArrayLike, b: ArrayLike, *, material: int, tint: ArrayLike, shape: int = RECTANGLE
    ) -> None:
        """Patches with corner ``origin`` and edges ``a``, ``b``; each argument is one vector or (N, 3)."""
        o, a, b, tint = np.broadcast_arrays(*np.atleast_2d(origin, a, b, tint))
        count = len(o)
        corners = np.stack([o, a, b], axis=1).astype(np.float64)
        self._patches.append((corners, np.full(count, shape, np.int8), np.full(count, material, np.int8), tint))

    def add_capsule(
        self, start: np.ndarray, end: np.ndarray, radius: float, tint: ArrayLike, material: int = PLAIN
    ) -> None:
        """All points within ``radius`` of the segment from ``start`` to ``end``."""
        self._capsules.append((np.array([*start, *end, radius], np.float64), material, np.asarray(tint)))

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Patches, shapes, capsules, and for patches then capsules the materials and tints."""
        patches, shapes, materials, tints = (np.concatenate(part) for part in zip(*self._patches, strict=True))
        capsules, capsule_materials, capsule_tints = zip(*self._capsules, strict=True)
        return (
            patches,
            shapes,
            np.array(capsules),
            np.concatenate([materials, np.array(capsule_materials, np.int8)]),
            np.concatenate([tints, np.array(capsule_tints)]).astype(np.float32),
        )


def street_lamp(scenery: Scenery, foot: np.ndarray, over_road: float, height: float = 6.0) -> None:
    """A thin pole with an arm towards the road and a lit globe at its end."""
    top = foot + UP * height
    scenery.add_capsule(foot, foot + 1.1 * UP, 0.085, GALVANISED)
    scenery.add_capsule(foot, top, 0.05, GALVANISED)
    middle = top + np.array([0.45 * over_road, 0.32, 0])
    end = top + np.array([over_road, 0.35, 0])
    scenery.add_capsule(top, middle, 0.035, GALVANISED)
    scenery.add_capsule(middle, end, 0.035, GALVANISED)
    scenery.add_capsule(end - 0.02 * UP, end - 0.02 * UP, 0.13, GALVANISED)
    scenery.add_capsule(end - 0.18 * UP, end - 0.18 * UP, 0.15, LAMPLIGHT, LAMP)


def speed_sign(scenery: Scenery, foot: np.ndarray) -> None:
    """A round speed-limit sign on a pipe, facing the eye."""
    scenery.add_capsule(foot, foot + 2.75 * UP, 0.03, GALVANISED)
    centre = foot + 2.4 * UP - np.array([0.35, 0.35, 0.05])
    scenery.add_patches(centre, (0.7, 0, 0), 0.7 * UP, material=SIGN, tint=(1, 1, 1), shape=ELLIPSE)


def fence(scenery: Scenery, rng: np.random.Generator, posts: np.ndarray) -> None:
    """A wooden fence with two rails along ``posts`` (N, 3)."""
    tops = []
    for post in posts:
        lean = rng.normal(0, 0.025, 3) * (1, 0, 1)
        tint = np.array(WOOD) * rng.uniform(1.0, 1.5)
        scenery.add_capsule(post - 0.1 * UP, post + 1.12 * UP + lean, 0.055, tint)
        tops.append(post + lean)
    for start, end in pairwise(tops):
        for level in (0.5, 0.95):
            scenery.add_capsule(start + level * UP, end + level * UP, 0.032, np.array(WOOD) * rng.uniform(1.0, 1.5))


def delineator(scenery: Scenery, foot: np.ndarray) -> None:
    """A white roadside post with a black band."""
    scenery.add_capsule(foot, foot + 0.62 * UP, 0.06, WHITE_PAINT)
    scenery.add_capsule(foot + 0.66 * UP, foot + 0.80 * UP, 0.062, (0.02, 0.02, 0.02))
    scenery.add_capsule(foot + 0.84 * UP, foot + 0.92 * UP, 0.06, WHITE_PAINT)
