r"""The atmospheric point spread function of Narasimhan and Nayar (2003): a series of Legendre polynomials.

.. math:: I(T, \mu) = \sum_{m \ge 0} (g_m + g_{m+1}) P_m(\mu), \qquad g_0 = 0, \quad
          g_m = e^{-\beta_m T - (m+1) \ln T}, \quad \beta_m = \frac{2m+1}{m} (1 - q^{m-1})

It converges like T^{-m}, so only for T > 1.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray

MOST_TERMS = 200_000
"""Enough for T = 1.0002; a fraction of a second for a few hundred angles."""


def series(q: float, thickness: float, cosines: np.ndarray, accuracy: float = 1e-10) -> FloatArray:
    """T²·I(T, µ), whose mean over the sphere is 1.

    Parameters
    ----------
    q : Henyey-Greenstein asymmetry, in [0, 1].
    thickness : T, optical thickness between source and observer, above 1.
    cosines : (n,) µ, cosines of the angle to the direction of the source.
    accuracy : Bound on the sum of all terms left out.

    Returns
    -------
    (n,) float64. Near 0, and of either sign within rounding, where the series vanishes at µ = −1.

    Raises
    ------
    ValueError
        If T is not above 1, where the series diverges, or so near to 1 that it needs more than 200 000 terms; or if
        q is not in [0, 1].
    """
    if not 0 <= q <= 1:
        raise ValueError(f"asymmetry must be in [0, 1], not {q:g}.")
    scaled = coefficients(q, thickness, number_of_terms(q, thickness, accuracy) + 1)
    return _legendre_sum(scaled[:-1] + scaled[1:], np.asarray(cosines, np.float64).ravel())


def coefficients(q: float, thickness: float, count: int) -> FloatArray:
    """T²·g_m for m = 0 … count − 1."""
    m = np.arange(1, count, dtype=np.float64)
    beta = (2 * m + 1) / m * (1 - np.power(q, m - 1))
    return np.concatenate([[0.0], np.exp(-beta * thickness - (m - 1) * math.log(thickness))])


def number_of_terms(q: float, thickness: float, accuracy: float) -> int:
    r"""Least number M of terms after which the rest of T²·I is below ``accuracy``, whatever the angle.

    From m = 2 on, β_m is at least 2 (1 − q^{m−1}), which grows with m, and |P_m| ≤ 1, so that the rest is at most
    :math:`2 \sum_{m \ge M} T^2 g_m \le 2 e^{-2 (1 - q^{M-1}) T}\, T^{1-M} / (1 - 1/T)`.
    """
    if not 1 < thickness < math.inf:
        raise ValueError(
            f"the Legendre series needs an optical thickness above 1, not {thickness:g}: it converges like T^-m."
            ' Use the kernel "gaussian" or scattering.blur, which take any thickness.'
        )
    steps = math.log(thickness)
    # The rest at M without the exponential is an upper bound: a first guess that is large enough.
    most = 2 + math.ceil(max(0.0, math.log(2 / accuracy / -math.expm1(-steps)) / steps))
    terms = np.arange(2, min(most, MOST_TERMS) + 1, dtype=np.float64)
    rest = math.log(2) - 2 * (1 - np.power(q, terms - 1)) * thickness + (1 - terms) * steps
    small = np.flatnonzero(rest <= math.log(accuracy) + math.log(-math.expm1(-steps)))
    if not small.size:
        raise ValueError(
            f"the Legendre series needs more than {MOST_TERMS} terms at an optical thickness of {thickness:.9g}:"
            ' stay above 1.001, or use the kernel "gaussian" or scattering.blur.'
        )
    return int(terms[small[0]])


@njit(cache=True, nogil=True)
def _legendre_sum(weights, cosines):  # pragma: no cover - compiled
    total = np.empty_like(cosines)
    for i in range(len(cosines)):
        mu, before, now, added = cosines[i], 1.0, cosines[i], weights[0]
        for m in range(1, len(weights)):
            added += weights[m] * now
            before, now = now, ((2 * m + 1) * mu * now - m * before) / (m + 1)
        total[i] = added
    return total
