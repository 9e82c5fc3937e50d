r"""The kernel of light that a fog has scattered, from a table of photons.

For an isotropic source at the centre of a sphere of optical radius T that only scatters, by the phase function of
Henyey and Greenstein, the table holds the angles within which given shares E of the scattered light arrive. With

.. math:: x = \ln \frac{\theta}{\pi/2 - \theta}, \qquad y = \ln \frac{E}{1 - E},

x(y) is nearly straight at both ends, where E grows as a power of θ and 1 − E falls as a power of 90° − θ. So it is x
that is interpolated: by a cubic spline over y, and linearly over ln T and ln(1 − q). A kernel gets wider as a whole
from entry to entry, is nowhere negative, and keeps its energy of 1.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, RegularGridInterpolator

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.scattering.profiles import ANGLES, normalised

TABLE = Path(__file__).parent / "photons.csv"
LOG_ODDS = np.linspace(-7, 7, 41)
"""y of the shares whose angles the table holds, 0.09 % to 99.91 %."""
DRAWN_OUT = np.linspace(2.5 * LOG_ODDS[0], 2.5 * LOG_ODDS[-1], 2000)
"""y at which profiles are made; beyond the table, x is straight."""
LEAST, MOST = 0.02, 32.0
"""Optical thicknesses of the table. In thinner fog light scatters once, in a shape that changes no more."""
MOST_ASYMMETRY = 0.99


def profiles(q: float, thicknesses: np.ndarray) -> FloatArray:
    """(n, angles) profiles for (n,) optical thicknesses, held to those of the table.

    Raises
    ------
    ValueError
        If q is not in [0, 0.99].
    """
    if not 0 <= q <= MOST_ASYMMETRY:
        raise ValueError(
            f"asymmetry must be in [0, {MOST_ASYMMETRY}], not {q:g}: towards 1, scattered light is direct light."
        )
    widths, log_thicknesses, places = _table()
    logs = np.log(np.clip(np.atleast_1d(thicknesses), LEAST, MOST))
    points = np.stack(np.broadcast_arrays(np.log1p(-q), logs), axis=-1)
    spline = CubicSpline(LOG_ODDS, RegularGridInterpolator((widths, log_thicknesses), places)(points), axis=1)
    inside = np.clip(DRAWN_OUT, LOG_ODDS[0], LOG_ODDS[-1])
    slopes = np.maximum(spline(inside, 1), 1e-3)  # no noise of the table may turn the order of angles
    lines = zip(spline(inside) + slopes * (DRAWN_OUT - inside), slopes, strict=True)
    return normalised(np.array([_on_angles(x, slope) for x, slope in lines]))


def _on_angles(x: FloatArray, slope: FloatArray) -> FloatArray:
    """p = dE/dθ / 2π on the common angles, from dE/dy = E (1 − E) and dθ/dx = θ (π/2 − θ) / (π/2)."""
    angles = np.pi / 2 / (1 + np.exp(-x))
    density = 1 / (2 + np.exp(DRAWN_OUT) + np.exp(-DRAWN_OUT)) / slope
    return np.interp(ANGLES, angles, density / (angles * (1 - angles / (np.pi / 2))) / (2 * np.pi))


@cache
def _table() -> tuple[FloatArray, FloatArray, FloatArray]:
    """ln(1 − q) ascending, ln T ascending, and x by q, T and y."""
    rows = np.loadtxt(TABLE, delimiter=",", encoding="utf-8")
    asymmetries, thicknesses = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    angles = rows[:, 2:].reshape(len(asymmetries), len(thicknesses), -1)
    return np.log1p(-asymmetries[::-1]), np.log(thicknesses), np.log(angles / (90 - angles))[::-1]
