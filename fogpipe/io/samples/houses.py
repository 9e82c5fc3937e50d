"""Gabled houses of the outdoor sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fogpipe.io.samples.scenery import UP, WHITE_PAINT, Scenery
from fogpipe.kernels.raycast import TRIANGLE
from fogpipe.kernels.surfaces import GLASS, PLAIN, PLASTER, TILES


def house(
    scenery: Scenery,
    rng: np.random.Generator,
    corner: np.ndarray,
    along: np.ndarray,
    *,
    length: float,
    depth: float,
    eaves: float,
    wall: ArrayLike,
    roof: ArrayLike,
    shutters: ArrayLike,
) -> None:
    """A gabled house. ``corner`` is its front left foot; the front runs along the unit vector ``along``, seen with the
    house behind it; the ridge is parallel to the front."""
    inward = np.cross(UP, along) * -1
    front, side, up = along * length, inward * depth, UP * eaves
    walls = [(corner, front), (corner + front, side), (corner + front + side, -front), (corner + side, -side)]
    for origin, edge in walls:
        scenery.add_patches(origin, edge, up, material=PLASTER, tint=wall)
    ridge = eaves + 0.42 * depth
    for foot in (corner, corner + front):
        a, b = side / 2 + UP * (ridge - eaves), side
        scenery.add_patches(foot + up, b, a, material=PLASTER, tint=wall, shape=TRIANGLE)
        scenery.add_patches(foot + up + side, -b, a - side, material=PLASTER, tint=wall, shape=TRIANGLE)
    slope = side / 2 + UP * (ridge - eaves)
    back = -side / 2 + UP * (ridge - eaves)
    overhang = 0.35
    for foot, rise in ((corner + up, slope), (corner + up + side, back)):
        unit = rise / np.linalg.norm(rise)
        start = foot - overhang * unit - overhang * along + 0.06 * UP
        edge = along * (length + 2 * overhang)
        scenery.add_patches(start, edge, rise + overhang * unit, material=TILES, tint=roof)
        scenery.add_patches(start - 0.14 * UP, edge, 0.14 * UP, material=PLAIN, tint=WHITE_PAINT)
    stack = corner + 0.72 * front + 0.30 * side + UP * (eaves + 0.15)
    box(scenery, stack, 0.6 * along, 0.6 * inward, (ridge - eaves + 0.55) * UP, PLASTER, (0.34, 0.17, 0.12))

    for origin, edge in (walls[0], walls[1], walls[3]):
        _windows(scenery, rng, origin, edge, eaves, shutters, door=edge is front)


def _windows(
    scenery: Scenery,
    rng: np.random.Generator,
    origin: np.ndarray,
    edge: np.ndarray,
    eaves: float,
    shutters: ArrayLike,
    *,
    door: bool,
) -> None:
    """Rows of windows on one wall, with frame, glazing bars and shutters; a door in place of one below."""
    width = np.linalg.norm(edge)
    along = edge / width
    out = np.cross(UP, along)
    columns = max(int(width / 2.5), 1)
    door_column = columns // 2 if door else -1
    for storey in range(max(int(eaves / 2.5), 1)):
        for column in range(columns):
            centre = (column + 0.5) * width / columns
            if storey == 0 and column == door_column:
                foot = origin + along * (centre - 0.55) + 0.05 * out
                scenery.add_patches(foot - 0.12 * along, 1.34 * along, 2.3 * UP, material=PLAIN, tint=WHITE_PAINT)
                scenery.add_patches(foot + 0.02 * out, 1.1 * along, 2.15 * UP, material=PLAIN, tint=shutters)
                continue
            foot = origin + along * (centre - 0.5) + UP * (0.95 + 2.6 * storey) + 0.04 * out
            scenery.add_patches(foot - 0.08 * (along + UP), 1.16 * along, 1.46 * UP, material=PLAIN, tint=WHITE_PAINT)
            for left in (0.03, 0.53):
                for low in (0.03, 0.68):
                    pane = foot + left * along + low * UP + 0.02 * out
                    scenery.add_patches(pane, 0.44 * along, 0.59 * UP, material=GLASS, tint=(0, 0, 0))
            if rng.random() < 0.85:
                for start in (-0.62, 1.08):
                    shutter = foot + start * along - 0.04 * UP + 0.03 * out
                    scenery.add_patches(shutter, 0.54 * along, 1.38 * UP, material=PLAIN, tint=shutters)


def box(
    scenery: Scenery,
    corner: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    c: np.ndarray,
    material: int,
    tint: ArrayLike,
) -> None:
    """A box with edges ``a``, ``b`` (horizontal) and ``c``: four sides and a lid."""
    for origin, edge in ((corner, a), (corner + a, b), (corner + a + b, -a), (corner + b, -b)):
        scenery.add_patches(origin, edge, c, material=material, tint=tint)
    scenery.add_patches(corner + c, a, b, material=material, tint=tint)
