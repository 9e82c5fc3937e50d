"""Haze: how much light comes through it, estimated from one hazy image."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Gt, Le

from fogpipe.kernels.arrays import require_finite
from fogpipe.ports import Airlight, Image, Transmission
from fogpipe.stage import stage

Floor = Annotated[float, Gt(0), Le(1)]


@stage("haze.lower_bound")
def lower_bound(image: Image, airlight: Airlight, *, floor: Floor = 0.01) -> Transmission:
    r"""Least transmission of each pixel, because no channel of the scene can be darker than black.

    .. math:: t \ge \max\left(1 - \min_c \frac{I_c}{B_c},\ \epsilon\right)

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B. A channel without airlight says nothing and is passed over.
    floor : ε, the least transmission that is ever returned.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image, in [ε, 1]; ε where every channel is brighter than the airlight.

    Raises
    ------
    ValueError
        If the image is not finite, the airlight is not finite or is black, or the sizes differ.

    Notes
    -----
    One pass, about 1 ns per pixel. This bound is that of a noise-free image: noise makes the least of
    three channels smaller, and the bound larger than the true transmission.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, eq. 10 and 12, before the logarithm.
    """
    from fogpipe.kernels.dehazing import model

    require_haze(image, airlight)
    return model.lower_bound(image, airlight, floor)


def require_haze(image: Image, airlight: Airlight) -> None:
    """Refuse values that the haze equation cannot be read backwards from.

    Raises
    ------
    ValueError
        If the image or the airlight is not finite, or the airlight is black.
    """
    require_finite(image=image, airlight=airlight)
    if not (airlight > 0).any(axis=-1).all():
        raise ValueError("the airlight is black: haze that scatters no light has no transmission to be seen.")
