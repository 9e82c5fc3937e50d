"""The light of a sunny day on ray-cast solids and terrain: samples to pixels, sun and sky, shadows.

Radiance is linear, 1 is display white. The light is chosen by eye in the range of a real evening, not measured.
Coordinates are those of :mod:`fogpipe.kernels.raycast`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from fogpipe.kernels.raycast import (
    FIRST_SOLID,
    NOTHING,
    TERRAIN,
    Solids,
    View,
    cast_solids,
    cross,
    dot,
    interpolate,
    meet_terrain,
)
from fogpipe.kernels.surfaces import GLASS, LAMP, LEAF, ground_albedo, sky, surface_albedo
from fogpipe.kernels.texture import hash01

BLOCK_ROWS = 8
"""Rows of pixels whose samples are held at once."""


class ShadowMap(NamedTuple):
    """Depths seen from a far light: its basis (right, up, forward), its position, the grid of texels, the depths."""

    basis: np.ndarray
    position: np.ndarray
    grid: View
    depth: np.ndarray


class Ground(NamedTuple):
    """Terrain on a 1 m grid that begins at x = ``left``, the eye's height, the road's centre x for each metre of z.

    ``depths``, ``lowest`` and ``profile`` are those of :func:`fogpipe.kernels.raycast.trace_profiles`.
    """

    heights: np.ndarray
    left: float
    eye: float
    road: np.ndarray
    depths: np.ndarray
    lowest: np.ndarray
    profile: np.ndarray


class Daylight(NamedTuple):
    """Direction to the sun, a shift (2,) of the clouds, and what stands between a point and the sun or the zenith."""

    sun: np.ndarray
    clouds: np.ndarray
    sun_shadow: ShadowMap
    sky_shadow: ShadowMap


class World(NamedTuple):
    """All there is to see: solids, for each its material and tint (N, 3), the ground and the light."""

    solids: Solids
    material: np.ndarray
    tint: np.ndarray
    ground: Ground
    light: Daylight


def even_disc(count: int) -> np.ndarray:
    """(count, 2) points spread evenly over the unit disc, in an order that wanders over it."""
    index = np.arange(count)
    radius, angle = np.sqrt((index + 0.5) / count), np.pi * (3 - np.sqrt(5)) * (7 * index % count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@njit(nogil=True, cache=True, error_model="numpy")
def render(first, last, order, view, side, world, disc, glass_is_hole, image, range_map):
    """Colour and range of the blocks ``order[first:last]`` of ``BLOCK_ROWS`` pixel rows each.

    Each pixel has ``side × side`` samples, ``side`` odd. The colour is their mean; the range is that of the ray through
    the pixel's centre, which is the middle sample. ``disc`` spreads the samples' looks at the shadow maps.
    """
    columns = image.shape[1] * side
    middle = side // 2
    depth = np.empty((BLOCK_ROWS * side, columns), np.float32)
    owner = np.empty((BLOCK_ROWS * side, columns), np.int32)
    for place in range(first, last):
        block = order[place] * BLOCK_ROWS
        end = min(block + BLOCK_ROWS, image.shape[0])
        _cast_terrain(block * side, end * side, view, world.ground, depth, owner)
        cast_solids(block * side, end * side, block * side, view, world.solids, depth, owner)
        for row in range(block, end):
            top = (row - block) * side
            for column in range(image.shape[1]):
                left = column * side
                near, who = depth[top : top + side, left : left + side], owner[top : top + side, left : left + side]
                red, green, blue = _pixel(row * side, left, view, near, who, disc, world)
                image[row, column, 0], image[row, column, 1], image[row, column, 2] = red, green, blue
                x, y = (left + middle - view.cx) / view.fx, (view.cy - row * side - middle) / view.fy
                centre = who[middle, middle]
                glass = centre >= FIRST_SOLID and world.material[centre - FIRST_SOLID] == GLASS
                known = centre != NOTHING and not (glass and glass_is_hole)
                range_map[row, column] = near[middle, middle] * math.sqrt(x * x + y * y + 1) if known else math.nan


@njit(nogil=True, cache=True, error_model="numpy")
def _pixel(top, left, view, near, who, disc, world):
    """Mean radiance of one pixel.

    Every sample counts; neighbours in a row that meet the same solid share one look at it, and where all samples meet
    one surface, every other one stands for all.
    """
    side = who.shape[0]
    middle = side // 2
    uniform, some_sky = True, False
    for i in range(side):
        for j in range(side):
            uniform &= who[i, j] == who[0, 0]
            some_sky |= who[i, j] == NOTHING
    above = (0.0, 0.0, 0.0)
    if some_sky:  # smooth, so that one look per pixel is enough
        above = sky(
            ((left + middle - view.cx) / view.fx, (view.cy - top - middle) / view.fy, 1.0),
            world.light.sun,
            world.light.clouds,
        )
        if uniform:
            return above
    turn = 6.2831853 * hash01(top, left)
    cosine, sine = math.cos(turn), math.sin(turn)
    stride = 2 if uniform else 1
    red = green = blue = 0.0
    for i in range(0, side, stride):
        sample, before = above, NOTHING
        for j in range(0, side, stride):
            if who[i, j] == NOTHING:
                sample = above
            elif uniform or who[i, j] != before:
                d = ((left + j - view.cx) / view.fx, (view.cy - top - i) / view.fy, 1.0)
                x, y = disc[i * side + j]
                spread = (cosine * x - sine * y, sine * x + cosine * y)
                sample = _radiance(who[i, j], near[i, j], d, spread, world)
            before = who[i, j]
            red, green, blue = red + sample[0], green + sample[1], blue + sample[2]
    taken = ((side + stride - 1) // stride) ** 2
    return red / taken, green / taken, blue / taken


@njit(nogil=True, cache=True, error_model="numpy")
def _cast_terrain(first, last, view, ground, depth, owner):
    for column in range(depth.shape[1]):
        lowest, profile = ground.lowest[column], ground.profile[column]
        step = ground.depths.size
        for row in range(first, last):
            t, step = meet_terrain((row - view.cy) / view.fy, ground.eye, ground.depths, lowest, profile, step)
            depth[row - first, column] = t
            owner[row - first, column] = TERRAIN if t < math.inf else NOTHING


@njit(nogil=True, cache=True, error_model="numpy")
def _radiance(who, t, d, spread, world):
    """Radiance that comes back along the ray ``d`` from where it meets ``who`` at planar depth ``t``."""
    solids, ground, light = world.solids, world.ground, world.light
    p = (t * d[0], t * d[1], float(t))
    if who == TERRAIN:
        albedo = ground_albedo(p[0], p[2], ground.road)
        return _lambert(albedo, _terrain_normal(p, ground), p, spread, light, 0.0)
    index = who - FIRST_SOLID
    kind = world.material[index]
    colour = (world.tint[index, 0], world.tint[index, 1], world.tint[index, 2])
    if kind == LAMP:
        return colour
    patch_count = solids.patches.shape[0]
    u = v = 0.0
    if index < patch_count:
        o, a, b = solids.patches[index, 0], solids.patches[index, 1], solids.patches[index, 2]
        n = cross(a, b)
        u, v = _patch_coordinates(p, o, a, b, n)
    else:
        n = _capsule_normal(p, solids.capsules[index - patch_count])
    length = math.copysign(math.sqrt(dot(n, n)), -dot(n, d))
    n = (n[0] / length, n[1] / length, n[2] / length)
    if kind == GLASS:
        return _window_pane(d, n, light)
    if kind == LEAF:
        return _lambert(colour, n, p, spread, light, 0.55)
    return _lambert(surface_albedo(kind, colour, p, u, v, ground.eye), n, p, spread, light, 0.0)


@njit(nogil=True, cache=True, error_model="numpy")
def _patch_coordinates(p, o, a, b, n):
    squared = dot(n, n)
    q = (p[0] - o[0], p[1] - o[1], p[2] - o[2])
    return dot(cross(b, n), q) / squared * math.sqrt(dot(a, a)), dot(cross(n, a), q) / squared * math.sqrt(dot(b, b))


@njit(nogil=True, cache=True, error_model="numpy")
def _capsule_normal(p, capsule):
    start = capsule[:3]
    axis = (capsule[3] - start[0], capsule[4] - start[1], capsule[5] - start[2])
    q = (p[0] - start[0], p[1] - start[1], p[2] - start[2])
    along = min(max(dot(q, axis) / max(dot(axis, axis), 1e-12), 0.0), 1.0)
    return (q[0] - along * axis[0], q[1] - along * axis[1], q[2] - along * axis[2])


@njit(nogil=True, cache=True, error_model="numpy")
def _lambert(albedo, n, p, spread, light, through):
    """Diffuse reflection of sun and sky; a share ``through`` of the sunlight passes to the other side, as in a leaf."""
    facing = dot(n, light.sun)
    sun = max(facing, 0.0)
    green = 1.0
    if facing < 0 and through > 0:
        sun, green = -facing * through, 1.25
    if sun > 0:
        sun *= _unshadowed(light.sun_shadow, p, n, spread, 0.05)
    open_sky = (0.62 + 0.38 * n[1]) * (0.3 + 0.7 * _unshadowed(light.sky_shadow, p, n, spread, 1.6))
    bounce = 0.16 * (0.5 - 0.5 * n[1])
    return (
        albedo[0] * (1.72 * sun + 0.42 * open_sky + 0.60 * bounce),
        albedo[1] * (1.49 * sun * green + 0.52 * open_sky + 0.53 * bounce),
        albedo[2] * (1.09 * sun / green + 0.70 * open_sky + 0.35 * bounce),
    )


@njit(nogil=True, cache=True, error_model="numpy")
def _unshadowed(shadow, p, n, spread, blur):
    """1 where nothing stands between p and the light, else 0; looked up ``blur`` metres away along ``spread``.

    The point is lifted off its surface, which would otherwise shade itself where the light grazes it.
    """
    lift = min(blur, 0.1) + 0.06
    q = (
        p[0] + lift * n[0] - shadow.position[0],
        p[1] + lift * n[1] - shadow.position[1],
        p[2] + lift * n[2] - shadow.position[2],
    )
    z = dot(shadow.basis[2], q)
    column = int(shadow.grid.cx + shadow.grid.fx * (dot(shadow.basis[0], q) + blur * spread[0]) / z + 0.5)
    row = int(shadow.grid.cy - shadow.grid.fy * (dot(shadow.basis[1], q) + blur * spread[1]) / z + 0.5)
    if not (0 <= row < shadow.depth.shape[0] and 0 <= column < shadow.depth.shape[1]):
        return 1.0
    return 1.0 if z < shadow.depth[row, column] + 0.08 else 0.0


@njit(nogil=True, cache=True, error_model="numpy")
def _window_pane(d, n, light):
    """A dark room behind a pane that mirrors sky and horizon (Schlick's Fresnel term)."""
    length = math.sqrt(dot(d, d))
    cosine = -dot(d, n) / length
    mirrored = (d[0] / length + 2 * cosine * n[0], d[1] / length + 2 * cosine * n[1], d[2] / length + 2 * cosine * n[2])
    share = 0.08 + 0.92 * (1 - cosine) ** 5
    above = sky((mirrored[0], abs(mirrored[1]) + 0.05, mirrored[2]), light.sun, light.clouds)
    ground = 0.25 if mirrored[1] < 0 else 1.0
    return (
        0.012 + share * ground * above[0],
        0.014 + share * ground * above[1],
        0.016 + share * ground * above[2],
    )


@njit(nogil=True, cache=True, error_model="numpy")
def _terrain_normal(p, ground):
    x = p[0] - ground.left
    dx = interpolate(ground.heights, x + 0.5, p[2]) - interpolate(ground.heights, x - 0.5, p[2])
    dz = interpolate(ground.heights, x, p[2] + 0.5) - interpolate(ground.heights, x, p[2] - 0.5)
    length = math.sqrt(dx * dx + dz * dz + 1)
    return (-dx / length, 1 / length, -dz / length)
