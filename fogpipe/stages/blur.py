"""Blur by scattering: how wide it is at each range, and the diffusion that applies it (Hansard 2019)."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.ports import BlurScale, Coefficient, FloatArray, Layer, Length, Range, Unit
from fogpipe.stage import stage

Pixels = Annotated[float, Gt(0), Unit("px")]


@stage("blur.scale")
def scale(
    range_map: Range,
    scattering: Coefficient,
    farthest: Length,
    *,
    finest: Pixels = 1.0,
    strength: Annotated[float, Ge(0), Unit("px")] = 15.0,
) -> BlurScale:
    r"""Standard deviation of the blur in the normalised form of the paper.

    .. math:: \sigma = \sigma_0 + R'^{3/2} (\sigma_\mathrm{max} - \sigma_0), \qquad
              \sigma_\mathrm{max} = \sigma_0 + \lambda \sqrt{\kappa_s'}

    with R' = R / Rmax in [0, 1] and κs' = κs Rmax.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    scattering : κs, one number per metre.
    farthest : Rmax, metres.
    finest : σ0, the standard deviation that the sharpest details of the image have already.
    strength : λ, the blur added at the farthest point at κs' = 1.

    Returns
    -------
    (H, W) float32, or float64 for float64 range, pixels, in [σ0, σmax]. What lies beyond Rmax, as the sky does, gets
    σmax; an unknown range gets σ0.

    Raises
    ------
    ValueError
        If the scattering is not a finite number of 0 or more.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 7.
    """
    reach, near = _within(range_map, farthest)
    blur = strength * math.sqrt(_valid(scattering) * reach)  # σmax − σ0
    return _offset(blur * _three_halves(near / reach), finest)


@stage("blur.scale_power_law")
def scale_power_law(
    range_map: Range,
    scattering: Coefficient,
    farthest: Length,
    *,
    asymmetry: Annotated[float, Ge(-1), Le(1)] = 0.9,
    pixels_per_metre: Annotated[float, Ge(0), Unit("px/m")] = 1.0,
    finest: Pixels = 1.0,
) -> BlurScale:
    r"""Standard deviation of the blur from the asymmetry of the scattering, without absorption.

    .. math:: \sigma = \sigma_0 + m\, \frac{\sqrt{1 - \nu}}{2 \sqrt 2}\, \kappa_s^{1/2} R^{3/2}

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    scattering : κs, one number per metre.
    farthest : Rmax, metres. What lies beyond it, as the sky does, is blurred as if at Rmax.
    asymmetry : ν, the mean cosine of the scattering angle; 1 is straight on and does not blur.
    pixels_per_metre : m. The formula gives a length in the scene; the paper leaves the factor to pixels open, and
        takes one for the whole image. A perspective camera has its focal length in pixels divided by the
        range, here the range at which the blur should have its true size.
    finest : σ0, the standard deviation that the sharpest details of the image have already.

    Returns
    -------
    (H, W) float32, or float64 for float64 range, pixels, σ0 or more. An unknown range gets σ0.

    Raises
    ------
    ValueError
        If the scattering is not a finite number of 0 or more.

    Notes
    -----
    This is the limit of :func:`scale_premoze` without absorption, and the form of :func:`scale`, with
    λ = m Rmax √(1 − ν) / (2 √2).

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 6, plus σ0.
    """
    _, near = _within(range_map, farthest)
    width = math.sqrt((1 - asymmetry) * _valid(scattering) / 8)
    return _offset(pixels_per_metre * width * _three_halves(near), finest)


@stage("blur.scale_premoze")
def scale_premoze(
    range_map: Range,
    absorption: Coefficient,
    scattering: Coefficient,
    farthest: Length,
    *,
    asymmetry: Annotated[float, Ge(-1), Le(1)] = 0.9,
    pixels_per_metre: Annotated[float, Ge(0), Unit("px/m")] = 1.0,
    finest: Pixels = 1.0,
) -> BlurScale:
    r"""Standard deviation of the blur from asymmetry and absorption, by path integrals.

    .. math:: \sigma = \sigma_0 + m \sqrt{\frac12 \left(
              \frac{2 \kappa_a}{3 R} + \frac{4}{(1 - \nu) \kappa_s R^3} \right)^{-1}}

    Absorption narrows the blur, since it takes most from the longest detours.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    absorption, scattering : κa and κs, numbers per metre.
    farthest, asymmetry, pixels_per_metre, finest : as in :func:`scale_power_law`.

    Returns
    -------
    (H, W) float32, or float64 for float64 range, pixels, σ0 or more. An unknown range gets σ0.

    Raises
    ------
    ValueError
        If a coefficient is not a finite number of 0 or more.

    Notes
    -----
    Evaluated as the power law divided by √(1 + κa (1 − ν) κs R² / 6), the same number, finite at R = 0.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 5, after Premože et al. 2004, plus σ0.
    """
    _, near = _within(range_map, farthest)
    scattered = (1 - asymmetry) * _valid(scattering)
    width = math.sqrt(scattered / 8) / np.sqrt(1 + _valid(absorption) * scattered / 6 * near**2)
    return _offset(pixels_per_metre * width * _three_halves(near), finest)


def _within(range_map: Range, farthest: Length) -> tuple[float, FloatArray]:
    """Rmax, and the range clipped to [0, Rmax] with 0 where it is unknown. With no Rmax, all is at 0 of 1."""
    require_maps(range_map=(range_map, 1))
    (range_map,) = floats(range_map)
    reach = float(farthest)
    if not reach > 0:
        return 1.0, np.zeros_like(range_map)
    return reach, np.fmin(np.fmax(range_map, 0), range_map.dtype.type(reach))


def _three_halves(ratio: FloatArray) -> FloatArray:
    return ratio * np.sqrt(ratio)


def _offset(blur: FloatArray, finest: float) -> FloatArray:
    if not finest > 0:
        raise ValueError(f"finest must be above 0 px, not {finest:g}.")
    blur += blur.dtype.type(finest)
    return blur


def _valid(coefficient: Coefficient) -> float:
    if not 0 <= coefficient < np.inf:
        raise ValueError(f"a coefficient must be a finite number of 0 or more per metre, not {coefficient:g}.")
    return float(coefficient)


def _nothing_to_blur(scale: BlurScale, finest: float, tolerance: float) -> str | None:
    """skipped where the largest blur is below what the tolerance can see"""
    largest = float(np.fmax.reduce(scale, axis=None))
    # One Euler step of this rate moves a value in [0, 1] by at most four rates, 2 (σ² − σ0²).
    if largest > finest and 2 * (largest**2 - finest**2) > tolerance:
        return None
    return f"the largest blur, {largest:.4g} px, is the σ0 of the image, {finest:.4g} px, within the tolerance"


@stage("blur.diffusion", identity_when=_nothing_to_blur)
def diffusion(
    layer: Layer,
    scale: BlurScale,
    *,
    solver: Literal["auto", "invariant", "invariant-corrected", "euler", "fed", "adi", "mipmap", "reference"] = "auto",
    finest: Pixels = 1.0,
    max_rate: Annotated[float, Gt(0), Le(0.25)] = 0.25,
    tolerance: Annotated[float, Gt(0)] = 0.002,
) -> Layer:
    r"""Blur a layer to a scale that varies over the image, by inhomogeneous diffusion.

    .. math:: \partial_t F = \nabla \cdot (\varrho\, \nabla F), \qquad
              \varrho(x) = \tfrac12 (\sigma^2(x) - \sigma_0^2), \quad 0 \le t \le 1

    Colour and opacity of the premultiplied layer are blurred alike. Little leaks out of a sharp foreground: the rate
    across an edge is the mean of both sides, so the first pixels beyond it take some of its light.

    Parameters
    ----------
    layer : (H, W, 4) float, premultiplied colour and opacity; values above 1 (HDR) are welcome.
    scale : (H, W) float, σ in pixels. A value below σ0, or NaN, stands for σ0.
    solver : ``"auto"`` aims at the tolerance at the least cost. ``"invariant"`` (eq. 17–18) and ``"euler"`` (eq. 11–13)
        are as published; see the notes for these and the others.
    finest : σ0, the standard deviation that the sharpest details of the layer have already.
    max_rate : ρmax, the largest rate of one step of ``"invariant"``, ``"euler"`` and ``"fed"``. Above 1/4 the steps are
        unstable, and refused.
    tolerance : Root-mean-square error allowed, in the units of the layer. A blur that cannot exceed it is not computed.
        Only ``"auto"`` has more error control than this.

    Returns
    -------
    (H, W, 4) float32, or float64 for a float64 layer and from ``"reference"``.

    Raises
    ------
    ValueError
        If ``max_rate`` is not in (0, 1/4], ``finest`` is not above 0, a scale is infinite, or the sizes differ.

    Notes
    -----
    ``"auto"`` joins pixels to larger cells where the blur is wide, never across a wall of the scale, and steps all
    cells together by one Chebyshev polynomial; pixels far from larger cells are stepped in tiles, and rates of 0 cost a
    copy. It chooses size of cells and degree by what cells missed on nine scenes, which is no bound; below 65 536
    pixels it stays on the pixels, and there a layer rougher than a photograph has a strict one. Values may overshoot
    the least and the largest by a few per cent of their difference. Memory: 1.5 to 2.5 layers more than the result on
    photographs, up to 5 where the scale is torn everywhere.

    ``"invariant-corrected"`` adds the variance that the scale asks for, at 1.23 times the steps. ``"fed"`` is Fast
    Explicit Diffusion in four cycles, ``"adi"`` eight implicit steps of tridiagonal systems, ``"reference"`` the
    polynomial in float64 with 1e-9 left out. ``"mipmap"`` interpolates between masked Gaussians of 0.5, 1, 2, … px
    (Elek et al. 2013); its cost does not depend on σ, it does not conserve the mean, and it solves no equation.

    The published schemes take the memory of two more layers. Against the exact Gaussian, with one σ of 5 to 20 px for
    the whole of a photograph in float32, the root-mean-square error is 6e-3 to 9e-3 (invariant), 2e-4 to 1e-3
    (euler) and 2e-5 to 1.3e-4 (euler with a ``max_rate`` of 0.2).
    Deviates from the paper, which finds the invariant scheme ten times more accurate than Euler; only its speed
    reproduces.

    ``"euler"`` converges to the equation. It takes (σmax² − σ0²) / (2 ρmax) steps, 1248 for 25 px, of about 2 ns per
    pixel on two cores. No light crosses the border of the image, so the mean is conserved, and every value stays
    between the least and the largest. At a rate of exactly 1/4 a pattern of alternating pixels never fades.

    ``"invariant"`` takes ln(σmax/σ0) / ρmax steps, 13 for 25 px, of about 17 ns per pixel on two cores, with
    offsets ±σk(x) and bilinear samples, clamped to the image. One step adds the variance 2 ρ σk² where the scale asks
    for (e^{2ρ} − 1) σk², so only 77 % of the variance is reached at ρ = 1/4, 88 % at 1/8. It conserves the mean neither
    at the border nor where the scale varies.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 8 (whose second term is ∇ϱ·∇F), 11–13, 17–18.
    """
    from fogpipe.kernels.diffusion import SOLVERS

    require_maps(layer=(layer, 4), scale=(scale, 1))
    if not 0 < max_rate <= 0.25:
        raise ValueError(f"max_rate must be above 0 and at most 1/4, the limit of stability, not {max_rate:g}.")
    if not finest > 0:
        raise ValueError(f"finest must be above 0 px, not {finest:g}.")
    if np.isposinf(scale).any():
        raise ValueError("scale is infinite at some pixels; bound it first, for example with blur.scale.")
    if _nothing_to_blur(scale, finest, tolerance):
        return floats(layer)[0].copy()
    return SOLVERS[solver](layer, scale, finest, max_rate, tolerance)
