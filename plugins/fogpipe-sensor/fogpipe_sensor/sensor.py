"""Sensor: what a camera adds to the light that reaches it."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from fogpipe.ports import Image, Unit
from fogpipe.stage import stage

COUNTABLE = 9e18
"""Electrons that fit the integers of NumPy's Poisson generator."""


def _no_noise(full_well: float) -> str | None:
    """skipped when the full well is infinite"""
    return "an infinite full well leaves no noise" if math.isinf(full_well) else None


@stage("sensor.noise", identity_when=_no_noise)
def noise(
    image: Image,
    *,
    rng: np.random.Generator,
    full_well: Annotated[float, Gt(0), Unit("e⁻")] = 10_000.0,
    read_noise: Annotated[float, Ge(0), Unit("e⁻")] = 3.0,
) -> Image:
    r"""Noise of a linear sensor: shot noise, which grows with the light, and read noise, which is always there.

    A pixel of the value x collects a Poisson number of electrons of the mean N x, and the electronics add a
    Gaussian number of mean zero:

    .. math:: y = \frac{n + g}{N}, \quad n \sim \mathrm{Poisson}(N x), \quad g \sim \mathcal{N}(0, \sigma_r^2), \qquad
              \mathrm{var}(y) = \frac{x}{N} + \frac{\sigma_r^2}{N^2}.

    Parameters
    ----------
    image : (H, W, 3) float, linear light; the model does not hold for display values.
    rng : Draws the noise.
    full_well : N, the electrons that a pixel holds at display white. The signal-to-noise ratio at white is about
        √N. Infinite for no noise at all.
    read_noise : σr, standard deviation of the read noise in electrons.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image; not clipped. A negative value counts as dark: it
    gets read noise only.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or so bright that its electrons cannot be counted (above 9e18).

    Notes
    -----
    Pixels and channels are independent: no colour filter array, no dark current, no fixed pattern. About 160 ns
    per pixel on one core, and seven times the memory of a float32 image.

    References
    ----------
    EMVA 1288, *Standard for characterization of image sensors and cameras*, release 4.0, the linear model.
    """
    image = np.asarray(image, np.result_type(image, np.float32))
    if _no_noise(full_well):
        return image.copy()
    expected = full_well * np.maximum(image, 0, dtype=np.float64)
    if not expected.max() <= COUNTABLE:  # also where it is NaN
        raise ValueError("the image is not finite, or too bright for its electrons to be counted; check what made it.")
    deviation = rng.poisson(expected) - expected
    if read_noise:
        deviation += read_noise * rng.standard_normal(image.shape)
    return image + (deviation / full_well).astype(image.dtype)
