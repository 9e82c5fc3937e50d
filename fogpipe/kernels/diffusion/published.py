"""Inhomogeneous diffusion of an RGBA layer to a blur scale that varies over the image.

The two published schemes of Hansard 2019, section 3, the second one also with its steps corrected, and Fast Explicit
Diffusion. Each takes a layer (H, W, 4), the wanted standard
deviation σ(x) in pixels (H, W), the standard deviation σ0 that the layer has already, and the largest rate
ρmax; each returns a new layer. No light crosses the border of the image.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray, floats, require_maps
from fogpipe.kernels.bands import in_bands


def euler(layer: np.ndarray, scale: np.ndarray, finest: float, max_rate: float) -> FloatArray:
    """Forward Euler on the four neighbours (eq. 11–13): exact in the limit, (σmax² − σ0²) / (2 ρmax) steps."""
    layer, scale = prepared(layer, scale, finest)
    steps = euler_steps(float(scale.max()), finest, max_rate)
    rate = (scale**2 - scale.dtype.type(finest**2)) / scale.dtype.type(max(1, 2 * steps))
    # Each channel of a row lies together, so that the compiler works on neighbouring pixels at once.
    now = layer.transpose(0, 2, 1).copy()
    after = np.empty_like(now)
    for _ in range(steps):
        in_bands(_euler_step, *rate.shape, now, rate, after)
        now, after = after, now
    return np.ascontiguousarray(now.transpose(0, 2, 1))


def euler_steps(largest: float, finest: float, max_rate: float) -> int:
    """Number of steps N of eq. 13 that reach the scale ``largest``."""
    return math.ceil((largest**2 - finest**2) / (2 * max_rate))


def invariant(layer: np.ndarray, scale: np.ndarray, finest: float, max_rate: float) -> FloatArray:
    """Steps that grow with the scale reached (eq. 11 with 17–18): ln(σmax/σ0) / ρmax steps."""
    return _invariant(layer, scale, finest, max_rate, corrected=False)


def invariant_corrected(layer: np.ndarray, scale: np.ndarray, finest: float, max_rate: float) -> FloatArray:
    """Steps as in :func:`invariant`, each with the weight that adds the variance (e^{2ρ} − 1) σk² it is to add.

    The weight is (e^{2ρ} − 1)/2 rather than ρ, and may be 1/4 at most, so ρ stays below ln(3/2)/2 ≈ 0.203.
    """
    return _invariant(layer, scale, finest, min(max_rate, math.log(1.5) / 2), corrected=True)


def _invariant(layer: np.ndarray, scale: np.ndarray, finest: float, max_rate: float, corrected: bool) -> FloatArray:
    layer, scale = prepared(layer, scale, finest)
    steps = invariant_steps(float(scale.max()), finest, max_rate)
    rate = np.log(scale / scale.dtype.type(finest)) / scale.dtype.type(max(1, steps))
    weight = np.expm1(2 * rate) / 2 if corrected else rate
    now = layer.copy()
    after = np.empty_like(now)
    for step in range(steps):
        reach = scale.dtype.type(finest) * np.exp(scale.dtype.type(step) * rate)  # σk(x) of eq. 17
        in_bands(_invariant_step, *rate.shape, now, weight, reach, after)
        now, after = after, now
    return now


def fed(layer: np.ndarray, scale: np.ndarray, finest: float, max_rate: float, cycles: int = 4) -> FloatArray:
    """Fast Explicit Diffusion (Grewenig, Weickert and Bruhn 2010): Euler steps of growing size, most of them unstable.

    A cycle of n steps goes (n² + n)/3 times as far as an Euler step at the rate ``max_rate``, and is stable as a whole.
    """
    layer, scale = prepared(layer, scale, finest)
    rate = (scale**2 - scale.dtype.type(finest**2)) / 2
    sizes = fed_steps(float(rate.max()) / max_rate, cycles)
    now = layer.transpose(0, 2, 1).copy()
    after = np.empty_like(now)
    for size in np.tile(sizes, cycles):
        in_bands(_euler_step, *rate.shape, now, rate * rate.dtype.type(size), after)
        now, after = after, now
    return np.ascontiguousarray(now.transpose(0, 2, 1))


def fed_steps(euler_count: float, cycles: int) -> np.ndarray:
    """Sizes of the steps of one cycle, which add to 1/cycles, where Euler needs ``euler_count`` steps to reach 1."""
    if euler_count <= 0:
        return np.zeros(0)
    n = max(1, math.ceil((math.sqrt(1 + 12 * euler_count / cycles) - 1) / 2))
    sizes = 1 / np.cos(np.pi * (2 * np.arange(n) + 1) / (4 * n + 2)) ** 2
    sizes /= sizes.sum() * cycles
    # Large and small steps in turn, or rounding errors would grow before a later step takes them away.
    stride = max(1, round(n * 0.382))
    while math.gcd(stride, n) > 1:
        stride += 1
    return sizes[np.arange(n) * stride % n]


def invariant_steps(largest: float, finest: float, max_rate: float) -> int:
    """Number of steps N of eq. 18 that reach the scale ``largest``."""
    return math.ceil(math.log(largest / finest) / max_rate)


def prepared(layer: np.ndarray, scale: np.ndarray, finest: float) -> tuple[FloatArray, FloatArray]:
    require_maps(layer=(layer, 4), scale=(scale, 1))
    layer, scale = floats(layer, scale)
    # fmax, not maximum: where the scale is unknown the layer keeps the sharpness it has.
    return layer, np.fmax(scale, scale.dtype.type(finest))


@numba.njit(nogil=True, cache=True)
def _euler_step(first, last, now, rate, after):
    rows, columns = rate.shape
    for y in range(first, last):
        up, down = max(y - 1, 0), min(y + 1, rows - 1)
        # Without the border columns the inner loop needs no test, and compiles to vector code.
        _euler_pixel(now, rate, after, y, 0, up, down, 0, min(1, columns - 1))
        for x in range(1, columns - 1):
            _euler_pixel(now, rate, after, y, x, up, down, x - 1, x + 1)
        _euler_pixel(now, rate, after, y, columns - 1, up, down, max(columns - 2, 0), columns - 1)


@numba.njit(nogil=True, inline="always")
def _euler_pixel(now, rate, after, y, x, up, down, left, right):
    half = rate.dtype.type(0.5)
    here = rate[y, x]
    rate_up = half * (rate[up, x] + here)
    rate_down = half * (rate[down, x] + here)
    rate_left = half * (rate[y, left] + here)
    rate_right = half * (rate[y, right] + here)
    for c in range(4):
        value = now[y, c, x]
        after[y, c, x] = (
            value
            + rate_up * (now[up, c, x] - value)
            + rate_down * (now[down, c, x] - value)
            + rate_left * (now[y, c, left] - value)
            + rate_right * (now[y, c, right] - value)
        )


@numba.njit(nogil=True, cache=True)
def _invariant_step(first, last, now, rate, reach, after):
    rows, columns = rate.shape
    real = rate.dtype.type
    half = real(0.5)
    for y in range(first, last):
        for x in range(columns):
            here, distance = rate[y, x], reach[y, x]
            # Each of the four offsets falls between two pixels, a before b, at the fraction f of the way.
            up_a, up_b, up_f = _between(real(y) - distance, rows, real)
            down_a, down_b, down_f = _between(real(y) + distance, rows, real)
            left_a, left_b, left_f = _between(real(x) - distance, columns, real)
            right_a, right_b, right_f = _between(real(x) + distance, columns, real)
            rate_up = half * (here + _mix(rate[up_a, x], rate[up_b, x], up_f))
            rate_down = half * (here + _mix(rate[down_a, x], rate[down_b, x], down_f))
            rate_left = half * (here + _mix(rate[y, left_a], rate[y, left_b], left_f))
            rate_right = half * (here + _mix(rate[y, right_a], rate[y, right_b], right_f))
            for c in range(4):
                value = now[y, x, c]
                after[y, x, c] = (
                    value
                    + rate_up * (_mix(now[up_a, x, c], now[up_b, x, c], up_f) - value)
                    + rate_down * (_mix(now[down_a, x, c], now[down_b, x, c], down_f) - value)
                    + rate_left * (_mix(now[y, left_a, c], now[y, left_b, c], left_f) - value)
                    + rate_right * (_mix(now[y, right_a, c], now[y, right_b, c], right_f) - value)
                )


@numba.njit(nogil=True, inline="always")
def _between(position, size, real):
    """The two pixels around a position, clamped to the image, and where between them it lies."""
    clamped = min(max(position, real(0)), real(size - 1))
    before = int(clamped)
    return before, min(before + 1, size - 1), clamped - real(before)


@numba.njit(nogil=True, inline="always")
def _mix(a, b, fraction):
    return a + fraction * (b - a)
