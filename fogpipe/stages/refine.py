"""Refinement of a transmission map, from itself, from a second one, or from how near the picture is to the airlight."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from fogpipe.kernels.arrays import floats, require_finite, require_maps
from fogpipe.ports import Airlight, Image, Transmission, Unit
from fogpipe.stage import stage


@stage("refine.bilateral")
def bilateral(
    transmission: Transmission,
    *,
    spatial_deviation: Annotated[float, Gt(0), Unit("px")] = 3.0,
    tonal_deviation: Annotated[float, Gt(0)] = 0.4,
    solver: Literal["fast", "exact"] = "fast",
    tolerance: Annotated[float, Gt(0), Lt(1)] = 0.002,
) -> Transmission:
    r"""Smooth a transmission inside surfaces and keep its edges, with the bilateral filter.

    .. math:: t(u) = \frac{\sum_p W_c(\|p - u\|)\, W_s(|t_0(u) - t_0(p)|)\, t_0(p)}
                          {\sum_p W_c(\|p - u\|)\, W_s(|t_0(u) - t_0(p)|)},
              \qquad W(x) = e^{-x^2 / 2\sigma^2}

    Parameters
    ----------
    transmission : (H, W) float, the initial transmission t₀. NaN where unknown.
    spatial_deviation : σc, pixels.
    tonal_deviation : σs, of a transmission in [0, 1].
    solver : ``"exact"``: the sum over a window of four deviations. ``"fast"``: Gaussian blurs of a few cosines of
        the transmission.
    tolerance : Root-mean-square error that the fast solver may have.

    Returns
    -------
    (H, W) float32, or float64 for float64 transmission, within the bounds of the transmission. Unknown stays NaN.

    Notes
    -----
    At the border of the image the window is cut off. The fast solver takes about 0.1 µs per pixel, the exact one 2 µs;
    the time of the fast one grows with σc and with 1/σs, of the exact one with σc². The error of the fast one is at
    most half the tolerance on noise, and a hundredth of it on photos; ``fogpipe bench photo`` measures both.

    References
    ----------
    Guo, Tang and Xiao 2014, *Foggy scene rendering based on transmission map estimation*, eq. 7; Chaudhury, Sage and
    Unser 2011, *Fast O(1) bilateral filtering using trigonometric range kernels*.
    """
    from fogpipe.kernels import bilateral as kernel

    require_maps(transmission=(transmission, 1))
    (initial,) = floats(transmission)
    if solver == "exact":
        return kernel.exact(initial, spatial_deviation, tonal_deviation)
    # Pure noise, the worst of maps, turns an error of the weights into one of 0.06 of it (root mean square).
    return kernel.fast(initial, spatial_deviation, tonal_deviation, min(0.2, 8 * tolerance))


@stage("refine.mean")
def mean(
    transmission: Transmission,
    other: Transmission,
    *,
    weight: Annotated[float, Ge(0), Le(1)] = 0.6,
    floor: Annotated[float, Gt(0), Le(1)] = 0.02,
) -> Transmission:
    r"""Mean of the optical thicknesses of two estimates, in which the second counts the more, the thinner the haze.

    .. math:: \ln t' = (1 - w t) \ln t + w t \ln t_2

    Two methods that err for different reasons err less together.

    Parameters
    ----------
    transmission : (H, W) float, t in [0, 1], the estimate that is trusted in dense haze.
    other : (H, W) float, t₂ in [0, 1].
    weight : w, the share of the second where there is no haze.
    floor : A smaller transmission counts as this.

    Returns
    -------
    (H, W) float32, or float64 if the first is, in [floor, 1], between the two.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    About 20 ns per pixel. w was fitted with the coefficients of ``haze.contrast_corrected``, for the dark channel prior
    as the second.
    """
    require_maps(transmission=(transmission, 1), other=(other, 1))
    require_finite(transmission=transmission, other=other)
    first, second = (np.clip(t, floor, 1) for t in floats(transmission, other))
    share = first.dtype.type(weight) * first
    return np.exp((1 - share) * np.log(first) + share * np.log(second))


@stage("refine.sky_kept")
def sky_kept(
    transmission: Transmission, image: Image, airlight: Airlight, *, airlight_error: Annotated[float, Ge(0)] = 0.04
) -> Transmission:
    r"""Transmission raised where the picture is hardly darker than the airlight, so that a bright sky stays as it is.

    .. math:: t' = \min\left(t \left(1 + \frac{δ^2 (1 - t)^2}{x^2}\right), 1\right), \qquad
              x^2 = \operatorname{mean}_c \max(B_c - M_c, 0)^2

    A sky is not of one brightness. What a cloud is darker than the airlight is divided by a small t as if it were a
    thing behind dense haze, and comes out as grey rings and streaks, with grain. Where x is less than δ, it says more
    about the airlight than about a thing. M is the median of 5 × 5 pixels of the image.

    Parameters
    ----------
    transmission : (H, W) float, t in [0, 1].
    image : (H, W, 3) float, hazy.
    airlight : (3,) or (H, W, 3) float, B.
    airlight_error : δ, by how much the airlight may differ from one place of the picture to another; 0 changes nothing.

    Returns
    -------
    (H, W) float32, or float64 for a float64 transmission, in [t, 1]; 1 where no channel is darker than the airlight.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    About 50 ns per pixel. :math:`t / t'` is Wiener's factor for a signal x in noise of δ (1 − t). In dense haze far
    things are as near to the airlight as clouds are, and more haze stays before them. A median is taken because the
    structure map is too coarse for the sky between branches, and a pixel of its own is noise.
    """
    import cv2

    from fogpipe.kernels.dehazing.model import image_and_field

    require_maps(image=(image, 3), transmission=(transmission, 1))
    require_finite(transmission=transmission, image=image, airlight=airlight)
    median = cv2.medianBlur(np.ascontiguousarray(image, np.float32), 5)
    picture, field = image_and_field(median, airlight)
    t, picture, field = floats(transmission, picture, field)
    if airlight_error == 0:
        return t.copy()
    darker = np.square(np.maximum(field - picture, 0)).mean(axis=2)
    doubt = np.square(t.dtype.type(airlight_error) * (1 - t))
    trust = darker / np.maximum(darker + doubt, np.finfo(t.dtype).tiny)
    return np.minimum(np.divide(t, trust, out=np.ones_like(t), where=trust > 0), 1)
