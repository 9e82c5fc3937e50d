"""Diffusion split over levels: each moves light at rates it can follow in a few steps.

The conductances of :mod:`grid` add up over the levels, A = A₀ + A₁ + …, and e^{−A} is taken as the product of
e^{−A₀} and the coarser ones (Lie splitting), from coarse to fine, so that each level smooths what the coarser one left
in blocks. Each factor conserves the mean and shrinks every pattern, so the whole is stable at any rate. The factors do
not commute where the rate jumps, and the more stretches of time there are the less that matters.
"""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion.grid import Level, averages, coarser_level, finest_level, sharpened
from fogpipe.kernels.diffusion.polynomial import degree_for, diffused, passes

LAST_CLIP = 64.0
"""At this rate cells of the last level are even."""


def split(layer: FloatArray, scale: FloatArray, finest: float, stretches: int, clip: float, share: float) -> FloatArray:
    """Diffuse a layer (H, W, 4) in ``stretches`` of time, on levels of rates up to ``clip``.

    ``share`` is what a level's polynomial may leave out of any pattern. Without a bound, ``clip`` = inf, there is one
    level and no error but that.
    """
    levels = [finest_level(scale, finest, 1 / stretches, clip)]
    while levels[-1].mobile.any():
        last = min(levels[-1].mass.shape) < 16
        levels.append(coarser_level(levels[-1], LAST_CLIP if last else clip))
        if last:
            break
    spectra = [_spectrum(level) for level in levels]
    shares = [share, *(share / 5 for _ in levels[1:])]  # steps of coarse cells cost little
    series = [passes(spectrum, degree_for(spectrum, each)) for spectrum, each in zip(spectra, shares, strict=True)]
    for _ in range(stretches):
        layer = _cycle(layer, levels, spectra, series)
    return layer


def _cycle(
    layer: FloatArray, levels: list[Level], spectra: list[float], series: list[tuple[np.ndarray, ...]]
) -> FloatArray:
    added = _coarse_change(layer, levels, spectra, series) if len(levels) > 1 else None
    return diffused(layer, levels[0], series[0], spectra[0], added)


def _coarse_change(
    layer: FloatArray, levels: list[Level], spectra: list[float], series: list[tuple[np.ndarray, ...]]
) -> FloatArray:
    """What the coarser levels add to the cells of the next one."""
    coarse = averages(layer, levels[0])
    added = _cycle(coarse, levels[1:], spectra[1:], series[1:])
    return sharpened(np.subtract(added, coarse, out=coarse), levels[1])


def _spectrum(level: Level) -> float:
    """Upper bound of the eigenvalues (Gershgorin), on a scale of fixed steps so that series can be kept."""
    if np.isfinite(level.clip) and level.mobile.any():
        return 8 * level.clip
    mass = level.mass
    most = 0.0
    for conductance, near, far in (
        (level.east[:, :-1], mass[:, :-1], mass[:, 1:]),
        (level.south[:-1], mass[:-1], mass[1:]),
    ):
        smaller = np.minimum(near, far)
        rate = np.divide(conductance, smaller, out=np.zeros_like(conductance), where=smaller > 0)
        most += float(rate.max(initial=0))
    bound = 4 * most
    return float(2 ** (np.ceil(8 * np.log2(bound)) / 8)) if bound > 0 else 0.0
