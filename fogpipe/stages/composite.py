"""Composites of a scene with the light that the medium scatters towards the camera."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Ge

from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.ports import Airlight, Density, Image, Layer, Transmission
from fogpipe.stage import stage


@stage("composite.attenuate")
def attenuate(image: Image, transmission: Transmission) -> Layer:
    """Image seen through the medium, as premultiplied colour and opacity, F = t·(E, 1).

    Parameters
    ----------
    image : (H, W, 3) float, E, linear light.
    transmission : (H, W) float, t in [0, 1].

    Returns
    -------
    (H, W, 4) float32, or float64 for a float64 image. The opacity is t.

    Raises
    ------
    ValueError
        If the transmission is unknown (NaN) somewhere, or the sizes differ.

    Notes
    -----
    One pass, about 0.8 ns per pixel on two cores.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 2.
    """
    from fogpipe.kernels import compositing

    _require_known(transmission)
    return compositing.attenuate(image, transmission)


@stage("composite.over_airlight")
def over_airlight(layer: Layer, airlight: Airlight) -> Image:
    """Layer in front of the airlight, J = F + (1 − a)·B.

    Parameters
    ----------
    layer : (H, W, 4) float, F with opacity a, which may have been blurred since it was attenuated.
    airlight : (3,) or (H, W, 3) float, B, linear light.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 layer.

    Notes
    -----
    One pass, about 0.7 ns per pixel on two cores; 1 ns with an airlight that varies.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, eq. 4.
    """
    from fogpipe.kernels import compositing

    return compositing.over(layer, airlight)


@stage("composite.add")
def add(layer: Layer, other: Layer) -> Layer:
    """Sum of two layers, for light that arrives by two ways: sharp and direct, blurred and scattered.

    Parameters
    ----------
    layer, other : (H, W, 4) float, premultiplied. Their opacities are shares of the same light: where they
        add up to more than 1, the composite would take airlight away.

    Returns
    -------
    (H, W, 4) float32, or float64 for a float64 layer.
    """
    require_maps(layer=(layer, 4), other=(other, 4))
    layer, other = floats(layer, other)
    return layer + other


@stage("composite.opaque")
def opaque(image: Image) -> Layer:
    """Image as a layer of opacity 1, to be blurred for :func:`naive`.

    Parameters
    ----------
    image : (H, W, 3) float.

    Returns
    -------
    (H, W, 4) float32, or float64 for a float64 image.
    """
    require_maps(image=(image, 3))
    return attenuate(image, np.ones(image.shape[:2], np.float32))


@stage("composite.colour")
def colour(layer: Layer) -> Image:
    """Colour of a layer without its opacity, the inverse of :func:`attenuate`.

    Parameters
    ----------
    layer : (H, W, 4) float, premultiplied.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 layer; 0 where the opacity is 0 and the colour lost.
    """
    require_maps(layer=(layer, 4))
    (layer,) = floats(layer)
    premultiplied, opacity = layer[..., :3], layer[..., 3:]
    return np.divide(premultiplied, opacity, out=np.zeros_like(premultiplied), where=opacity != 0)


@stage("composite.naive")
def naive(image: Image, transmission: Transmission, airlight: Airlight) -> Image:
    """Composite of an image that is not premultiplied, J = t·E + (1 − t)·B.

    Right for a sharp image, which it saves a pass. For a blurred one it is the composite that the paper warns of,
    here for comparison: E has lost the detail that t still has, and edges of the range show as ghosts in the haze.

    Parameters
    ----------
    image : (H, W, 3) float, E, linear light.
    transmission : (H, W) float, t in [0, 1].
    airlight : (3,) or (H, W, 3) float, B, linear light.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image.

    Raises
    ------
    ValueError
        If the transmission is unknown (NaN) somewhere, or the sizes differ.

    Notes
    -----
    One pass, about 0.7 ns per pixel on two cores.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, section 2.1.
    """
    from fogpipe.kernels import compositing

    _require_known(transmission)
    return compositing.blend(image, transmission, airlight)


@stage("composite.add_density")
def add_density(image: Image, density: Density, *, strength: Annotated[float, Ge(0)] = 0.15) -> Image:
    """Heterogeneous fog as published: noise added to the picture, R = J + k·n with n = ρ − 1.

    Near and far pixels get the same noise, and dark ones may fall below 0. A density that varies the extinction
    (:func:`fogpipe.stages.medium.transmission`) leaves clear what is near.

    Parameters
    ----------
    image : (H, W, 3) float, J, display values.
    density : (H, W) float, ρ, relative to its mean.
    strength : k, in display values.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image.

    References
    ----------
    Guo, Tang and Xiao 2014, *Foggy scene rendering based on transmission map estimation*, eq. 10. It leaves the mean
    of n open; with 0 the noise changes no mean brightness.
    """
    require_maps(image=(image, 3), density=(density, 1))
    image, density = floats(image, density)
    return image + image.dtype.type(strength) * (density - 1)[..., None]


def _require_known(transmission: Transmission) -> None:
    if np.isnan(transmission.min(initial=1)):
        count = np.count_nonzero(np.isnan(transmission))
        raise ValueError(
            f"transmission is unknown at {count} pixels: give the unmeasured pixels a range first, with sky.identify,"
            " range.fill_holes and sky.matte, as hansard2019 does."
        )
