"""Connected regions of a mask and what borders them. Pixels are neighbours across an edge, not a corner."""

from __future__ import annotations

import numpy as np


def label(mask: np.ndarray) -> tuple[np.ndarray, int]:
    """Number the connected regions 1…count in raster order; 0 outside. Returns the (H, W) numbers and the count."""
    from scipy import ndimage

    labels = np.empty(mask.shape, np.int32)
    count = ndimage.label(mask, output=labels)
    return labels, int(count)  # type: ignore[arg-type]


def areas(labels: np.ndarray, count: int) -> np.ndarray:
    """Pixels of each number 1…count, shape (count,)."""
    return np.bincount(labels.ravel(), minlength=count + 1)[1:]


def row_spans(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row, and the row after the last, of each number 1…count; both of shape (count,)."""
    from scipy import ndimage

    boxes = ndimage.find_objects(labels)
    first, after = np.array([(rows.start, rows.stop) for rows, _ in boxes]).reshape(-1, 2).T
    return first, after


def border(inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Mask of the pixels of one mask that have a neighbour in the other."""
    touched = np.zeros_like(outside)
    touched[:, 1:] |= outside[:, :-1]
    touched[:, :-1] |= outside[:, 1:]
    touched[1:] |= outside[:-1]
    touched[:-1] |= outside[1:]
    return inside & touched


def border_pairs(inside: np.ndarray, outside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Flat indices of all neighbours (p, q) with p in one mask and q in the other; p and q may occur many times."""
    height, width = inside.shape
    pixels = np.flatnonzero(border(inside, outside))
    y, x = np.divmod(pixels, width)
    pairs = []
    for exists, step in ((x > 0, -1), (x < width - 1, 1), (y > 0, -width), (y < height - 1, width)):
        here = pixels[exists]
        touching = outside.ravel()[here + step]
        pairs.append((here[touching], here[touching] + step))
    first, second = zip(*pairs, strict=True)
    return np.concatenate(first), np.concatenate(second)
