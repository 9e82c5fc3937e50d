"""Trees, woods, hedges and grass of the outdoor sample, made of elliptic leaves on capsules of wood."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fogpipe.io.samples.scenery import UP, Scenery
from fogpipe.kernels.raycast import ELLIPSE, TRIANGLE
from fogpipe.kernels.surfaces import LEAF

BARK = (0.085, 0.066, 0.05)


def leaves(
    scenery: Scenery,
    rng: np.random.Generator,
    points: np.ndarray,
    outward: np.ndarray,
    size: np.ndarray | float,
    tint: np.ndarray,
) -> None:
    """Elliptic leaves around ``points`` (N, 3), turned halfway towards ``outward`` (N, 3), of length ``size``."""
    normal = 0.7 * outward + rng.normal(size=points.shape)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.cross(normal, rng.normal(size=points.shape))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normal, along)
    a, b = along * np.reshape(size, (-1, 1)), across * np.reshape(size, (-1, 1)) * 0.62
    scenery.add_patches(points - (a + b) / 2, a, b, material=LEAF, tint=tint, shape=ELLIPSE)


def tree(
    scenery: Scenery,
    rng: np.random.Generator,
    foot: np.ndarray,
    height: float,
    spread: float,
    *,
    leaf: float,
    cover: float = 3.0,
    tint: ArrayLike = (0.10, 0.155, 0.035),
    slender: bool = False,
) -> None:
    """A broad-leaved tree: trunk, boughs and clumps of leaves.

    Parameters
    ----------
    foot : where the trunk leaves the ground.
    height, spread : total height and radius of the crown (m).
    leaf : length of a leaf (m); far trees take larger ones, each a twig.
    cover : total leaf area over the silhouette of the crown.
    slender : a poplar, whose clumps stand along the trunk.
    """
    clumps = 26 if slender else 16
    bottom = 0.10 if slender else 0.34
    level = np.sqrt(rng.random(clumps)) if slender else rng.random(clumps)
    level = np.sort(level) if slender else level
    turn = rng.random(clumps) * 2 * np.pi
    profile = np.sin(np.pi * (0.16 + 0.80 * level)) ** (0.7 if slender else 0.8)
    reach = spread * profile * (0.25 if slender else 0.68) * np.sqrt(rng.random(clumps) * 0.8 + 0.2)
    rise = height * (bottom + (0.97 - bottom) * level) - (0 if slender else 0.35 * spread)
    centres = foot + np.stack([reach * np.cos(turn), rise, reach * np.sin(turn)], axis=1)
    radii = spread * (0.62 * profile + 0.08 if slender else rng.uniform(0.30, 0.50, clumps))

    trunk = (0.011 if slender else 0.017) * height + 0.03
    fork = foot + UP * height * (0.85 if slender else 0.45)
    scenery.add_capsule(foot - 0.2 * UP, foot + UP * height * 0.25, trunk, BARK)
    scenery.add_capsule(foot + UP * height * 0.22, fork, trunk * 0.72, BARK)
    if not slender:
        for centre in centres[:9]:
            start = foot + UP * height * rng.uniform(0.26, 0.44)
            scenery.add_capsule(start, centre, trunk * 0.3, BARK)

    per_clump = np.maximum(cover * np.pi * radii**2 / (0.49 * leaf**2), 4).astype(int)
    clump = np.repeat(np.arange(clumps), per_clump)
    outward = rng.normal(size=(len(clump), 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    distance = rng.random(len(clump)) ** 0.42 * (1 + 0.16 * rng.normal(size=len(clump)))
    stretch = np.array([1, 1.7, 1]) if slender else np.array([1, 0.78, 1])
    points = centres[clump] + outward * stretch * (radii[clump] * distance)[:, None]
    inner = np.clip(distance, 0.25, 1) ** 1.5 * (0.62 + 0.38 * np.clip((points[:, 1] - foot[1]) / height, 0, 1))
    colour = np.array(tint) * inner[:, None] * rng.uniform(0.75, 1.25, (len(points), 1))
    colour *= 1 + 0.16 * rng.normal(size=(clumps, 1))[clump] * np.array([1.3, 1.0, 0.6])
    leaves(scenery, rng, points, outward, leaf * rng.uniform(0.7, 1.25, len(points)), np.maximum(colour, 0.004))


def woods(scenery: Scenery, rng: np.random.Generator, feet: np.ndarray, leaf: np.ndarray) -> None:
    """Far trees at ``feet`` (N, 3): ragged crowns of twigs of length ``leaf`` (N,), no trunks."""
    height = rng.gamma(16, 0.62, len(feet)) + 1.5
    conifer = rng.random(len(feet)) < 0.35
    width = height * np.where(conifer, 0.17, rng.uniform(0.28, 0.38, len(feet)))
    tint = np.where(conifer[:, None], (0.042, 0.075, 0.032), (0.085, 0.125, 0.033))
    tint = tint * rng.uniform(0.75, 1.3, (len(feet), 1))
    twigs = np.clip(1.2 * height * width / (0.49 * leaf**2), 30, 500).astype(int)
    tree = np.repeat(np.arange(len(feet)), twigs)
    level = rng.random(len(tree)) ** np.where(conifer[tree], 1.4, 0.8)
    profile = np.where(conifer[tree], 1.04 - level, np.sin(np.pi * (0.10 + 0.86 * level)) ** 0.7)
    turn = rng.random(len(tree)) * 2 * np.pi
    lumps = 1 + 0.35 * np.sin(3 * turn + 17 * level + 6 * rng.random(len(feet))[tree])
    reach = width[tree] * profile * lumps * rng.random(len(tree)) ** 0.45
    rise = height[tree] * (0.06 + 0.94 * level)
    points = feet[tree] + np.stack([reach * np.cos(turn), rise, reach * np.sin(turn)], axis=1)
    outward = np.stack([np.cos(turn), np.full_like(turn, 0.5), np.sin(turn)], axis=1)
    shade = 0.42 + 0.58 * level * rng.uniform(0.8, 1.2, len(tree))
    leaves(scenery, rng, points, outward, leaf[tree] * rng.uniform(0.7, 1.4, len(tree)), tint[tree] * shade[:, None])


def hedge(scenery: Scenery, rng: np.random.Generator, feet: np.ndarray, leaf: float) -> None:
    """Bushes of uneven height, one at each of ``feet`` (N, 3)."""
    radii = rng.uniform(0.6, 1.15, len(feet))
    count = int(3.2 * np.pi * radii.mean() ** 2 / (0.49 * leaf**2))
    outward = rng.normal(size=(len(feet), count, 3))
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    outward[..., 1] = np.abs(outward[..., 1])
    distance = rng.random((len(feet), count, 1)) ** 0.35 * (1 + 0.1 * rng.normal(size=(len(feet), count, 1)))
    points = feet[:, None] + outward * distance * radii[:, None, None] * (1, 1.35, 1)
    tint = np.array([0.07, 0.105, 0.028]) * rng.uniform(0.7, 1.3, (len(feet), 1, 1))
    shade = np.clip(distance, 0.3, 1) ** 1.5 * (0.5 + 0.5 * outward[..., 1:2]) * rng.uniform(0.75, 1.25, distance.shape)
    leaves(scenery, rng, points.reshape(-1, 3), outward.reshape(-1, 3), leaf, (tint * shade).reshape(-1, 3))


def grass(scenery: Scenery, rng: np.random.Generator, feet: np.ndarray, flowers: float = 0.02) -> None:
    """Blades at ``feet`` (N, 3), a share of them with a flower on top."""
    count = len(feet)
    tall = rng.gamma(5, 0.026, count)[:, None]
    lean = rng.normal(0, 0.35, (count, 3)) * (1, 0, 1)
    tip = (UP + lean) * tall
    turn = rng.random(count) * np.pi
    wide = np.stack([np.cos(turn), np.zeros(count), np.sin(turn)], axis=1) * 0.011
    green, dry = np.array([0.11, 0.16, 0.035]), np.array([0.16, 0.10, 0.03])
    tint = green * rng.uniform(0.6, 1.35, (count, 1)) + dry * rng.random((count, 1)) ** 4
    scenery.add_patches(feet, wide, tip, material=LEAF, tint=tint, shape=TRIANGLE)
    crowned = rng.random(count) < flowers
    heads = (feet + tip * 1.25)[crowned]
    palette = np.array([(0.75, 0.72, 0.66), (0.75, 0.55, 0.03), (0.50, 0.035, 0.02), (0.22, 0.16, 0.52)])
    colours = palette[rng.choice(4, len(heads), p=(0.4, 0.34, 0.18, 0.08))]
    leaves(scenery, rng, heads, np.tile(UP - (0, 0, 1), (len(heads), 1)), 0.045, colours)
