"""Ray casting in object order: which surface each ray of a pinhole camera meets first, and how far away.

Coordinates are x right, y up, z forward, with the eye at the origin. The ray of the sample in row r and column c
has the direction ``((c − cx)/fx, (cy − r)/fy, 1)``, so its parameter t is the planar depth. Two solids suffice:

* a patch, ``o + u·a + v·b`` for 0 ≤ u, v ≤ 1: the parallelogram, its half with u + v ≤ 1, or its inscribed ellipse;
* a capsule, all points within a radius of a segment; a sphere is one whose segment has no length.

Each is met exactly, sample by sample, within the rectangle of samples that can see it, so that the cost is the area
that is drawn and not the number of rays times the number of solids. A terrain is met column by column: a camera that
looks level sees each column of samples in one vertical plane, where the terrain is a polyline.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

RECTANGLE, TRIANGLE, ELLIPSE = 0, 1, 2
NOTHING, TERRAIN, FIRST_SOLID = 0, 1, 2
"""Owners of a sample: the sky, the terrain, then the patches and after them the capsules in their order."""


class View(NamedTuple):
    """A camera over a grid of samples: focal lengths and principal point in samples."""

    fx: float
    fy: float
    cx: float
    cy: float


class Solids(NamedTuple):
    """Solids in the coordinates of a view.

    Attributes
    ----------
    patches : (N, 3, 3) float64, corner o, edge a, edge b.
    shapes : (N,) int8, RECTANGLE, TRIANGLE or ELLIPSE.
    capsules : (M, 7) float64, both ends of the segment and the radius.
    bounds : (N + M, 4) int32, what :func:`bounds` gives: first and last row, first and last column.
    """

    patches: np.ndarray
    shapes: np.ndarray
    capsules: np.ndarray
    bounds: np.ndarray


@njit(nogil=True, cache=True, error_model="numpy")
def bounds(patches, capsules, view, rows, columns):
    """The rectangle of samples that can see each solid, (N + M, 4) int32; empty (last < first) where none can.

    A solid that reaches behind the eye is left out: scenes keep their distance from the camera.
    """
    result = np.empty((patches.shape[0] + capsules.shape[0], 4), np.int32)
    for index in range(result.shape[0]):
        box = (math.inf, -math.inf, math.inf, -math.inf)
        if index < patches.shape[0]:
            o, a, b = patches[index, 0], patches[index, 1], patches[index, 2]
            for u in range(2):
                for v in range(2):
                    corner = (o[0] + u * a[0] + v * b[0], o[1] + u * a[1] + v * b[1], o[2] + u * a[2] + v * b[2])
                    box = _widened(box, corner, 0.0, view)
        else:
            capsule = capsules[index - patches.shape[0]]
            box = _widened(box, (capsule[0], capsule[1], capsule[2]), capsule[6], view)
            box = _widened(box, (capsule[3], capsule[4], capsule[5]), capsule[6], view)
        if not math.isfinite(box[0]):
            box = (0.0, -1.0, 0.0, -1.0)
        result[index, 0] = int(min(max(math.floor(box[0]), 0), rows))
        result[index, 1] = int(min(max(math.ceil(box[1]), -1), rows - 1))
        result[index, 2] = int(min(max(math.floor(box[2]), 0), columns))
        result[index, 3] = int(min(max(math.ceil(box[3]), -1), columns - 1))
    return result


@njit(nogil=True, cache=True, error_model="numpy")
def _widened(box, centre, radius, view):
    """The rectangle (top, bottom, left, right) grown to hold a sphere; not finite once a sphere is behind the eye."""
    top, bottom, left, right = box
    nearest = centre[2] - radius
    if nearest <= 1e-3:
        return (-math.inf, math.inf, -math.inf, math.inf)
    for depth in (nearest, centre[2] + radius):
        row, column = view.cy - view.fy * centre[1] / depth, view.cx + view.fx * centre[0] / depth
        reach_y, reach_x = view.fy * radius / depth, view.fx * radius / depth
        top, bottom = min(top, row - reach_y), max(bottom, row + reach_y)
        left, right = min(left, column - reach_x), max(right, column + reach_x)
    return (top, bottom, left, right)


@njit(nogil=True, cache=True, error_model="numpy")
def cast_solids(first, last, top, view, solids, depth, owner):
    """Meet all solids on sample rows ``first:last``; row r is kept in ``depth[r − top]``, ``owner[r − top]``.

    A sample changes where a solid is nearer than the depth that is already there.
    """
    patch_count = solids.patches.shape[0]
    for index in range(solids.bounds.shape[0]):
        top_row = max(solids.bounds[index, 0], first)
        end_row = min(solids.bounds[index, 1], last - 1) + 1
        left, right = solids.bounds[index, 2], solids.bounds[index, 3]
        if top_row >= end_row or left > right:
            continue
        if index < patch_count:
            _cast_patch(top_row, end_row, left, right, top, view, solids, index, depth, owner)
        else:
            _cast_capsule(top_row, end_row, left, right, top, view, solids, index, depth, owner)


@njit(nogil=True, cache=True, error_model="numpy")
def _cast_patch(top_row, end_row, left, right, top, view, solids, index, depth, owner):
    """With n = a × b: ``t = n·o / n·d``, ``u = (b × n)·(t d − o)/|n|²``, ``v = (n × a)·(t d − o)/|n|²``."""
    o, a, b = solids.patches[index, 0], solids.patches[index, 1], solids.patches[index, 2]
    n = cross(a, b)
    squared = dot(n, n)
    u_dual = cross(b, n)
    v_dual = cross(n, a)
    distance = dot(n, o)
    u_start, v_start = dot(u_dual, o) / squared, dot(v_dual, o) / squared
    shape = solids.shapes[index]
    for row in range(top_row, end_row):
        y = (view.cy - row) / view.fy
        for column in range(left, right + 1):
            x = (column - view.cx) / view.fx
            t = distance / (n[0] * x + n[1] * y + n[2])
            if not 0 < t < depth[row - top, column]:
                continue
            u = t * (u_dual[0] * x + u_dual[1] * y + u_dual[2]) / squared - u_start
            v = t * (v_dual[0] * x + v_dual[1] * y + v_dual[2]) / squared - v_start
            if shape == ELLIPSE:
                inside = (u - 0.5) ** 2 + (v - 0.5) ** 2 <= 0.25
            else:
                inside = u >= 0 and v >= 0 and (u + v <= 1 if shape == TRIANGLE else u <= 1 and v <= 1)
            if inside:
                depth[row - top, column] = t
                owner[row - top, column] = FIRST_SOLID + index


@njit(nogil=True, cache=True, error_model="numpy")
def _cast_capsule(top_row, end_row, left, right, top, view, solids, index, depth, owner):
    capsule = solids.capsules[index - solids.patches.shape[0]]
    start, end, radius = capsule[:3], capsule[3:6], capsule[6]
    axis = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length2 = dot(axis, axis)
    start_along = dot(axis, start)
    body = length2 * dot(start, start) - start_along**2 - radius**2 * length2
    for row in range(top_row, end_row):
        for column in range(left, right + 1):
            d = ((column - view.cx) / view.fx, (view.cy - row) / view.fy, 1.0)
            along = dot(axis, d)
            d2 = dot(d, d)
            # The infinite cylinder: (|axis|² |d|² − (axis·d)²) t² − 2 (…) t + body = 0.
            a = length2 * d2 - along**2
            b = length2 * dot(start, d) - start_along * along
            t, place = math.inf, 0.0
            if length2 > 0:
                discriminant = b * b - a * body
                if discriminant < 0:
                    continue
                t = (b - math.sqrt(discriminant)) / a
                place = t * along - start_along
            if length2 == 0 or not 0 <= place <= length2:
                t = _meet_sphere(end if place > length2 else start, radius, d, d2)
            if 0 < t < depth[row - top, column]:
                depth[row - top, column] = t
                owner[row - top, column] = FIRST_SOLID + index


@njit(nogil=True, cache=True, error_model="numpy")
def _meet_sphere(centre, radius, d, d2):
    b = dot(centre, d)
    discriminant = b * b - d2 * (dot(centre, centre) - radius**2)
    return (b - math.sqrt(discriminant)) / d2 if discriminant >= 0 else math.inf


@njit(nogil=True, cache=True, error_model="numpy")
def trace_profiles(first, last, view, eye, heights, left, depths, lowest, profile):
    """Terrain profiles of sample columns ``first:last``.

    Parameters
    ----------
    eye : height of the eye above the zero of ``heights`` (m).
    heights : (Z, X) terrain heights (m) on a grid of 1 m; x begins at ``left``, z at 0.
    depths : (S,) increasing planar depths at which the terrain is sampled.
    lowest : (columns, S) out, the running minimum of ``(eye − height)/depth``: a ray that descends more steeply
        than this has met the terrain.
    profile : (columns, S) out, heights.
    """
    for column in range(first, last):
        x = (column - view.cx) / view.fx
        slope = math.inf
        for step in range(depths.size):
            height = interpolate(heights, x * depths[step] - left, depths[step])
            slope = min(slope, (eye - height) / depths[step])
            profile[column, step] = height
            lowest[column, step] = slope


@njit(nogil=True, cache=True, error_model="numpy")
def meet_terrain(descent, eye, depths, lowest, profile, step):
    """Where a ray that falls ``descent`` per metre forward meets the profile of its column.

    Returns the planar depth, inf if they do not meet, and the first step of the profile below the ray. ``step`` is
    what this function returned for the ray above, or ``depths.size``: rays of a column are met from top to bottom.
    Exact for the polyline through the profile, and so for a plane.
    """
    if step == depths.size:
        step = first_below(lowest, descent)
    while step > 0 and lowest[step - 1] < descent:
        step -= 1
    if step == depths.size:
        return math.inf, step
    if step == 0:
        return depths[0], step
    before = step - 1
    rise = (float(profile[step]) - float(profile[before])) / (depths[step] - depths[before])
    return (eye - profile[before] + rise * depths[before]) / (descent + rise), step


@njit(nogil=True, cache=True, error_model="numpy")
def first_below(falling, value):
    """The first place where a non-increasing sequence is below ``value``, its size if nowhere."""
    low, high = 0, falling.size
    while low < high:
        middle = (low + high) // 2
        if falling[middle] < value:
            high = middle
        else:
            low = middle + 1
    return low


@njit(nogil=True, cache=True, error_model="numpy")
def interpolate(grid, column, row):
    """Bilinear value of ``grid`` at a real position, held constant beyond its edges."""
    row = min(max(row, 0.0), grid.shape[0] - 1.001)
    column = min(max(column, 0.0), grid.shape[1] - 1.001)
    i, j = int(row), int(column)
    v, u = row - i, column - j
    above = grid[i, j] * (1 - u) + grid[i, j + 1] * u
    below = grid[i + 1, j] * (1 - u) + grid[i + 1, j + 1] * u
    return above * (1 - v) + below * v


@njit(nogil=True, cache=True)
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(nogil=True, cache=True)
def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
