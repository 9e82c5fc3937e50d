"""The medium: how much light it takes out of the line of sight, and how much arrives."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import floats, require_maps, require_nonnegative
from fogpipe.ports import Coefficient, Density, Length, Range, Transmission, Unit
from fogpipe.stage import stage

Threshold = Literal["wmo-5%", "koschmieder-2%"]
"""The contrast at which something counts as just visible.

``"wmo-5%"`` is the meteorological optical range of the World Meteorological Organization, β V = 2.996;
``"koschmieder-2%"`` is Koschmieder's visual range, β V = 3.912.
"""

_CONTRAST: dict[str, float] = {"wmo-5%": 0.05, "koschmieder-2%": 0.02}


Weather = Literal[
    "dense-fog",
    "thick-fog",
    "moderate-fog",
    "light-fog",
    "thin-fog",
    "haze",
    "light-haze",
    "clear",
    "very-clear",
    "extremely-clear",
]
"""The international visibility grades 0 to 9, as Guo 2014, Table 1, lists them."""

VISIBILITY: dict[Weather, tuple[float, float]] = {
    "dense-fog": (12.5, 50),
    "thick-fog": (50, 200),
    "moderate-fog": (200, 500),
    "light-fog": (500, 1_000),
    "thin-fog": (1_000, 2_000),
    "haze": (2_000, 4_000),
    "light-haze": (4_000, 10_000),
    "clear": (10_000, 20_000),
    "very-clear": (20_000, 50_000),
    "extremely-clear": (50_000, 1_540_000),
}
"""Bounds of the visibility in each grade, metres; a grade stands for their geometric mean.

