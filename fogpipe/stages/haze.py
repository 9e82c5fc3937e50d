"""Haze: how much light comes through it, estimated from one hazy image."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps
from fogpipe.ports import Airlight, Image, Transmission, Unit
from fogpipe.stage import stage

Floor = Annotated[float, Gt(0), Le(1)]


@stage("haze.lower_bound")
def lower_bound(
    image: Image, airlight: Airlight, *, floor: Floor = 0.01, noise_sigma: Annotated[float, Ge(0)] = 0.0
) -> Transmission:
    r"""Least transmission of each pixel, because no channel of the scene can be darker than black.

    .. math:: t \ge \max\left(1 - \min_c \frac{I_c}{B_c},\ \epsilon\right)

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B. A channel without airlight says nothing and is passed over.
    floor : ε, the least transmission that is ever returned.
    noise_sigma : σ, standard deviation of the noise of the image. Above 0, the bound is that of the mean of 3 × 3
        pixels plus 0.846 σ / 3, by which the least of three channels is too small on average where they are alike.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image, in [ε, 1]; ε where every channel is brighter than the airlight.

    Raises
    ------
    ValueError
        If the image is not finite, the airlight is not finite or is black, or the sizes differ.

    Notes
    -----
    One pass, about 1 ns per pixel. Noise makes the least of three channels smaller, and the bound larger than the true
    transmission: with σ = 10 of 255 and a dense haze for most pixels.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, eq. 10 and 12, before the logarithm.
    """
    from fogpipe.kernels.dehazing import model

    require_haze(image, airlight)
    lift = 0.0
    if noise_sigma > 0:
        import cv2

        (image,) = floats(image)
        image = np.asarray(cv2.blur(image, (3, 3), borderType=cv2.BORDER_REFLECT), image.dtype)
        lift = LEAST_OF_THREE * noise_sigma / 3
    return model.lower_bound(image, airlight, floor, lift)


LEAST_OF_THREE = 3 / (2 * np.sqrt(np.pi))
"""Mean of the largest of three standard normal numbers, 0.846."""


@stage("haze.non_local")
def non_local(
    image: Image,
    airlight: Airlight,
    structure: Image | None = None,
    *,
    noise_sigma: Annotated[float, Ge(0)] | None = None,
    window: Annotated[int, Ge(1), Le(127), Unit("px")] = 31,
    passes: Annotated[int, Ge(1), Le(10)] = 1,
    balance: Annotated[float, Gt(0)] = 15.0,
    structure_deviation: Annotated[float, Gt(0)] = 0.11,
    quantile: Annotated[float, Gt(0), Lt(1)] = 0.95,
    darkest: Annotated[float, Ge(0), Lt(1)] = 0.15,
    saturation: Annotated[float, Gt(0), Le(1)] = 0.55,
    floor: Floor = 0.02,
    solver: Literal["fast", "exact"] = "fast",
    tolerance: Annotated[float, Gt(0)] = 1e-3,
) -> Transmission:
    r"""Transmission by non-local total variation of its logarithm, above its lower bound.

    .. math:: \min_{D \ge v} \sum_x \sum_c |D(x) - D^0(x)|^2 + \lambda \sum_x \sum_{y \in W(x)} w(x, y) |D(x) - D(y)|

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B. A channel without airlight is passed over.
    structure : (H, W, 3) float, S: the image without texture and noise, across whose edges the transmission may jump.
        Without it the denoised image takes its place.
    noise_sigma : Standard deviation of the noise of the image; None estimates it, 0 says that there is none. The bound
        is taken from a denoised image: noise makes the least of three channels smaller.
    window : Side of W, an odd number of pixels; an even one is taken as the next larger.
    passes : n, how often all pixels are updated; later passes take the median.
    balance : λ.
    structure_deviation : σs: the difference of S at which a neighbour counts e^(−1/2). S counts as the mean of its
        channels, in units of the airlight; from twice the airlight up it is all alike.
    quantile : p of the first pass: 1/2 is the paper's median, near 1 the clearest neighbour decides, as in the dark
        channel prior.
    darkest, saturation : What is known of scenes before D is: the darkest places of a window reach the share m of the
        airlight, and colours have a saturation of s at most. The paper begins with the bound itself, m = 0 and s = 1.
    floor : ε, the least transmission that is ever returned.
    solver : ``"exact"`` sorts every window; ``"fast"`` has a cost that does not grow with it.
    tolerance : Root-mean-square error of the fast solver allowed in t.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image (computed in float32), in [ε, 1], nowhere below the bound of the
    (denoised) image.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, the airlight is black, or the sizes differ.

    Notes
    -----
    About 0.4 µs per pixel for a fast pass, 0.2 for denoising, whatever the window; the exact solver takes
    some 15 ns per pixel of the window, for each pixel. Memory is linear in the pixels, and does not grow with the range
    of their values.

    The defaults of darkest, saturation, quantile, window and σs were chosen by the signal-to-noise ratio of the
    restored picture on two procedural outdoor scenes and three indoor photographs with measured depth, none of them
    among those of the published table. A median (quantile 1/2) jumps where a window holds two layers of
    equal weight; there the fast solver has three times as many bins. With the default tolerance it is less than 1e-3
    from the exact one on crops of *Motorcycle* and the road, with p = 0.95 and p = 1/2, in up to three passes.

    Deviates from the paper: the first guess D⁰, the quantile, and the bound of a denoised image; ``darkest: 0``,
    ``saturation: 1``, ``quantile: 0.5``, ``noise_sigma: 0`` is the published form. There the guess is the data of the
    first pass too, and later passes hold to the result of the one before.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, eq. 11–16 and 23–25; Li and Osher 2009, *A new median
    formula*.
    """
    from fogpipe.kernels.dehazing import model
    from fogpipe.kernels.dehazing.binned_quantile import binned
    from fogpipe.kernels.dehazing.weighted_quantile import exact

    require_haze(image, airlight)
    maps = {"image": image} if structure is None else {"image": image, "structure": structure}
    require_maps(**{name: (array, 3) for name, array in maps.items()})
    require_finite(**maps)
    (picture,) = floats(np.asarray(image, np.float32))
    quiet = _denoised(picture, noise_sigma)
    bound, guess = model.first_guess(quiet, airlight, darkest, saturation, floor)
    bound, log_t = np.log(bound), np.log(guess)
    guide = model.relative(quiet if structure is None else structure, airlight)
    pull = 2 * np.count_nonzero(np.max(airlight.reshape(-1, 3), axis=0)) / balance
    for number in range(passes):
        share = quantile if number == 0 else 0.5
        arguments = (log_t, bound, guide, pull, share, window // 2, structure_deviation)
        log_t = exact(*arguments) if solver == "exact" else binned(*arguments, _levels(tolerance, share))
    return np.clip(np.exp(log_t), floor, 1).astype(floats(image)[0].dtype, copy=False)


LEVELS_AT_ONE_IN_A_THOUSAND = 320, 960
"""Bins of the fast solver for a tolerance of 1e-3, with the quantile 0.95 and with 1/2: a median jumps where two layers
have the same weight."""


def _levels(tolerance: float, quantile: float) -> int:
    """Bins of the fast solver, a multiple of 16."""
    thin, thick = LEVELS_AT_ONE_IN_A_THOUSAND
    levels = (thin if quantile > 0.7 else thick) * 1e-3 / tolerance
    return 16 * math.ceil(np.clip(levels, 16, 1024) / 16)


@stage("haze.contrast_corrected")
def contrast_corrected(
    image: Image,
    airlight: Airlight,
    transmission: Transmission,
    structure: Image | None = None,
    *,
    noise_sigma: Annotated[float, Ge(0)] | None = None,
    patch: Annotated[int, Ge(3), Unit("px")] = 9,
    radius: Annotated[int, Ge(1), Unit("px")] = 60,
    smoothness: Annotated[float, Gt(0)] = 1e-2,
    offset: float = -0.95,
    slope: float = -0.41,
    interplay: float = 0.12,
    floor: Floor = 0.02,
) -> Transmission:
    r"""Transmission of a dark-pixel prior, corrected by the contrast of what is seen.

    With :math:`q = \operatorname{mean}_c (1 - I_c / B_c)`, what a place is darker than the airlight,

    .. math:: \ln t' = \ln t + a + (b + c \ln t)\, \rho, \qquad
              \rho = \ln \frac{\operatorname{std} q + 0.01}{\max(\operatorname{mean} q, 0) + 0.05}

    Haze of the same thickness scales the deviation and the mean of q alike, so ρ belongs to the scene. Where it is low
    (a road, a wall, the sky) the darkest pixel of a neighbourhood is as bright as the rest, and priors that look for
    black take the thing for haze; where it is high (leaves) there is black.

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B. A channel without airlight is passed over.
    transmission : (H, W) float, t, as ``haze.non_local`` or a prior gives it.
    structure : (H, W, 3) float, by whose edges ρ is smoothed; the image where it is not given.
    noise_sigma : Standard deviation of the noise of the image, whose variance is taken off that of q; None estimates
        it.
    patch : Side of the square in which deviation and mean are taken.
    radius, smoothness : Of the guided filter that smooths ρ.
    offset, slope, interplay : a, b, c.
    floor : The least transmission that is ever returned.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image (computed in float32), in [floor, 1]; at least the lower bound of
        the image without noise wherever t is.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, the airlight is black, or the sizes differ.

    Notes
    -----
    About 0.1 µs per pixel. a, b and c were fitted, together with the weight of ``refine.mean``, by the signal-to-noise
    ratio of the restored picture on four kinds of scenes at optical thicknesses of 1 to 3: the procedural road with
    seeds 11 to 14, the same with the contrast of a camera, three indoor photographs with measured depth, and quarters
    of these. They suit ``haze.non_local`` with its defaults, when the mean with the dark channel prior is taken after.
    Roads gain much by them, rooms with white walls less.

    References
    ----------
    The idea of learning a few coefficients is that of Zhu, Mai and Shao 2015, *A fast single image haze removal
    algorithm using color attenuation prior*; the cue is fogpipe's own.
    """
    import cv2

    from fogpipe.kernels.dehazing import model
    from fogpipe.kernels.dehazing.noise import deviation

    require_haze(image, airlight)
    guide = image if structure is None else structure
    require_maps(image=(image, 3), transmission=(transmission, 1), structure=(guide, 3))
    require_finite(transmission=transmission, structure=guide)
    picture, field = model.image_and_field(np.asarray(image, np.float32), np.asarray(airlight, np.float32))
    sigma = deviation(picture) if noise_sigma is None else noise_sigma
    seen = field > 0
    q = np.where(seen, 1 - picture / np.where(seen, field, 1), 0).sum(axis=2) / seen.sum(axis=2)
    noise = np.where(seen, np.square(sigma / np.where(seen, field, 1)), 0).sum(axis=2) / np.square(seen.sum(axis=2))
    contrast = _contrast(q.astype(np.float32), noise.astype(np.float32), patch)
    contrast = cv2.ximgproc.guidedFilter(np.ascontiguousarray(guide, np.float32), contrast, radius, smoothness)
    before = np.clip(np.asarray(transmission, np.float32), floor, 1)
    log_t = np.log(before)
    corrected = np.exp(log_t + offset + (slope + interplay * log_t) * contrast)
    bound = lower_bound(picture, airlight, floor=floor, noise_sigma=sigma)
    corrected = np.clip(np.maximum(corrected, np.minimum(before, bound)), floor, 1)
    return corrected.astype(floats(image)[0].dtype, copy=False)


def _contrast(q: FloatArray, noise: FloatArray, patch: int) -> FloatArray:
    """ρ: the logarithm of deviation over mean in a square, without the variance of the noise."""
    import cv2

    def mean(plane: FloatArray) -> FloatArray:
        return np.asarray(cv2.blur(plane, (patch, patch), borderType=cv2.BORDER_REFLECT), np.float32)

    level = mean(q).reshape(q.shape)
    spread = np.sqrt(np.maximum(mean(q * q).reshape(q.shape) - level**2 - noise, 0))
    return np.log((spread + np.float32(0.01)) / (np.maximum(level, 0) + np.float32(0.05)))


def _denoised(image: FloatArray, noise_sigma: float | None) -> FloatArray:
    """The image by non-local means, or as it is where there is no noise."""
    from fogpipe.kernels.dehazing.latent import weighted_mean
    from fogpipe.kernels.dehazing.noise import deviation

    sigma = deviation(image) if noise_sigma is None else noise_sigma
    if sigma == 0:
        return image
    return weighted_mean(image, np.ones(image.shape[:2], image.dtype), sigma, radius=5, layer=1.0, strictness=4.0)


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
