"""Planar depth and distance along the ray, and how a camera turns one into the other.

A pixel (u, v), column and row with the first pixel centre at (0, 0), is seen along the direction
``K⁻¹ (u, v, 1)``, whose component along the optical axis is 1. A point at planar depth Z on that ray is
therefore at the distance ``Z · |K⁻¹ (u, v, 1)|``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numba import njit

from fogpipe.kernels.bands import in_bands


def planar_to_radial(depth: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """Distance along the ray from planar depth, ``R = Z · |K⁻¹ (u, v, 1)|``.

    Parameters
    ----------
    depth : (H, W) float, metres along the optical axis. NaN and inf are kept.
    camera : (3, 3) float, intrinsic matrix K in pixels, upper triangular with last row (0, 0, 1).

    Returns
    -------
    (H, W), metres along the ray of each pixel; float64 if ``depth`` is, else float32.

    Raises
    ------
    ValueError
        If ``depth`` has not two axes, or ``camera`` is not an intrinsic matrix.

    Notes
    -----
    O(HW): one square root per pixel, no temporary of the size of the image.
    """
    return _along_rays(_multiply, depth, camera)


def radial_to_planar(range_map: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """Planar depth from distance along the ray, the inverse of :func:`planar_to_radial`."""
    return _along_rays(_divide, range_map, camera)


def _along_rays(kernel: Callable[..., None], distance: np.ndarray, camera: np.ndarray) -> np.ndarray:
    if distance.ndim != 2:
        raise ValueError(f"a distance map has two axes, not shape {distance.shape}")
    dtype = np.float64 if distance.dtype == np.float64 else np.float32
    rows, columns = distance.shape
    terms = [term.astype(dtype) for term in _ray_terms(camera, rows, columns)]
    result = np.empty(distance.shape, dtype)
    in_bands(kernel, rows, columns, distance.astype(dtype, copy=False), *terms, result)
    return result


def _ray_terms(camera: np.ndarray, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``x(u)``, ``s(v)`` and ``1 + y(v)²`` with ``|K⁻¹ (u, v, 1)|² = (x + s)² + 1 + y²``; s is the skew's share."""
    camera = np.asarray(camera, np.float64)
    if camera.shape != (3, 3) or not np.isfinite(camera).all():
        raise ValueError("an intrinsic matrix is 3×3 and finite")
    (fx, skew, cx), (below, fy, cy), last = camera
    if below != 0 or tuple(last) != (0, 0, 1) or fx <= 0 or fy <= 0:
        raise ValueError("an intrinsic matrix is [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0")
    y = (np.arange(rows) - cy) / fy
    return (np.arange(columns) - cx) / fx, -skew / fx * y, 1 + y * y


@njit(nogil=True, cache=True, error_model="numpy")
def _multiply(first, last, distance, x, s, one_plus_y2, result):
    for row in range(first, last):
        for column in range(x.size):
            ray = x[column] + s[row]
            result[row, column] = distance[row, column] * math.sqrt(ray * ray + one_plus_y2[row])


@njit(nogil=True, cache=True, error_model="numpy")
def _divide(first, last, distance, x, s, one_plus_y2, result):
    for row in range(first, last):
        for column in range(x.size):
            ray = x[column] + s[row]
            result[row, column] = distance[row, column] / math.sqrt(ray * ray + one_plus_y2[row])
