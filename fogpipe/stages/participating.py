"""Participating media in a single picture, by its hue, lightness and saturation (Lopez-Moreno 2008)."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps, require_nonnegative
from fogpipe.ports import Density, Image, Number, RelativeDepth, Unit
from fogpipe.stage import stage

Share = Annotated[float, Ge(0), Le(1)]
Preset = Literal[
    "house-left", "house-centre", "house-right",
    "forest-left", "forest-centre", "forest-right",
    "statue-left", "statue-centre", "statue-right",
]  # fmt: skip


class Medium(NamedTuple):
    """The parameters of Table 1, in the units of a depth from 0 to 1."""

    extinction: Number
    scattering: Number
    airlight_lightness: Number
    airlight_saturation: Number
    octaves: Number
    period: Number


PRESETS: dict[str, tuple[float, float, float, float, int, int]] = {
    "house-left": (1.2, 0.8, 0.6, 0.2, 5, 250),
    "house-centre": (0.6, 0.35, 0.25, 0.2, 6, 450),
    "house-right": (0.7, 0.5, 0.5, 0.3, 3, 300),
    "forest-left": (1.0, 0.8, 0.4, 0.35, 6, 250),
    "forest-centre": (0.5, 0.35, 0.15, 0.35, 5, 400),
    "forest-right": (0.9, 0.65, 0.5, 0.35, 4, 400),
    "statue-left": (0.5, 0.3, 0.01, 0.025, 6, 900),
    "statue-centre": (0.65, 0.45, 0.15, 0.025, 4, 1500),
    "statue-right": (0.75, 0.5, 0.025, 0.04, 5, 750),
}
"""Table 1: k, σ, InScat_L, InScat_S, octaves, period (px)."""


@stage("participating.medium")
def medium(
    *,
    preset: Preset = "house-left",
    extinction: Annotated[float, Ge(0)] | None = None,
    scattering: Annotated[float, Ge(0)] | None = None,
    airlight_lightness: Annotated[float, Ge(0)] | None = None,
    airlight_saturation: Share | None = None,
    octaves: Annotated[int, Ge(0), Le(16)] | None = None,
    period: Annotated[float, Ge(1), Unit("px")] | None = None,
) -> Medium:
    """One of the nine media of Table 1, or a change of one.

    Parameters
    ----------
    preset : A picture of Figure 16 and its place in the row.
    extinction, scattering : k and σ, for the farthest point, Z = 1. By default those of the preset, as all that follow.
    airlight_lightness, airlight_saturation : InScat_L and InScat_S.
    octaves, period : Of the Perlin noise; the period in pixels.

    Returns
    -------
    extinction, scattering, airlight_lightness, airlight_saturation, octaves, period : numbers.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, Table 1.
    """
    given = (extinction, scattering, airlight_lightness, airlight_saturation, octaves, period)
    values = (own if own is not None else usual for own, usual in zip(given, PRESETS[preset], strict=True))
    return Medium(*(np.array(value, np.float64) for value in values))


@stage("participating.density")
def density(
    image: Image,
    octaves: Number,
    period: Number,
    *,
    contrast: Share = 0.3,
    noise: Literal["gradient", "value"] = "gradient",
    rng: np.random.Generator,
) -> Density:
    """Perlin density with octaves and period as numbers of the graph, see :func:`fogpipe.stages.density.perlin`.

    Parameters
    ----------
    image : (H, W, 3) float. Only its size is used.
    octaves, period : numbers; the period in pixels of the picture as it is.
    contrast : Standard deviation of the density. The paper gives an amplitude of 1 for the noise, and not what it does.
    noise : ``"gradient"``, or ``"value"`` as the paper describes it.
    rng : Draws the noise.

    Returns
    -------
    (H, W) float32, relative to the mean.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, section 3.4.2 and Figure 9.
    """
    from fogpipe.stages.density import perlin

    return perlin(image, period=float(period), octaves=int(octaves), contrast=contrast, noise=noise, rng=rng)


@stage("participating.highlights")
def highlights(
    image: Image,
    *,
    compression: Annotated[float, Gt(0)] = 1.0,
    brighter_than: Annotated[float, Ge(0), Le(1)] = 0.5,
) -> Image:
    r"""Attenuate highlights, as the medium does before light falls on things.

    A highlight begins at the lightness T at which the histogram of the picture falls most steeply. Above it

    .. math:: L' = T \left(1 + \frac{\ln(1 + c\,(L/T - 1))}{c}\right)

    while hue and saturation stay.

    Parameters
    ----------
    image : (H, W, 3) float, linear light, HDR welcome. Negative light counts as 0.
    compression : c. At 1, a light e times as strong is one T lighter; near 0 nothing changes.
    brighter_than : Share of the pixels that are no highlights. The fall is looked for above it.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image. What is not brighter than T stays.

    Raises
    ------
    ValueError
        If the image is not finite somewhere.

    Notes
    -----
    The histogram counts half f-stops, smoothed, over 24 stops below the lightest pixel. A picture of one lightness, or
    black, has no highlights. Deviates from the paper: it looks at the whole histogram, of which a night sky is the
    steepest fall, and does not say how it attenuates.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, section 3.4.2 and Figure 5; Khan 2006, *Image-based material
    editing*.
    """
    from fogpipe.kernels import hls

    (image,) = _light_and_maps(image)
    threshold = hls.highlight_threshold(hls.lightness(image), brighter_than)
    return hls.brighten_highlights_less(image, threshold, compression) if threshold < np.inf else image.copy()


@stage("participating.relight")
def relight(
    image: Image,
    extinction: Number,
    scattering: Number,
    depth: RelativeDepth | None = None,
    *,
    shadow_lift: Share = 0.5,
    airlight_hue: Annotated[float, Unit("°")] = 220.0,
    shadows: Literal["smooth", "published"] = "smooth",
    reach: Literal["with-depth", "everywhere"] = "with-depth",
) -> Image:
    r"""Light the scene as inside the medium: shadows lifted, colours greyed and drawn to the hue of the airlight.

    .. math:: S' = S\,(1 - kZ), \quad H' = H\,(1 - \sigma Z) + H_A\,\sigma Z, \quad
              L' = L + S_R Z\,(T - L) \text{ where } L < T = \frac{L_\mathrm{max} - L_\mathrm{min}}{5}

    Parameters
    ----------
    image : (H, W, 3) float, linear light, without highlights (:func:`highlights`). Negative light counts as 0.
    extinction, scattering : k and σ, numbers.
    depth : (H, W) float, optional. Z, 0 near to 1 far; 1 everywhere where it is not given.
    shadow_lift : S_R.
    airlight_hue : H_A = InScat_H, constant and not given in the paper.
    shadows : ``"smooth"``, the equation above; ``"published"``: all shadows are lifted by S_R Z T, so that lightness
        jumps at T, and what was darker becomes lighter.
    reach : ``"with-depth"``: near things keep their colours; ``"everywhere"``, as printed: Z counts as 1.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image; 0 or more.

    Raises
    ------
    ValueError
        If the image is not finite somewhere, the depth unknown (NaN), k or σ is not a number of 0 or more, or the
        sizes differ.

    Notes
    -----
    Hues are blended as vectors, of the length of the saturation: continuous everywhere, and complementary colours meet
    in grey. From kZ = 1 on nothing is left of the saturation, from σZ = 1 on nothing of the hue.

    Deviates from the paper, whose Algorithm 1 lists Z among its data and does not use it: at k = 1 the nearest thing is
    grey, too. The extremes are the quantiles 0.1 % and 99.9 %, so that no single pixel decides what is a shadow.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, Algorithm 1.
    """
    from fogpipe.kernels import hls

    k, sigma = _coefficients(extinction=extinction, scattering=scattering)
    if depth is None or reach == "everywhere":
        depth = np.ones(image.shape[:2], np.float32)
    image, depth = _light_and_maps(image, depth=depth)
    least, most = np.quantile(hls.lightness(image), (0.001, 0.999))
    shadow = float(most - least) / 5
    return hls.lift_and_grey(
        image, depth, shadow, shadow_lift, shadows == "published", k, sigma, hls.pure_hue(airlight_hue)
    )


@stage("participating.fog")
def fog(
    image: Image,
    depth: RelativeDepth,
    extinction: Number,
    scattering: Number,
    airlight_lightness: Number,
    airlight_saturation: Number,
    density: Density | None = None,
    *,
    airlight_hue: Annotated[float, Unit("°")] = 220.0,
) -> Image:
    r"""Take out of the light what is lost on the way, and add the airlight.

    .. math:: L' = L\,e^{-k \rho Z} + \sigma \rho Z\, L_A

    Parameters
    ----------
    image : (H, W, 3) float, linear light. Negative light counts as 0.
    depth : (H, W) float, Z, 0 near to 1 far.
    extinction, scattering : k and σ, numbers.
    airlight_lightness, airlight_saturation : L_A = InScat_L and S_A = InScat_S, numbers.
    density : (H, W) float, optional. ρ, relative to its mean.
    airlight_hue : H_A = InScat_H, constant and not given in the paper.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image; 0 or more.

    Raises
    ------
    ValueError
        If the image is not finite somewhere, the depth unknown (NaN) or the density negative, a number
        is not 0 or more, or the sizes differ.

    Notes
    -----
    Lightness follows the equation exactly. Hue and saturation are those of the two lights together: the difference from
    grey of the dimmed picture and that of the airlight are added, which blends hues on their circle.

    Deviates from the paper, whose Algorithm 2 prints 1 − L e^(−KZ), and whose Algorithm 3 adds σ Z InScat_L to a
    pixel without naming its channel.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, eq. 4, Algorithms 2 and 3.
    """
    from fogpipe.kernels import hls

    maps = {"depth": depth} if density is None else {"depth": depth, "density": density}
    image, matter, *rest = _light_and_maps(image, **maps)
    k, sigma, lightness, saturation = _coefficients(
        extinction=extinction,
        scattering=scattering,
        airlight_lightness=airlight_lightness,
        airlight_saturation=airlight_saturation,
    )
    if rest:
        matter = matter * rest[0]
    airlight = lightness * (1 + min(1.0, saturation) * (2 * hls.pure_hue(airlight_hue) - 1))
    return hls.attenuate_and_add(image, k * matter, sigma * matter, airlight)


def _light_and_maps(image: Image, **maps: np.ndarray) -> tuple[FloatArray, ...]:
    require_maps(image=(image, 3), **{name: (array, 1) for name, array in maps.items()})
    require_finite(image=image, **maps)
    require_nonnegative(**maps)
    return floats(np.maximum(image, 0), *maps.values())


def _coefficients(**numbers: Number) -> list[float]:
    for name, number in numbers.items():
        if not 0 <= number < np.inf:
            raise ValueError(f"{name} must be a finite number of 0 or more, not {number:g}.")
    return [float(number) for number in numbers.values()]
