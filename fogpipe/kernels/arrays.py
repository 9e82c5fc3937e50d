"""Brings arrays into the form that compiled loops take, and refuses those that do not belong together."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

FloatArray = np.ndarray[Any, np.dtype[np.floating[Any]]]


def floats(first: np.ndarray, *others: np.ndarray) -> tuple[FloatArray, ...]:
    """Read-only, C-contiguous versions of the arrays, all in one precision. Copies only where it must.

    The first array decides: float64 is computed in float64, everything narrower in float32 (so float16 is
    widened). One layout and one access mode also mean that each kernel is compiled once per precision.
    """
    dtype = np.float64 if first.dtype.itemsize > 4 else np.float32
    return tuple(_read_only(np.asarray(array, dtype=dtype, order="C")) for array in (first, *others))


def _read_only(array: np.ndarray) -> FloatArray:
    view = array.view()
    view.flags.writeable = False
    return view


def over_channels(function: np.ufunc, image: FloatArray) -> FloatArray:
    """``np.minimum`` or ``np.maximum`` of the channels of (H, W, C): one twentieth of the time of a ``min(axis=2)``."""
    return functools.reduce(function, np.moveaxis(image, 2, 0))


def require_maps(**maps: tuple[np.ndarray, int]) -> None:
    """Refuse maps that do not show the same pixels; kernels do not check their indices.

    Parameters
    ----------
    maps : by name, an array and its number of channels: 1 stands for shape (H, W), more for (H, W, channels).

    Raises
    ------
    ValueError
        If an array has another shape, holds no pixel, or has not the size of the first one.
    """
    (first_name, (first, _)), *_others = maps.items()
    for name, (array, channels) in maps.items():
        tail = () if channels == 1 else (channels,)
        if array.ndim != 2 + len(tail) or array.shape[2:] != tail or array.size == 0:
            wanted = ", ".join(("height", "width", *map(str, tail)))
            raise ValueError(f"{name} has shape {array.shape}, not ({wanted}) with at least one pixel.")
        if array.shape[:2] != first.shape[:2]:
            raise ValueError(
                f"{name} has {_size(array)} pixels but {first_name} has {_size(first)}: bring them to the same size."
            )


def require_nonnegative(**maps: np.ndarray) -> None:
    """Refuse maps with a value below zero. NaN is allowed; costs one pass at the speed of memory.

    Raises
    ------
    ValueError
        Names the map, its smallest value and how many are negative.
    """
    for name, array in maps.items():
        smallest = np.fmin.reduce(array, axis=None)
        if smallest < 0:
            count = np.count_nonzero(array < 0)
            raise ValueError(f"{name} is negative at {count} pixels (smallest {smallest:g}); mark unknown ones as NaN.")


def require_finite(**maps: np.ndarray) -> None:
    """Refuse maps with a NaN or an infinity, which a filter would spread. Costs two passes at the speed of memory.

    Raises
    ------
    ValueError
        Names the map, how many of its values are not finite, and the index of the first.
    """
    for name, array in maps.items():
        if np.isfinite(array.min()) and np.isfinite(array.max()):  # which are NaN where there is one
            continue
        faulty = ~np.isfinite(array)
        place = ", ".join(map(str, np.argwhere(faulty)[0]))
        raise ValueError(
            f"{name} is NaN or infinite at {np.count_nonzero(faulty)} of {array.size} values, the first at index"
            f" ({place}); fill them before, or check what made them."
        )


def _size(array: np.ndarray) -> str:
    height, width = array.shape[:2]
    return f"{width} × {height}"
