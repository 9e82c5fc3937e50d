r"""Kernels as profiles: p(θ) = I(θ) sin θ on a fixed grid of angles from 0 to 90°.

The radiance I of light scattered once has a cusp of 1/θ, which p has not, and the energy between two angles is
:math:`2\pi \int p\, d\theta`. All profiles have the energy 1 over the hemisphere that an image plane can show.
"""

from __future__ import annotations

import math

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.scattering.legendre import series

ANGLES = np.pi / 2 * np.linspace(0, 1, 601) ** 2
"""Radians, dense near 0, where narrow kernels end."""


def energy(profiles: np.ndarray) -> FloatArray:
    """Energy of profiles (…, angles) over the hemisphere, by the trapezoidal rule on :data:`ANGLES`."""
    return 2 * np.pi * np.trapezoid(profiles, ANGLES, axis=-1)


def energy_between(profile: np.ndarray, angles: np.ndarray) -> FloatArray:
    """Energy of a profile between neighbouring angles, (n − 1,) for (n,) ascending ones in radians."""
    steps = np.pi * (profile[1:] + profile[:-1]) * np.diff(ANGLES)
    return np.diff(np.interp(angles, ANGLES, np.concatenate([[0.0], np.cumsum(steps)])))


def normalised(profiles: np.ndarray) -> FloatArray:
    """The profiles with the energy 1."""
    return profiles / energy(profiles)[..., None]


def legendre(q: float, thickness: float) -> FloatArray:
    """Profile of the Legendre series (Narasimhan & Nayar 2003), as published; refuses T ≤ 1."""
    return normalised(series(q, thickness, np.cos(ANGLES)) * np.sin(ANGLES))


def generalised_gaussian(q: float, thickness: float, exponent: float = 0.5) -> FloatArray:
    r"""Profile of a generalised Gaussian (Metari & Deschênes 2007), for any thickness above 0.

    .. math:: I(\theta) \propto e^{-|\theta / A|^p}, \quad p = k T, \quad
              A = \sigma \sqrt{\Gamma(1/p) / \Gamma(3/p)}, \quad \sigma = (1 - q) / q

    Parameters
    ----------
    q : Asymmetry, in (0, 1).
    thickness : T, above 0.
    exponent : k.

    Raises
    ------
    ValueError
        If q is not in (0, 1), where σ is 0 or infinite, or T is not above 0.
    """
    if not 0 < q < 1:
        raise ValueError(f'asymmetry must be above 0 and below 1 for the kernel "gaussian", not {q:g}.')
    if not thickness > 0:
        raise ValueError(f"optical thickness must be above 0, not {thickness:g}.")
    p = exponent * thickness
    log_width = math.log((1 - q) / q) + (math.lgamma(1 / p) - math.lgamma(3 / p)) / 2
    with np.errstate(divide="ignore", over="ignore"):  # the angle 0, and e^{-∞}
        log_radiance = -np.exp(p * (np.log(ANGLES) - log_width))
    # Relative to the least angle that has a share, so that a needle (small T) does not vanish between two angles.
    shape = np.exp(log_radiance - log_radiance[1]) * np.sin(ANGLES)
    return normalised(shape)
