"""Polynomials that stand for e^{−a}: the diffusion of a unit of time as a few steps of the operator.

The equation ∂F/∂t = −A F is linear, so its solution at time 1 is e^{−A} F. On the spectrum [0, λ] of A, the Chebyshev
series of e^{−a} converges faster than any power once its degree passes √λ: what is left out is about
erfc(degree / √λ). A degree of m costs m steps of four neighbours; Euler would take λ/2 steps for a first-order result.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from scipy import special

LARGEST_FACTOR = 16
"""Of longer ones fewer passes are needed, but margins and what stays in the cache grow: up to 24 they took as long."""


@lru_cache(256)
def degree_for(spectrum: float, share: float) -> int:
    """Least degree that leaves out at most ``share`` of any pattern, for the largest eigenvalue ``spectrum``."""
    if spectrum <= 0:
        return 0
    degree = max(1, int(math.sqrt(spectrum) * float(special.erfcinv(min(share, 1.0)))))
    while special.erfc((degree + 0.5) / math.sqrt(spectrum)) > share:
        degree += 1
    if spectrum <= 64:  # few steps, of which each counts
        while _left_out(spectrum, degree) > share:
            degree += 1
    return degree


@lru_cache(256)
def _left_out(spectrum: float, degree: int) -> float:
    points = np.linspace(0, 1, 2001) ** 2  # share of the spectrum, dense near 0
    missed = chebyshev.chebval(1 - 2 * points, coefficients(spectrum, degree)) - np.exp(-spectrum * points)
    return float(np.abs(missed).max())


@lru_cache(256)
def coefficients(spectrum: float, degree: int) -> np.ndarray:
    """Chebyshev coefficients of the polynomial nearest to e^{−a} on [0, λ] that is 1 at a = 0: so the mean is kept.

    Nearest for a layer whose variance is spread over patterns like that of a photograph, evenly over the logarithm of
    a, and a tenth of it over all of [0, λ]. It leaves out half as much as the series of the same degree does once
    that is scaled to be 1 at 0.
    """
    if spectrum <= 0:
        return np.ones(1)
    count = 4 * degree + 64
    angle = (np.arange(count) + 0.5) / count * np.pi
    share = (1 - np.cos(angle)) / 2
    density = np.sin(angle) / np.maximum(share, 1e-4)
    weight = np.sqrt(density / density.sum() + 0.1 / count)[:, None]
    patterns = chebyshev.chebvander(1 - 2 * share, degree)[:, 1:] - 1
    wanted = np.expm1(-spectrum * share)[:, None]
    basis, triangle = np.linalg.qr(weight * patterns)
    series = np.linalg.solve(triangle, basis.T @ (weight * wanted))[:, 0]
    return np.r_[1 - series.sum(), series]


@lru_cache(64)
def passes(spectrum: float, degree: int) -> tuple[np.ndarray, ...]:
    """Chebyshev series, 1 at a = 0, whose product is that of :func:`coefficients`, each of a degree for one pass.

    The roots are dealt out so that no factor grows much anywhere, which keeps rounding errors small, and
    the order is the best of some in what the errors of one pass become in those that follow. Up to 0.1 s, once.
    """
    series = coefficients(spectrum, degree)
    count = -(-degree // LARGEST_FACTOR)
    if count <= 1:
        return (series,)
    roots = chebyshev.chebroots(series)
    roots = roots[roots.imag > -1e-9]
    units = [np.array([root, root.conjugate()] if root.imag > 1e-9 else [root.real]) for root in roots]
    factors = []
    for own in _dealt(sorted(units, key=lambda unit: unit[0].real), count):
        nodes = np.cos(np.pi * (np.arange(len(own) + 1) + 0.5) / (len(own) + 1))
        factors.append(chebyshev.chebfit(nodes, np.prod((nodes[:, None] - own) / (1 - own), axis=1).real, len(own)))
    return tuple(factors[k] for k in _steadiest(factors))


def quantised(spectrum: float) -> float:
    """An upper bound of eigenvalues on a scale of fixed steps, so that series can be kept."""
    return 2 ** (math.ceil(8 * math.log2(spectrum)) / 8) if spectrum > 0 else 0.0


def _dealt(units: list[np.ndarray], count: int) -> list[np.ndarray]:
    """Roots in groups, every n-th in one, and then swapped as long as that lowers what a factor grows to."""
    points = np.cos(np.linspace(0, np.pi, 129))
    logs = np.array([np.log(np.abs(np.prod((points[:, None] - u) / (1 - u), axis=1)) + 1e-30) for u in units])
    group = np.arange(len(units)) % count
    sums = np.array([logs[group == k].sum(axis=0) for k in range(count)])
    rng = np.random.default_rng(0)
    for i, j in rng.integers(len(units), size=(1500, 2)):
        a, b = group[i], group[j]
        one, other = sums[a] + logs[j] - logs[i], sums[b] + logs[i] - logs[j]
        if a != b and max(one.max(), other.max()) < max(sums[a].max(), sums[b].max()):
            sums[a], sums[b] = one, other
            group[i], group[j] = b, a
    return [np.concatenate([unit for unit, k in zip(units, group, strict=True) if k == own]) for own in range(count)]


def _steadiest(factors: list[np.ndarray]) -> tuple[int, ...]:
    points = np.cos(np.linspace(0, np.pi, 257))
    values = np.abs([chebyshev.chebval(points, factor) for factor in factors])
    rng = np.random.default_rng(1)
    orders = [np.arange(len(factors)), *(rng.permutation(len(factors)) for _ in range(100))]

    def growth(order: np.ndarray) -> float:
        before = np.cumprod(values[order], axis=0).max()
        return max(before, np.cumprod(values[order[::-1]], axis=0).max())

    return tuple(int(k) for k in min(orders, key=growth))
