"""Transmission from one hazy image by the well-known priors that fogpipe's own method is held against."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, over_channels
from fogpipe.ports import Airlight, Image, Transmission, Unit
from fogpipe.stage import stage
from fogpipe.stages.haze import require_haze

Patch = Annotated[int, Ge(1), Unit("px")]


@stage("prior.dark_channel")
def dark_channel(
    image: Image,
    airlight: Airlight,
    *,
    patch: Patch = 15,
    strength: Annotated[float, Ge(0), Le(1)] = 0.95,
    guide: Literal["colour", "grey", "none"] = "colour",
    radius: Patch = 40,
    smoothness: Annotated[float, Gt(0)] = 1e-2,
) -> Transmission:
    r"""Transmission by the dark channel prior: in a clear picture every patch has a pixel with a channel near black.

    .. math:: t(x) = 1 - \omega \min_{y \in \Omega(x)} \min_c \frac{I_c(y)}{B_c},

    refined by a guided filter.

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I. Its values must be above 0 to mean anything.
    airlight : (3,) or (H, W, 3) float, B. A channel without airlight is passed over.
    patch : Side of Ω.
    strength : ω; what is below 1 leaves some haze, by which the eye sees distance.
    guide : Of the filter: the image in colour, its grey (half the time, halos where colours of the same grey meet), or
        none for the map as it is, in blocks.
    radius : Of the guided filter, pixels. It and its ε were chosen on the same scenes as the settings of
        ``haze.contrast_corrected``.
    smoothness : ε of the guided filter: edges of the image of a smaller variance are smoothed over.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image (rounded to float32 on the way), in [0, 1].

    Raises
    ------
    ValueError
        If the image or airlight is not finite, the airlight is black, or the sizes differ.

    Notes
    -----
    OpenCV's erosion and guided filter, about 90 ns per pixel (40 with ``guide: grey``) whatever the size of the patch.

    Deviates from the paper: the guided filter of 2013 in place of soft matting, which takes some thousand times
    as long and is what its authors use since.

    References
    ----------
    He, Sun and Tang 2009, *Single image haze removal using dark channel prior*, eq. 12; He, Sun and Tang 2013, *Guided
    image filtering*.
    """
    import cv2

    from fogpipe.kernels.dehazing.model import lower_bound

    picture = _picture(image, airlight)
    clearest = cv2.dilate(lower_bound(picture, airlight, floor=0), np.ones((patch, patch), np.uint8))
    t = 1 - np.float32(strength) * (1 - clearest)
    if guide != "none":
        if guide == "grey":
            picture = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        t = cv2.ximgproc.guidedFilter(picture, t, radius, smoothness)
    return _like(image, np.clip(t, 0, 1))


@stage("prior.boundary_constraint")
def boundary_constraint(
    image: Image,
    airlight: Airlight,
    *,
    darkest: Annotated[float, Ge(0)] = 20 / 255,
    brightest: Annotated[float, Gt(0)] = 300 / 255,
    patch: Patch = 15,
    fidelity: Annotated[float, Gt(0)] = 2.0,
    deviation: Annotated[float, Gt(0)] = 0.5,
) -> Transmission:
    r"""Transmission from the bounds of the scene's radiance, smoothed in the context of the image.

    With the radiance of the scene within :math:`[C_0, C_1]` in every channel,

    .. math:: t(x) \ge t_b(x) = \min\left(\max_c \max\left(\frac{B_c - I_c}{B_c - C_0},
              \frac{B_c - I_c}{B_c - C_1}\right), 1\right),

    which is closed over patches and smoothed where the image is smooth.

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B.
    darkest, brightest : C0 and C1, in the units of the image. A channel whose airlight is not between them bounds
        nothing on that side.
    patch : Side of the patches that share a transmission.
    fidelity : λ, how near the result stays to the bound.
    deviation : σ of the weights that tell edges of the image from texture.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image (rounded to float32 on the way), in [0, 1].

    Raises
    ------
    ValueError
        If the image or airlight is not finite, the airlight is black, or the sizes differ.

    Notes
    -----
    About 0.6 µs and 90 bytes per pixel.

    Deviates from the paper: borders are mirrored by 16 px, so that the Fourier transform does not join what is left
    and right.

    References
    ----------
    Meng, Wang, Duan, Xiang and Pan 2013, *Efficient image dehazing with boundary constraint and contextual
    regularization*, eq. 7 to 16.
    """
    import cv2

    from fogpipe.kernels.dehazing.contextual import smooth
    from fogpipe.kernels.dehazing.model import image_and_field

    picture, field = image_and_field(_picture(image, airlight), airlight)
    below, above = _headroom(field - np.float32(darkest)), _headroom(np.float32(brightest) - field)
    needed = np.maximum((field - picture) / below, (picture - field) / above)
    bound = np.minimum(over_channels(np.maximum, needed), 1)
    closed = cv2.morphologyEx(bound, cv2.MORPH_CLOSE, np.ones((patch, patch), np.uint8))
    return _like(image, np.clip(smooth(closed, picture, fidelity, deviation), 0, 1))


@stage("prior.local_tv")
def local_tv(
    image: Image,
    airlight: Airlight,
    *,
    strength: Annotated[float, Gt(0)] = 1000.0,
    deviation: Annotated[float, Gt(0)] = 0.05,
    blur: Annotated[float, Ge(0), Unit("px")] = 1.0,
    floor: Annotated[float, Gt(0), Le(1)] = 0.05,
    iterations: Annotated[int, Ge(1)] = 400,
) -> Transmission:
    r"""Transmission by local total variation in place of the non-local term of Yan 2013.

    .. math:: \min_{D \ge v} \sum_x 3 (D - v)^2 + \lambda\, g\, |\nabla D|, \quad t = e^D, \quad
              v = \ln \max\left(1 - \min_c I_c / B_c, \epsilon\right), \quad g = e^{-|\nabla I|^2 / 2 σ^2}

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B. A channel without airlight is passed over.
    strength : λ. Found, as σ, on procedural scenes: by it bright things take the transmission of their surroundings.
    deviation : σ, the step of grey at which an edge of the image counts as one of the transmission.
    blur : Standard deviation of a blur of the image, against noise, before v and g are read from it.
    floor : ε, the least transmission of the bound.
    iterations : Of the solver.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image (rounded to float32 on the way), in [ε, 1]; at least the lower
        bound of the blurred image.

    Raises
    ------
    ValueError
        If the image or airlight is not finite, the airlight is black, or the sizes differ.

    Notes
    -----
    About 14 ns per pixel and iteration on one core.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, section 3.1, which compares itself with the local term of
    Schechner and Averbuch 2007, *Regularized image recovery in scattering media*.
    """
    import cv2

    from fogpipe.kernels.dehazing.model import lower_bound
    from fogpipe.kernels.dehazing.total_variation import total_variation

    picture = _picture(image, airlight)
    if blur:
        picture = cv2.GaussianBlur(picture, (0, 0), blur, borderType=cv2.BORDER_REFLECT)
    bound = np.log(lower_bound(picture, airlight, floor))[..., None]
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    down, right = np.diff(grey, axis=0, append=grey[-1:]), np.diff(grey, axis=1, append=grey[:, -1:])
    edge = np.exp((down**2 + right**2) / np.float32(-2 * deviation**2))
    depth = total_variation(bound, np.full(grey.shape, 6 / strength, np.float32), edge, bound, iterations)
    return _like(image, np.clip(np.exp(depth[..., 0]), floor, 1))


def _picture(image: Image, airlight: Airlight) -> FloatArray:
    """The image as OpenCV takes it, once it is known to show haze."""
    require_haze(image, airlight)
    return np.asarray(image, np.float32, order="C")


def _headroom(difference: FloatArray) -> FloatArray:
    """Room between the airlight and a bound of the radiance; infinite where the airlight is beyond it."""
    return np.where(difference > 0, difference, np.inf)


def _like(image: Image, t: np.ndarray) -> Transmission:
    return t.astype(np.float64 if image.dtype.itemsize > 4 else np.float32, copy=False)
