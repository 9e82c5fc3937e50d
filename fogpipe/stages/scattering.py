"""Light that the medium scatters: where it arrives (the atmospheric point spread function), and how much of it."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from fogpipe.kernels.arrays import FloatArray, floats, over_channels, require_finite, require_maps
from fogpipe.ports import Camera, Image, Layer, RelativeDepth, Transmission, Unit
from fogpipe.stage import stage

Asymmetry = Annotated[float, Ge(0), Le(0.99)]
Tolerance = Annotated[float, Gt(0)]
FieldOfView = Annotated[float, Gt(0), Lt(180), Unit("°")]
Form = Literal["gather", "scatter"]
Solver = Literal["fast", "reference"]


def _black(image: Image) -> str | None:
    """skipped where the image is black"""
    return None if image.any() else "the image is black"


@stage("scattering.blur", identity_when=_black)
def blur(
    image: Image,
    transmission: Transmission,
    camera: Camera | None = None,
    *,
    asymmetry: Asymmetry = 0.9,
    field_of_view: FieldOfView = 60.0,
    form: Form = "gather",
    solver: Solver = "fast",
    tolerance: Tolerance = 0.002,
) -> Image:
    r"""Blur an image as fog does to the light that it scatters, more the thicker it is before each pixel.

    .. math:: J(x) = \sum_y K_{T(x)}(x - y)\, E(y), \qquad \text{or} \quad J(x) = \sum_y K_{T(y)}(x - y)\, E(y)

    The kernel K_T is the radiance that photons have after the optical thickness T, by angle, from a table that a Monte
    Carlo made; at most 1 % of the light is at a wrong angle. It holds scattered light alone: the direct light, a
    share of e^(−T), stays sharp and is a layer of its own. :func:`forward` makes a layer of the result.

    Parameters
    ----------
    image : (H, W, 3) float, E, linear light; values above 1 (HDR) are welcome.
    transmission : (H, W) float, t in [0, 1]; the optical thickness is T = −ln t. The shape of the kernel is that of
        0.02 where the fog is thinner, and of 32 where it is thicker, as before the sky.
    camera : (3, 3) float, optional. Its focal length turns angles into pixels.
    asymmetry : q of Henyey and Greenstein, the mean cosine of the scattering angle: haze 0.7–0.8, fog 0.85–0.9.
    field_of_view : Horizontal, in degrees, where there is no camera.
    form : ``"gather"``: each pixel collects light with its own kernel (the first sum), which leaves a constant image as
        it is. ``"scatter"``: each pixel spreads its light with its own kernel (the second), which conserves the light
        of the image. One is the transpose of the other.
    solver : ``"fast"`` keeps the tolerance; ``"reference"`` sums over all pairs of pixels, for some thousand pixels.
    tolerance : Root-mean-square error allowed, in the units of the image. What the fast solver expects to keep is a
        model measured on photographs and noise, no bound; it does not go below about 3e-5 of the variation of the
        image.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image and from ``"reference"``. Values from the fast solver may
    overshoot by the tolerance, below 0 too.

    Raises
    ------
    ValueError
        If the image is not finite or the transmission unknown (NaN) somewhere, the asymmetry is not in [0, 0.99], or
        the sizes differ.

    Notes
    -----
    The picture is mirrored at its borders, so they do not darken and no kernel is cropped: what it holds beyond the
    mirrored picture is spread evenly. Angles are taken as on the optical axis, f tan θ, all over the picture.

    The fast solver finds few kernels that stand for all (see the explanation of scattering) and convolves with
    each by cosine transforms. The time for a whole range of depths at a tolerance of 1e-3 is about that of
    one FFT convolution with one kernel of the size of the picture.

    References
    ----------
    Narasimhan & Nayar 2003, *Shedding light on the weather*, for the geometry of the source in a sphere of fog.
    """
    require_maps(image=(image, 3), transmission=(transmission, 1))
    require_finite(image=image, transmission=transmission)
    image, transmission = floats(image, transmission)
    if _black(image):
        return image.copy()
    focal = _focal_length(image.shape[1], camera, field_of_view)
    return _blurred(image, transmission, asymmetry, focal, form, tolerance, solver == "reference")


@stage("scattering.forward")
def forward(
    image: Image,
    transmission: Transmission,
    *,
    asymmetry: Asymmetry = 0.9,
) -> Layer:
    r"""Layer of the light that fog has scattered nearly straight on, beside the direct light and the airlight.

    .. math:: S = (t^{1 - q^2} - t)\,(J, 1)

    Of scattered light, the share q² belongs to the forward peak of the phase function and counts as not scattered away
    (delta-Eddington): t of the light is direct, 1 − t^(1 − q²) is left to the airlight, and this is what is between.

    Parameters
    ----------
    image : (H, W, 3) float, J, linear light, blurred by :func:`blur`.
    transmission : (H, W) float, t in [0, 1], the share that arrives unscattered.
    asymmetry : q of Henyey and Greenstein, the mean cosine of the scattering angle.

    Returns
    -------
    (H, W, 4) float32, or float64 for a float64 image. Added to the direct layer t·(E, 1), its opacity is at most 1.

    Raises
    ------
    ValueError
        If the image is not finite or the transmission unknown (NaN) somewhere, or the sizes differ.

    References
    ----------
    Joseph, Wiscombe & Weinman 1976, *The delta-Eddington approximation for radiative flux transfer*.
    """
    from fogpipe.kernels.compositing import attenuate

    require_maps(image=(image, 3), transmission=(transmission, 1))
    require_finite(image=image, transmission=transmission)
    image, transmission = floats(image, transmission)
    return attenuate(image, transmission ** (1 - asymmetry**2) - transmission)


def _no_fog(transmission: Transmission) -> str | None:
    """skipped where there is no fog"""
    return "all light arrives unscattered" if (transmission == 1).all() else None


@stage("scattering.glow", identity_when=_no_fog)
def glow(
    image: Image,
    transmission: Transmission,
    camera: Camera | None = None,
    *,
    asymmetry: Asymmetry = 0.9,
    field_of_view: FieldOfView = 60.0,
    solver: Solver = "fast",
    tolerance: Tolerance = 0.002,
) -> Image:
    r"""Lamps at night in fog that nothing else lights: direct light, and a glow of all that is scattered.

    .. math:: J(x) = t(x)\, E(x) + \sum_y K_{T(y)}(x - y)\, (1 - t(y))\, E(y)

    Parameters
    ----------
    image : (H, W, 3) float, E, linear light. Lamps glow as bright as they are: an HDR image is wanted.
    transmission, camera, asymmetry, field_of_view, solver, tolerance : as in :func:`blur`, whose form
        ``"scatter"`` this is.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image and from ``"reference"``. The light of the image is conserved.

    Raises
    ------
    ValueError
        As in :func:`blur`.

    Notes
    -----
    There is no airlight and no absorption. What stands before a lamp does not cover its glow.
    """
    require_maps(image=(image, 3), transmission=(transmission, 1))
    require_finite(image=image, transmission=transmission)
    image, transmission = floats(image, transmission)
    t = transmission[..., None]
    focal = _focal_length(image.shape[1], camera, field_of_view)
    exact = solver == "reference"
    return t * image + _blurred((1 - t) * image, transmission, asymmetry, focal, "scatter", tolerance, exact)


def _blurred(
    image: FloatArray, transmission: FloatArray, q: float, focal: float, form: Form, tolerance: float, exact: bool
) -> FloatArray:
    from fogpipe.kernels.scattering.varying import by_thickness

    with np.errstate(divide="ignore"):  # nothing arrives: infinitely thick
        thickness = -np.log(transmission)
    planes = np.ascontiguousarray(image.transpose(2, 0, 1))
    return np.ascontiguousarray(by_thickness(planes, thickness, q, focal, form, tolerance, exact).transpose(1, 2, 0))


def _no_kernel(near: float, middle: float, far: float) -> str | None:
    """skipped where all kernels have the size 0"""
    return "all three kernels have the size 0" if near == middle == far == 0 else None


Size = Annotated[float, Ge(0), Le(1)]


@stage("scattering.apsf", identity_when=_no_kernel)
def apsf(
    image: Image,
    depth: RelativeDepth,
    camera: Camera | None = None,
    *,
    optical_thickness: Annotated[float, Gt(0)] = 1.2,
    asymmetry: Annotated[float, Ge(0), Lt(1)] = 0.9,
    kernel: Literal["series", "gaussian"] = "series",
    near: Size = 0.0,
    middle: Size = 0.01,
    far: Size = 0.02,
    threshold: Annotated[float, Gt(0), Lt(1)] = 0.5,
    channels: Literal["luminance", "all"] = "luminance",
    form: Form = "gather",
    solver: Solver = "fast",
    field_of_view: FieldOfView = 60.0,
) -> Image:
    r"""Blur by the atmospheric point spread function as published, with kernels for three depths.

    .. math:: I(T, \mu) = \sum_{m \ge 0} (g_m + g_{m+1}) P_m(\mu), \qquad
              g_m = e^{-\beta_m T - (m+1) \ln T}, \quad \beta_m = \tfrac{2m+1}{m} (1 - q^{m-1})

    Parameters
    ----------
    image : (H, W, 3) float; values above 1 (HDR) are welcome.
    depth : (H, W) float, Z, 0 near to 1 far.
    camera : (3, 3) float, optional. Its focal length turns angles into pixels.
    optical_thickness : T of the kernel. The series diverges at 1 and below.
    asymmetry : q of Henyey and Greenstein: aerosol 0.2–0.7, haze 0.7–0.8, mist 0.8–0.85, fog 0.85–0.9, rain 0.9–1.
    kernel : ``"series"`` (Narasimhan & Nayar), or ``"gaussian"``, the generalised Gaussian of Metari and Deschênes, for
        any thickness and q above 0.
    near, middle, far : Sizes of the kernel on the screen at Z = 0, at the threshold and at 1, relative to f tan θ; 0 is
        sharp. Figure 8 of the paper has sizes that shrink with depth, such as 0.04, 0.02, 0.01.
    threshold : Z of the middle kernel, the APSF threshold. In between, kernels are interpolated.
    channels : ``"luminance"`` blurs the lightness of HLS, (max + min) / 2, and keeps the ratios of the colours; black
        becomes grey where light falls on it. ``"all"`` blurs each channel, so that the light of a lamp keeps its
        colour.
    form : ``"gather"``, as published: each pixel collects with the kernel of its own depth, and a constant stays.
        ``"scatter"`` is its transpose, and conserves light.
    solver : ``"fast"`` is exact but for rounding; ``"reference"`` sums over all pairs of pixels, in float64.
    field_of_view : Horizontal, in degrees, where there is no camera.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image and from ``"reference"``.

    Raises
    ------
    ValueError
        If the series is asked for T ≤ 1 or too near to 1 (it needs more than 200 000 terms), the asymmetry does
        not suit the kernel, the image is not finite or the depth unknown (NaN) somewhere, or the sizes differ.

    Notes
    -----
    The series is far too wide: half of its light is within 42°, 50° and 53° at q = 0.9 and T = 1.2, 2 and 4, where
    photons have 7°, 10° and 16°. So a size of 1 would spread light over the whole picture; see :func:`blur` for a
    kernel that is right at its full size. Only what is within 90° can be shown, and is given the energy 1.

    Deviates from the paper, where the near kernel is the largest on the screen: by default the near layer is sharp and
    the far one soft. Borders are mirrored. Cost: three cosine transforms for each channel and one for each kernel.

    References
    ----------
    Lopez-Moreno, Cabanes & Gutierrez 2008, *Image-based participating media*, section 3.4.2 and Figure 8; Narasimhan &
    Nayar 2003, *Shedding light on the weather*; Metari & Deschênes 2007, *A new convolution kernel for atmospheric
    point spread function applied to computer vision*.
    """
    from fogpipe.kernels.scattering import profiles, varying

    require_maps(image=(image, 3), depth=(depth, 1))
    require_finite(image=image, depth=depth)
    image, depth = floats(image, depth)
    if _no_kernel(near, middle, far):
        return image.copy()
    published = {"series": profiles.legendre, "gaussian": profiles.generalised_gaussian}[kernel]
    focal = _focal_length(image.shape[1], camera, field_of_view)
    profile = published(asymmetry, optical_thickness)
    position = np.where(depth < threshold, depth / threshold, 1 + (depth - threshold) / (1 - threshold))
    focals = tuple(size * focal for size in (near, middle, far))
    lightness = (over_channels(np.maximum, image) + over_channels(np.minimum, image)) / 2
    planes = lightness[None] if channels == "luminance" else np.ascontiguousarray(image.transpose(2, 0, 1))
    blurred = varying.by_size(planes, position, profile, focals, form, exact=solver == "reference")
    if channels == "all":
        return np.ascontiguousarray(blurred.transpose(1, 2, 0))
    return _with_lightness(image, lightness, blurred[0])


def _with_lightness(image: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Colours in the same ratios, of another lightness; black becomes grey."""
    ratio = np.divide(after, before, out=np.zeros_like(after), where=before > 0)[..., None]
    return np.where(before[..., None] > 0, image * ratio, after[..., None])


def _focal_length(width: int, camera: Camera | None, field_of_view: float) -> float:
    if camera is None:
        return width / 2 / float(np.tan(np.radians(field_of_view) / 2))
    return float(np.sqrt(camera[0, 0] * camera[1, 1]))
