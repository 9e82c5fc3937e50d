r"""The kernel of light that a fog has scattered, from a table of photons.

For an isotropic source at the centre of a sphere of optical radius T that only scatters, by the phase function of
Henyey and Greenstein, the table holds the angles within which given shares of the scattered light arrive. Between
entries these *angles* are interpolated (in ln T and ln(1 − q)), not the radiance: so a kernel gets wider as a whole, is
nowhere negative, and keeps its energy of 1.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.scattering.profiles import ANGLES, normalised

TABLE = Path(__file__).parent / "photons.csv"
LEVELS = np.concatenate([[0, 0.005, 0.01, 0.02], np.linspace(0, 1, 33)[1:-1], [0.98, 0.99, 0.995, 1]])
"""Shares of the scattered light whose angles the table holds; 0 and 90° are those of the first and the last."""
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
    from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

    if not 0 <= q <= MOST_ASYMMETRY:
        raise ValueError(
            f"asymmetry must be in [0, {MOST_ASYMMETRY}], not {q:g}: towards 1, scattered light is direct light."
        )
    widths, log_thicknesses, angles = _table()
    logs = np.log(np.clip(thicknesses, LEAST, MOST))
    points = np.stack(np.broadcast_arrays(np.log1p(-q), logs), axis=-1)
    # Angles of one level differ by a factor from entry to entry, so that their logarithm is smooth.
    between = np.exp(RegularGridInterpolator((widths, log_thicknesses), angles)(points))
    curves = [PchipInterpolator(np.concatenate([[0], own, [np.pi / 2]]), LEVELS).derivative() for own in between]
    return normalised(np.stack([np.maximum(curve(ANGLES), 0) for curve in curves]))


@cache
def _table() -> tuple[FloatArray, FloatArray, FloatArray]:
    """ln(1 − q) ascending, ln T ascending, and the logarithms of the angles in radians, (q, T, levels)."""
    rows = np.loadtxt(TABLE, delimiter=",", encoding="utf-8")
    asymmetries, thicknesses = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    angles = np.log(np.radians(rows[:, 2:])).reshape(len(asymmetries), len(thicknesses), -1)
    return np.log1p(-asymmetries[::-1]), np.log(thicknesses), angles[::-1]
