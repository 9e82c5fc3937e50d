r"""The kernel of photons that a fog has scattered, as a closed form fitted to a Monte Carlo."""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.scattering.profiles import ANGLES, normalised

LEAST, MOST = 0.1, 8.0
"""Optical thicknesses of the table."""


def profiles(q: float, thicknesses: np.ndarray) -> FloatArray:
    """(n, angles) profiles for (n,) optical thicknesses; provisional: the three fits of q = 0.9."""
    logs = np.log(np.clip(thicknesses, 1.2, 4))
    known = np.log([1.2, 2, 4])
    width = np.radians(np.interp(logs, known, [6.1, 8.9, 22]))[:, None]
    power = np.interp(logs, known, [0.83, 0.83, 1.0])[:, None]
    sine_over_angle = np.sinc(ANGLES / np.pi)
    return normalised(sine_over_angle * (1 + (ANGLES / width) ** 2) ** -power)
