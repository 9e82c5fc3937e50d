"""Photons in a sphere of fog: the Monte Carlo that the kernels of :mod:`fogpipe.kernels.scattering` are held against.

An isotropic source sits at the centre of a sphere of optical radius T, filled with a medium that only scatters, with
the phase function of Henyey and Greenstein. A photon that reaches the surface is seen there at the angle θ between its
direction and the radius, which is where an observer at the surface sees its light, apart from the source.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import threads

BATCH = 100_000
"""Photons that share a random stream, so that the number of threads changes nothing."""


def borders(count: int = 90) -> FloatArray:
    """Borders of angular bins over 90°, radians, denser near 0 where the kernels have their cusp."""
    return np.pi / 2 * np.linspace(0, 1, count + 1) ** 1.5


def energies(q: float, thickness: float, photons: int, angles: FloatArray, seed: int = 0) -> FloatArray:
    """Share of the scattered light in each angular bin, ∫ I dω over the bin, with I normalised over 90°.

    Parameters
    ----------
    q : Henyey-Greenstein asymmetry, in [0, 1).
    thickness : T, optical radius of the sphere, above 0.
    photons : How many are followed, in batches of 100 000. Of the light, 0.4 √(bins / photons) is misplaced by chance.
    angles : Borders of the bins, (bins + 1,) ascending angles from 0 to π/2, radians.
    seed : Of the random streams.

    Returns
    -------
    (bins,) float64 of sum 1.

    Notes
    -----
    Every photon is forced to scatter before it leaves, so that all of them count at any T. What crosses a surface is
    radiance times cosine, so a photon adds 1/µ to the radiance; within a bin, the mean cosine is taken.
    """
    batches = max(1, round(photons / BATCH))
    streams = np.random.default_rng(seed).spawn(batches)
    with ThreadPoolExecutor(threads()) as pool:
        crossed = sum(pool.map(lambda rng: _follow(rng, BATCH, q, thickness, np.cos(angles)), streams))
    low, high = np.cos(angles[1:]), np.cos(angles[:-1])
    radiance = np.asarray(crossed) / (high + low)  # ∫ µ dω = π (high² − low²) beside ∫ dω = 2π (high − low)
    return radiance / radiance.sum()


def misplaced(shares: FloatArray, truth: FloatArray) -> float:
    """Share of the light that is at another angle than it should be, half of the L1 distance, from 0 to 1."""
    return float(np.abs(shares - truth).sum() / 2)


@njit(cache=True, nogil=True)
def _follow(rng, photons, q, thickness, cosines):  # pragma: no cover - compiled
    """Photons that cross the surface in each bin of falling cosines. By symmetry, only radius and cosine matter."""
    counts = np.zeros(len(cosines) - 1)
    for _ in range(photons):
        radius = -np.log1p(-rng.random() * (1 - np.exp(-thickness)))  # the forced first flight, straight out
        mu = 1.0
        while True:
            mu = _deflected(mu, q, rng)
            flight = -np.log1p(-rng.random())
            squared = radius * radius + flight * flight + 2 * radius * flight * mu
            if squared >= thickness * thickness:
                # Where the straight line leaves the sphere its distance from the centre, r √(1 − µ²), is the same.
                sine = min(1.0, radius / thickness * np.sqrt(max(0.0, 1 - mu * mu)))
                cosine = np.sqrt(1 - sine * sine)
                first, last = 0, len(counts)
                while last - first > 1:
                    middle = (first + last) // 2
                    if cosine <= cosines[middle]:
                        first = middle
                    else:
                        last = middle
                counts[first] += 1
                break
            new = np.sqrt(squared)
            mu = min(1.0, max(-1.0, (radius * mu + flight) / max(new, 1e-300)))
            radius = new
    return counts


@njit(cache=True, nogil=True, inline="always")
def _deflected(mu, q, rng):  # pragma: no cover - compiled
    """Cosine to the radius after a scattering by an angle drawn from the phase function, at a random azimuth."""
    draw = rng.random()
    if q > 1e-6:
        ratio = (1 - q * q) / (1 - q + 2 * q * draw)
        cosine = (1 + q * q - ratio * ratio) / (2 * q)
    else:
        cosine = 2 * draw - 1
    across = np.sqrt(max(0.0, (1 - cosine * cosine) * (1 - mu * mu)))
    return min(1.0, max(-1.0, mu * cosine + across * np.cos(2 * np.pi * rng.random())))