The table leaves the first and the last grade open. The densest is given the width of the next one, a factor of 4, and
stands for 25 m. The clearest is given the bound that makes it stand for the extinction of the table, 0.0141 per
kilometre or 277 km, that of air without any particles.
"""


METRES_PER_KILOMETRE = 1_000


class Medium(NamedTuple):
    """A homogeneous medium: coefficients per metre (the extinction is the sum of the others), and how far one sees."""

    absorption: Coefficient
    scattering: Coefficient
    extinction: Coefficient
    visibility: Length


def extinction_from_visibility(visibility: float, threshold: Threshold = "wmo-5%") -> float:
    """Extinction of a medium with a visibility, β = −ln(contrast) / V.

    Parameters
    ----------
    visibility : V, metres; infinite for clear air.
    threshold : The contrast that it refers to.

    Returns
    -------
    β, per metre; 0 for an infinite visibility.

    Raises
    ------
    ValueError
        If the visibility is not above 0.
    """
    if not visibility > 0:
        raise ValueError(f"visibility must be above 0 m, not {visibility:g}.")
    return -math.log(_CONTRAST[threshold]) / visibility


def visibility_from_extinction(extinction: float, threshold: Threshold = "wmo-5%") -> float:
    """Visibility in a medium, V = −ln(contrast) / β, the inverse of :func:`extinction_from_visibility`.

    Parameters
    ----------
    extinction : β, per metre.
    threshold : The contrast that the visibility refers to.

    Returns
    -------
    V, metres; infinite for an extinction of 0.

    Raises
    ------
    ValueError
        If the extinction is negative or NaN.
    """
    if not extinction >= 0:
        raise ValueError(f"extinction must be 0 or more per metre, not {extinction:g}.")
    return -math.log(_CONTRAST[threshold]) / float(extinction) if extinction else math.inf


def visibility_of(weather: Weather) -> float:
    """The visibility that a grade of weather stands for, metres: the geometric mean of its bounds."""
    least, most = VISIBILITY[weather]
    return math.sqrt(least * most)


def _one_at_most(**given: object) -> None:
    """Refuse parameters of which each says what the others say; None stands for one that is not given."""
    said = [f"{name} ({value})" for name, value in given.items() if value is not None]
    if len(said) > 1:
        raise ValueError(f"give only one of {' and '.join(said)}, since each of them fixes the others.")


def _one_density(visibility: float | None, extinction: float | None, weather: Weather | None) -> None:
    _one_at_most(visibility=visibility, extinction=extinction, weather=weather)


@stage("medium.fog", requires=_one_density)
def fog(
    farthest: Length,
    *,
    optical_thickness: Annotated[float, Ge(0)] = 1.0,
    visibility: Annotated[float, Gt(0), Unit("m")] | None = None,
    extinction: Annotated[float, Ge(0), Unit("1/m")] | None = None,
    weather: Weather | None = None,
    threshold: Threshold = "wmo-5%",
    albedo: Annotated[float, Ge(0), Le(1)] = 1.0,
) -> Medium:
    r"""A homogeneous medium: how dense it is, said in one of four ways, and how much of it scatters.

    Parameters
    ----------
    farthest : Largest measured range of the scene Rmax, metres. Only the optical thickness needs it.
    optical_thickness : β Rmax, the extinction in the normalised units of the paper, κa' + κs'. At 1 the farthest
        point keeps 37 % of its contrast, whatever the size of the scene. Used when nothing else
        is given.
    visibility : Distance at which contrast falls to the threshold, metres; infinite for clear air.
    extinction : β, per metre.
    weather : A grade of visibility by name, ``dense-fog`` to ``extremely-clear`` (:data:`VISIBILITY`).
    threshold : The contrast that ``visibility`` and ``weather`` refer to.
    albedo : Single-scattering albedo κs / (κa + κs). Water droplets only scatter, 1; smoke may be near 0.3.

    Returns
    -------
    absorption, scattering, extinction : κa, κs and β = κa + κs, numbers per metre.
    visibility : V in metres by ``threshold``, however the medium was given; infinite for clear air.

    Raises
    ------
    ValueError
        If more than one of ``visibility``, ``extinction`` and ``weather`` is given, or if the optical thickness has no
        distance to refer to, because nothing in the scene has a measured range, or none above 0.

    Notes
    -----
    The examples of the paper, (κa', κs') = (.25, 0), (0, .25) and (.25, .25), are an optical thickness of .25, .25
    and .5 with an albedo of 0, 1 and .5.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, sections 2.1 and 5.1; WMO-No. 8, chapter 9;
    Guo, Tang and Xiao 2014, Table 1.
    """
    _one_density(visibility, extinction, weather)
    if weather is not None:
        visibility = visibility_of(weather)
    if visibility is not None:
        extinction = extinction_from_visibility(visibility, threshold)
    elif extinction is None:
        extinction = _extinction_from_thickness(optical_thickness, float(farthest))
    scattering = albedo * extinction
    seen = visibility_from_extinction(extinction, threshold)
    return Medium(*(np.array(number, np.float64) for number in (extinction - scattering, scattering, extinction, seen)))


def _extinction_from_thickness(optical_thickness: float, farthest: float) -> float:
    if optical_thickness == 0:
        return 0.0
    if not farthest > 0:
        raise ValueError(
            "an optical thickness refers to the farthest measured point, and no point of this scene has a"
            " measured range above 0: set visibility (m) or extinction (1/m) instead."
        )
    return optical_thickness / farthest


@stage("medium.transmission")
def transmission(range_map: Range, extinction: Coefficient, density: Density | None = None) -> Transmission:
    r"""Transmission of a medium, the share of light that arrives unscattered, :math:`t = e^{-\beta \rho R}`.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    extinction : β, one number per metre.
    density : (H, W) float, optional. Density ρ of the medium along the ray of each pixel, relative to its mean.

    Returns
    -------
    (H, W) float32, or float64 for float64 range, in [0, 1]. An unknown range gives NaN. The sky gives 0, or
    1 where there is no medium (β ρ = 0).

    Raises
    ------
    ValueError
        If a range or density is negative, the extinction is negative or NaN, or the sizes differ.

    Notes
    -----
    At the speed of memory: 0.8 ns per pixel and one temporary array.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 1, with β = κa + κs.
    """
    maps = {"range_map": range_map} if density is None else {"range_map": range_map, "density": density}
    require_maps(**{name: (array, 1) for name, array in maps.items()})
    require_nonnegative(**maps)
    if not extinction >= 0:
        raise ValueError(f"extinction must be 0 or more per metre, not {extinction:g}.")
    range_map, *rest = floats(*maps.values())
    beta = range_map.dtype.type(min(extinction, np.finfo(range_map.dtype).max))
    with np.errstate(over="ignore", invalid="ignore"):  # a depth too large for a number is as good as infinite
        t = -(rest[0] * beta if rest else beta) * range_map
    if rest or beta == 0:
        t[np.isnan(t) & ~np.isnan(range_map)] = 0  # 0 · ∞: no medium, however far, or nothing in between
    np.exp(t, out=t)
    return t


def _one_factor(factor: float | None, weather: Weather | None) -> None:
    _one_at_most(factor=factor, weather=weather)


@stage("medium.thicken", requires=_one_factor)
def thicken(
    transmission: Transmission,
    density: Density | None = None,
    *,
    factor: Annotated[float, Ge(0)] | None = None,
    weather: Weather | None = None,
    threshold: Threshold = "koschmieder-2%",
    floor: Annotated[float, Ge(0), Le(1)] = 0.1,
) -> Transmission:
    r"""Transmission through a medium that is λ times as dense, :math:`\max(t^{\lambda\rho}, t_0)`.

    Parameters
    ----------
    transmission : (H, W) float, t in [0, 1]. NaN where unknown.
    density : (H, W) float, optional. Density ρ of the medium relative to its mean.
    factor : λ, by which the optical thickness −ln t grows; 1 when neither it nor ``weather`` is given.
    weather : A grade of visibility by name instead of a factor. λ is then its extinction in units of 1/km, which is
        how Tables 2 and 3 of the paper pair the two: the transmission at λ = 1 is seen as that of 1 per kilometre.
    threshold : The contrast that ``weather`` refers to; Table 1 has 2 %.
    floor : t₀, least transmission, so that no point vanishes altogether.

    Returns
    -------
    (H, W) float32, or float64 for float64 transmission, in [t₀, 1]. Unknown stays NaN. λ ρ = 0 gives 1, also where
    the transmission is 0.

    Raises
    ------
    ValueError
        If both ``factor`` and ``weather`` are given, a density is negative, or the sizes differ.

    Notes
    -----
    Deviates from the paper: its eq. 8 divides by max(t^λ, t₀), which takes fog away; this is for eq. 1, which adds it.

    References
    ----------
    Guo, Tang and Xiao 2014, *Foggy scene rendering based on transmission map estimation*, section 4.3, Tables 1 to 3.
    """
    maps = {"transmission": transmission} if density is None else {"transmission": transmission, "density": density}
    require_maps(**{name: (array, 1) for name, array in maps.items()})
    require_nonnegative(**maps)
    _one_factor(factor, weather)
    if weather is not None:
        factor = METRES_PER_KILOMETRE * extinction_from_visibility(visibility_of(weather), threshold)
    t, *rest = floats(*maps.values())
    power = t.dtype.type(1.0 if factor is None else factor)
    thicker = np.maximum(np.power(t, power * rest[0] if rest else power), t.dtype.type(floor))
    thicker[np.isnan(t)] = np.nan  # also to the power of 0
    return thicker
