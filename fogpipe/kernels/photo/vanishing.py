"""Where the straight lines of a photograph meet, and the depth of the box whose edges they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.photo.cues import reduced

LENGTH = 480
"""Longer side at which lines are sought, pixels: finer ones are texture."""
SHORTEST = 0.04
"""Least length of a line, in heights of the image."""
SLANT = 0.12
"""Least sine of the angle of a line to both axes: verticals and horizontals meet at infinity."""
PRECISION = 0.03
"""Sine of the angle by which a line may miss the point that it votes for."""
CENTRE, SPREAD = (0.0, -0.05), (0.35, 0.25)
"""Where the vanishing point is expected from the middle, and how far from there, in widths and heights."""
STEP = 1 / 60
"""Distance of the points that are tried, in heights."""
CONFIDENT = (0.11, 0.19)
"""Share of the votes at which a point counts as chance, and at which it counts as certain."""


class Vanishing(NamedTuple):
    """A vanishing point: x and y as shares of width and height, and how much to trust it, 0 to 1."""

    x: float
    y: float
    confidence: float


def vanishing_point(grey: np.ndarray) -> Vanishing:
    """The point that most of the slanted lines of the photo point at.

    Every line votes, by its length, for the points of a grid that it points at; a prior keeps the point inside the
    photo. Lines are found by the detector of von Gioi et al. 2010 (OpenCV's).

    Parameters
    ----------
    grey : (H, W) uint8.
    """
    middle, direction, length, aspect = _slanted_lines(grey)
    if length.size < 6:
        return Vanishing(0.5, 0.5 + CENTRE[1], 0.0)
    x, y = np.meshgrid(_grid(0.4 * aspect, 0.4 * aspect), _grid(0.35, 0.3))
    x, y = x.ravel(), y.ravel()
    to_x, to_y = x[:, None] - middle[:, 0], y[:, None] - middle[:, 1]
    away = np.hypot(to_x, to_y)
    miss = (to_x * direction[:, 1] - to_y * direction[:, 0]) / np.maximum(away, 1e-6)
    votes = (np.exp(-((miss / PRECISION) ** 2)) * (away > length)) @ (length / length.sum())
    votes *= np.exp(-(((x / aspect - CENTRE[0]) / SPREAD[0]) ** 2 + ((y - CENTRE[1]) / SPREAD[1]) ** 2) / 2)
    best = votes.argmax()
    chance, certain = CONFIDENT
    confidence = np.clip((votes[best] - chance) / (certain - chance), 0, 1)
    return Vanishing(float(x[best] / aspect + 0.5), float(y[best] + 0.5), float(confidence))


def box_nearness(shape: tuple[int, int], point: Vanishing, walls: float, ceiling: float) -> FloatArray:
    """Inverse depth inside a box that is seen along its axis; 1 is the ground at the lower edge of the image.

    A plane at the distance D from the axis appears at the offset f·D/Z from the vanishing point, so its inverse
    depth is the offset over D.

    Parameters
    ----------
    shape : rows and columns.
    point : the vanishing point.
    walls, ceiling : distances of the side walls and of the ceiling from the axis, in camera heights.
    """
    rows, columns = shape
    y = (np.arange(rows, dtype=np.float32)[:, None] + np.float32(0.5)) / rows - np.float32(point.y)
    x = np.abs((np.arange(columns, dtype=np.float32) + np.float32(0.5)) / columns - np.float32(point.x))
    upright = np.where(y > 0, y, -y / np.float32(ceiling))
    nearness = np.maximum(upright, x * np.float32(columns / rows / walls))
    return np.minimum(nearness / np.float32(1 - point.y), 1)


def _grid(before: float, after: float) -> np.ndarray:
    return np.arange(-round(before / STEP), round(after / STEP) + 1) * STEP


def _slanted_lines(grey: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Middle and direction, (N, 2), and length, (N,), of the lines, in heights from the middle; width over height."""
    import cv2

    small = reduced(grey, LENGTH)
    rows, columns = small.shape
    found = None
    if min(small.shape) >= 8:  # the detector halves what it is given
        found = cv2.createLineSegmentDetector().detect(np.ascontiguousarray(small))[0]
    ends = np.zeros((0, 4)) if found is None else found.reshape(-1, 4).astype(np.float64)
    ends = (ends - np.array([columns, rows, columns, rows]) / 2) / rows
    along = ends[:, 2:] - ends[:, :2]
    length = np.maximum(np.hypot(*along.T), 1e-9)
    keep = (length > SHORTEST) & (np.abs(along).min(axis=1, initial=np.inf) > SLANT * length)
    middle = (ends[:, 2:] + ends[:, :2]) / 2
    return middle[keep], along[keep] / length[keep, None], length[keep], columns / rows
