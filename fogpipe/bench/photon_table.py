"""Makes the table behind :mod:`fogpipe.kernels.scattering.measured`: ``python -m fogpipe.bench.photon_table``.

For each asymmetry q and optical thickness T, the angles within which given shares of the scattered light arrive, from
:mod:`fogpipe.bench.photons`. Takes some minutes.
"""

from __future__ import annotations

import numpy as np

from fogpipe.bench.photons import energies
from fogpipe.io.atomic import atomic_write
from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.scattering.measured import LOG_ODDS, TABLE

ASYMMETRIES = (0.0, 0.2, 0.4, 0.55, 0.7, 0.8, 0.85, 0.9, 0.925, 0.95, 0.975, 0.99)
THICKNESSES = (0.02, 0.1, 0.2, 0.4, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.3, 16.0, 22.6, 32.0)
PHOTONS = 3_000_000
BORDERS = np.pi / 2 * np.linspace(0, 1, 2001) ** 2


def angles(q: float, thickness: float) -> FloatArray:
    """Angles, in degrees, within which the shares of :data:`~fogpipe.kernels.scattering.measured.LOG_ODDS` arrive."""
    photons = round(PHOTONS * min(1.0, 8 / thickness))  # beyond T = 8, where each scatters up to T² times, fewer do
    shares = np.append(0, np.cumsum(energies(q, thickness, photons, BORDERS, seed=11)))
    return np.degrees(np.interp(1 / (1 + np.exp(-LOG_ODDS)), shares / shares[-1], BORDERS))


def make() -> None:
    """Measure all and write the table."""
    rows = [(q, T, *angles(q, T)) for q in ASYMMETRIES for T in THICKNESSES]
    header = "Made by fogpipe.bench.photon_table: q, T, angles in degrees that hold the shares 1 / (1 + e^-y); y is\n"
    header += "q,T," + ",".join(f"{y:g}" for y in LOG_ODDS)
    with atomic_write(TABLE) as temporary:
        np.savetxt(temporary, np.array(rows), fmt="%.5g", delimiter=",", header=header, encoding="utf-8")


if __name__ == "__main__":
    make()
