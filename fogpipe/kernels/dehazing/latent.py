"""A scene behind haze, whose noise grows with the haze, from pixels of like patches and like transmission."""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray, floats
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.dehazing.weighted_quantile import crossing

PATCH = 3
"""Radius of a patch: 7 × 7 pixels, as in the paper."""
ROWS = 16
"""Rows done together. Running sums start anew with each block: they round alike for any number of threads."""
FEW_ROWS = 2
"""The same for the median, which keeps the weights of a whole window for each pixel."""


def weighted_mean(
    scene: np.ndarray, transmission: np.ndarray, noise: float, radius: int, layer: float, strictness: float
) -> FloatArray:
    """Mean over the window, weighted by likeness and by the inverse variance of each pixel.

    Parameters
    ----------
    scene : (H, W, 3) float, L0, with noise of the standard deviation ``noise / transmission``.
    transmission : (H, W) float, t > 0.
    noise : standard deviation of the noise of the hazy image, above 0.
    radius : of the square window.
    layer : σt, the difference of log transmission that counts as another layer.
    strictness : how much a patch distance, in units of what noise alone makes, lessens the weight.

    Returns
    -------
    (H, W, 3) float.
    """
    planes, variance, log_t = _padded(scene, transmission, noise, radius)
    height, width = transmission.shape
    mean = np.empty((height, width, 3), planes.dtype)
    real = planes.dtype.type
    in_bands(
        _weighted_mean, -(-height // ROWS), width * ROWS,
        planes, variance, log_t, radius, real(1 / (2 * layer**2)), real(strictness), mean,
    )  # fmt: skip
    return mean


def weighted_median(
    scene: np.ndarray,
    transmission: np.ndarray,
    noise: float,
    radius: int,
    layer: float,
    strictness: float,
    balance: float,
    passes: int,
) -> FloatArray:
    """The paper's solver: per channel, min t²(u − L0)² + λ Σ m |u − L(y)|, all neighbours held, ``passes`` times.

    Parameters as for :func:`weighted_mean`; ``balance`` is λ. The weights come from L0 and add to 1 without the
    pixel itself. Takes some twenty times as long as the mean.
    """
    planes, variance, log_t = _padded(scene, transmission, noise, radius)
    data, transmission = floats(np.asarray(scene, planes.dtype), transmission)
    height, width = transmission.shape
    current, real = data, planes.dtype.type
    for _ in range(passes):
        following = np.empty_like(data)
        in_bands(
            _weighted_median, -(-height // FEW_ROWS), width * FEW_ROWS,
            planes, variance, log_t, radius, real(1 / (2 * layer**2)), real(strictness),
            data, transmission, balance, current, following,
        )  # fmt: skip
        current = following
    return current


def _padded(scene: np.ndarray, transmission: np.ndarray, noise: float, radius: int) -> tuple[FloatArray, ...]:
    """Scene as (3, H, W), variance of its noise and log transmission, mirrored at the border."""
    scene, transmission = floats(scene, transmission)
    margin = radius + PATCH
    planes = np.pad(scene.transpose(2, 0, 1), ((0, 0), (margin, margin), (margin, margin)), "symmetric")
    t = np.pad(transmission, margin, "symmetric")
    return np.ascontiguousarray(planes), (scene.dtype.type(noise) / t) ** 2, np.log(t)


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _likeness(top, rows, dy, dx, planes, variance, log_t, radius, narrowness, strictness, distance, column, weight):
    """Weight of the neighbour at one offset, for each pixel of some rows.

    The distance of two patches is in units of its expectation from noise alone, which is then taken off. The Gaussian
    e^−z is (1 − z/16)^16, which has no exponential and ends at z = 16. Each loop reads few arrays, so that it is
    vectorised.
    """
    width = weight.shape[1]
    real = weight.dtype.type  # one plain number among them would make a loop compute in double precision
    zero, one, sixteenth = real(0), real(1), real(1 / 16)
    share = one / real(3 * (2 * PATCH + 1) ** 2)
    span = width + 2 * PATCH
    column[:] = 0
    for y in range(rows + 2 * PATCH):
        a = top + y + radius
        here, there = radius, radius + dx
        row = distance[y]
        for c in range(3):
            plane, other = planes[c, a, here : here + span], planes[c, a + dy, there : there + span]
            if c == 0:
                for x in range(span):
                    difference = plane[x] - other[x]
                    row[x] = difference * difference
            else:
                for x in range(span):
                    difference = plane[x] - other[x]
                    row[x] += difference * difference
        plane, other = variance[a, here : here + span], variance[a + dy, there : there + span]
        for x in range(span):
            row[x] /= plane[x] + other[x]
        for x in range(span):
            column[x] += row[x]
        if y < 2 * PATCH:
            continue
        a -= PATCH
        here, there = here + PATCH, there + PATCH
        plane, other = log_t[a, here : here + width], log_t[a + dy, there : there + width]
        row = weight[y - 2 * PATCH]
        for x in range(width):
            patch = column[x]
            for i in range(1, 2 * PATCH + 1):
                patch += column[x + i]
            row[x] = max(patch * share - one, zero) * strictness
        for x in range(width):
            step = plane[x] - other[x]
            w = max(one - (row[x] + step * step * narrowness) * sixteenth, zero)
            w *= w
            w *= w
            w *= w
            row[x] = w * w
        row = distance[y - 2 * PATCH]
        for x in range(span):
            column[x] -= row[x]


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def _weighted_mean(first, last, planes, variance, log_t, radius, narrowness, strictness, mean):
    height, width, _ = mean.shape
    margin = radius + PATCH
    distance = np.empty((ROWS + 2 * PATCH, width + 2 * PATCH), mean.dtype)
    column = np.empty(width + 2 * PATCH, mean.dtype)
    weight = np.empty((ROWS, width), mean.dtype)
    sums = np.empty((4, ROWS, width), mean.dtype)
    for block in range(first, last):
        top = block * ROWS
        rows = min(ROWS, height - top)
        sums[:] = 0
        for dy in range(-radius, radius + 1):
            for dx in range(-radius, radius + 1):
                _likeness(
                    top, rows, dy, dx, planes, variance, log_t, radius, narrowness, strictness, distance, column, weight
                )
                for y in range(rows):
                    a, b = top + y + margin + dy, margin + dx
                    row, certainty, total = weight[y], variance[a, b : b + width], sums[3, y]
                    for x in range(width):
                        row[x] /= certainty[x]
                    for x in range(width):
                        total[x] += row[x]
                    for c in range(3):
                        plane, total = planes[c, a, b : b + width], sums[c, y]
                        for x in range(width):
                            total[x] += row[x] * plane[x]
        for y in range(rows):
            for x in range(width):
                for c in range(3):
                    mean[top + y, x, c] = sums[c, y, x] / sums[3, y, x]


@njit(nogil=True, cache=True, error_model="numpy")
def _weighted_median(
    first,
    last,
    planes,
    variance,
    log_t,
    radius,
    narrowness,
    strictness,
    data,
    transmission,
    balance,
    current,
    following,
):
    height, width, _ = data.shape
    span = 2 * radius + 1
    distance = np.empty((FEW_ROWS + 2 * PATCH, width + 2 * PATCH), data.dtype)
    column = np.empty(width + 2 * PATCH, data.dtype)
    weight = np.empty((span, span, FEW_ROWS, width), data.dtype)
    values, weights = np.empty(span * span, data.dtype), np.empty(span * span, np.float64)
    for block in range(first, last):
        top = block * FEW_ROWS
        rows = min(FEW_ROWS, height - top)
        for dy in range(-radius, radius + 1):
            for dx in range(-radius, radius + 1):
                _likeness(
                    top, rows, dy, dx, planes, variance, log_t, radius, narrowness, strictness, distance, column,
                    weight[dy + radius, dx + radius],
                )  # fmt: skip
        for y in range(top, top + rows):
            for x in range(width):
                for c in range(3):
                    count, total = 0, 0.0
                    for j in range(max(0, y - radius), min(height, y + radius + 1)):
                        for i in range(max(0, x - radius), min(width, x + radius + 1)):
                            w = weight[j - y + radius, i - x + radius, y - top, x]
                            if w > 0 and (j != y or i != x):
                                values[count], weights[count] = current[j, i, c], w
                                total += w
                                count += 1
                    following[y, x, c] = data[y, x, c]
                    if count:
                        pull = 2 * transmission[y, x] ** 2 / balance
                        following[y, x, c] = crossing(values[:count], weights[:count], total, data[y, x, c], pull, 0.5)
