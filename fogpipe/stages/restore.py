"""Scenes behind haze: the haze equation read backwards once airlight and transmission are known."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import floats, require_finite, require_maps
from fogpipe.ports import Airlight, Image, Transmission, Unit
from fogpipe.stage import stage

Floor = Annotated[float, Gt(0), Le(1)]


@stage("restore.invert")
def invert(
    image: Image, airlight: Airlight, transmission: Transmission, *, floor: Floor = 0.1, clip: bool = True
) -> Image:
    """Plain inversion of the haze equation, L = B + (I − B) / max(t, t0).

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B.
    transmission : (H, W) float, t in [0, 1].
    floor : t0. Noise of the image is multiplied by 1 / t, so at most by 1 / t0; haze thicker than that stays in part.
    clip : Limit the result to [0, 1], what a display shows. Without it noise below black and above white
        survives, as do the values of an HDR image.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image.

    Raises
    ------
    ValueError
        If the image or airlight is not finite, the transmission is unknown (NaN) somewhere, or the sizes differ.

    Notes
    -----
    One pass, about 1.5 ns per pixel. It is the exact inverse of ``composite.naive`` where t ≥ t0.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, eq. 2; t0 after He, Sun and Tang 2009, eq. 16.
    """
    from fogpipe.kernels.dehazing import model

    require_finite(image=image, airlight=airlight, transmission=transmission)
    scene = model.invert(image, airlight, transmission, floor)
    return np.clip(scene, 0, 1, out=scene) if clip else scene


@stage("restore.intensity")
def intensity(image: Image) -> Image:
    """Intensity of an image, the mean of its channels, as a grey image.

    Under water the red is nearly gone, and what is left of it is noise: dehazed channel by channel, it gives false
    colours.

    Parameters
    ----------
    image : (H, W, 3) float.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image; three equal channels.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, section 3.4.
    """
    require_maps(image=(image, 3))
    (image,) = floats(image)
    return np.repeat(image.mean(axis=2, keepdims=True), 3, axis=2)


@stage("restore.recolour")
def recolour(image: Image, intensity: Image, *, most: Annotated[float, Gt(0)] = 4.0) -> Image:
    """Image with another intensity: each pixel scaled, so that the ratios of its channels stay.

    Parameters
    ----------
    image : (H, W, 3) float, whose colours are kept.
    intensity : (H, W, 3) float, whose mean over channels is the intensity wanted.
    most : Largest factor, so that noise in the dark is not blown up to colours.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.
    """
    require_maps(image=(image, 3), intensity=(intensity, 3))
    require_finite(image=image, intensity=intensity)
    image, intensity = floats(image, intensity)
    before, wanted = image.mean(axis=2), np.maximum(intensity.mean(axis=2), 0)
    factor = np.divide(wanted, before, out=np.ones_like(before), where=before > 0)
    return image * np.minimum(factor, image.dtype.type(most))[..., None]


@stage("restore.non_local")
def non_local(
    image: Image,
    airlight: Airlight,
    transmission: Transmission,
    *,
    noise_sigma: Annotated[float, Ge(0)] | None = None,
    window: Annotated[int, Ge(3), Le(255), Unit("px")] = 21,
    layer: Annotated[float, Gt(0)] = 0.3,
    strictness: Annotated[float, Gt(0)] = 4.0,
    solver: Literal["mean", "median"] = "mean",
    balance: Annotated[float, Gt(0)] = 0.2,
    passes: Annotated[int, Ge(1), Le(10)] = 2,
    floor: Floor = 0.05,
    clip: bool = True,
) -> Image:
    r"""Scene behind noisy haze, from pixels of like patches and like transmission.

    The inversion :math:`L_0 = B + (I - B)/t` has noise of the deviation σ/t. It is averaged with the weights

    .. math:: m(x, y) = g(\ln t(x) - \ln t(y), \sigma_t)\, e^{-s \max(d(x, y) - 1, 0)}, \qquad
              d = \operatorname{mean} \frac{|L_0(x + i) - L_0(y + i)|^2}{\sigma^2 (t^{-2}(x + i) + t^{-2}(y + i))}

    where the mean goes over the 7 × 7 pixels and the channels of a patch, and is 1 for two patches that differ by noise
    alone.

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B.
    transmission : (H, W) float, t in [0, 1].
    noise_sigma : σ, standard deviation of the noise of the image; None estimates it in the smooth parts of the image
        (and takes 1.1 times that), 0 says that there is none and gives plain inversion.
    window : Side of the square in which like patches are looked for, an odd number of pixels.
    layer : σt, a difference of ln t, at which a neighbour counts e^(−1/2).
    strictness : s, how soon patches count as different.
    solver : ``"mean"`` weights each pixel by t² as well, its certainty. ``"median"`` is the paper's
        :math:`\min_L \sum t^2 (L - L_0)^2 + \lambda \sum m |L - L(y)|`, some twenty times as slow.
    balance, passes : λ and the number of updates of the median.
    floor : t0, a smaller transmission counts as this.
    clip : Limit the result to [0, 1], what a display shows.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image (averaged in float32).

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    About 1 ns per pixel and pixel of the window: 0.5 µs per pixel. A window of 15 takes half as long and loses 0.1 dB
    or less, but leaves coarser spots where the haze is dense. Memory is linear.

    Deviates from the paper: the mean is the default. It leaves less noise than the median (whose form is kept), because
    every neighbour counts as far as its own noise allows.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, eq. 17–20 and 26; Buades, Coll and Morel 2005, *A non-local
    algorithm for image denoising*.
    """
    from fogpipe.kernels.dehazing import latent, model
    from fogpipe.kernels.dehazing.noise import deviation_of_smooth_parts

    require_finite(image=image, airlight=airlight, transmission=transmission)
    scene = model.invert(image, airlight, transmission, floor)
    sigma = LENIENCE * deviation_of_smooth_parts(image) if noise_sigma is None else noise_sigma
    if sigma > 0:
        dtype = scene.dtype
        scene, t = floats(scene.astype(np.float32), np.maximum(transmission, floor))
        weights = (sigma, window // 2, layer, strictness)
        if solver == "mean":
            scene = latent.weighted_mean(scene, t, *weights)
        else:
            scene = latent.weighted_median(scene, t, *weights, balance, passes)
        scene = scene.astype(dtype, copy=False)
    return np.clip(scene, 0, 1, out=scene) if clip else scene


LENIENCE = 1.1
"""The noise that is supposed, as a multiple of what is estimated: less leaves spots in thick haze (tuned)."""


@stage("restore.tempered_colour")
def tempered_colour(
    image: Image, transmission: Transmission, *, airlight_error: Annotated[float, Ge(0)] = 0.015, floor: Floor = 0.1
) -> Image:
    r"""Dehazed image without the colours that come of an airlight which is not quite right.

    An error δ of the hue of the airlight becomes :math:`δ (1 - t)/t` in the scene: rings of colour in bright clouds.
    With the chroma :math:`C = L - \operatorname{mean}_c L` of the scene, which was :math:`t C` in the hazy image,

    .. math:: L' = \operatorname{mean}_c L + \frac{|t C|^2}{|t C|^2 + δ^2 (1 - t)^2}\, C .

    Parameters
    ----------
    image : (H, W, 3) float, the dehazed image L.
    transmission : (H, W) float, t in [0, 1].
    airlight_error : δ, root-mean-square error of a channel of the airlight's colour; 0 returns the image.
    floor : The t0 of the dehazing.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image, of the same intensity as the image.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    About 30 ns per pixel. The factor is that of Wiener's filter. Colours that are faint behind thick haze lose most,
    those of near things nothing.
    """
    require_maps(image=(image, 3), transmission=(transmission, 1))
    require_finite(image=image, transmission=transmission)
    if airlight_error == 0:
        return image.copy()
    image, transmission = floats(image, transmission)
    t = np.maximum(transmission, image.dtype.type(floor))[..., None]
    grey = image.mean(axis=2, keepdims=True)
    chroma = image - grey
    seen = np.square(t * chroma).mean(axis=2, keepdims=True)
    doubt = np.square(image.dtype.type(airlight_error) * (1 - t))
    return grey + chroma * (seen / np.maximum(seen + doubt, np.finfo(image.dtype).tiny))
