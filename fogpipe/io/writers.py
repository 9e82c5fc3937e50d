"""Samples as encoded pictures. A writer takes upright samples and gives the content of a file, in memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from fogpipe.errors import OutputError
from fogpipe.kernels.srgb import linear_from_srgb, srgb_levels_from_linear
from fogpipe.ports import Color

LARGEST_HALF = 65504.0


@dataclass(frozen=True)
class Format:
    """What a format of pictures can hold.

    Attributes
    ----------
    name : for messages.
    encode : takes (H, W), (H, W, 3) or (H, W, 4) samples: uint8 or uint16 display values, float16 or float32 light.
    integers, floats : bits per sample of either sort; the first of all is the default.
    alpha : whether it has room for an opacity.
    premultiplied : whether its colour is to be multiplied by alpha.
    nonfinite : whether its floats can be NaN or infinite.
    """

    name: str
    encode: Callable[[np.ndarray], bytes]
    integers: tuple[int, ...] = ()
    floats: tuple[int, ...] = ()
    alpha: bool = True
    premultiplied: bool = False
    nonfinite: bool = True


def encode(pixels: np.ndarray, suffix: str, *, color: Color, alpha: np.ndarray | None, bits: int | None) -> bytes:
    """The content of a file for a picture in the working space; see :func:`fogpipe.io.images.write_image`."""
    form = _format(suffix, alpha, bits)
    pixels = _checked(pixels, alpha)
    depth = bits or next(iter(form.integers + form.floats), None)
    if depth is None:
        samples = _with_alpha(pixels, alpha)
    elif depth in form.integers:
        _refuse_nonfinite(pixels, form)
        levels = srgb_levels_from_linear if color == "linear" else quantised
        samples = _with_alpha(levels(pixels, depth), None if alpha is None else quantised(alpha, depth))
    else:
        linear = pixels if color == "linear" else linear_from_srgb(pixels)
        if alpha is not None and form.premultiplied:
            linear = linear * alpha[..., np.newaxis]
        samples = _with_alpha(_narrowed(linear, depth, insist=bits is not None), alpha)
        if not form.nonfinite:
            _refuse_nonfinite(samples, form)
    try:
        return form.encode(samples)
    except Exception as error:  # encoders raise almost anything, such as for too large a picture
        raise OutputError(f"cannot be encoded as {form.name}: {error}. Choose another format.") from error


def quantised(values: np.ndarray, bits: int) -> np.ndarray:
    """Values in [0, 1] (others are clipped) as integers of 8 or 16 bits, rounded."""
    top = 2**bits - 1
    return np.rint(np.clip(values, 0, 1) * top).astype(np.uint8 if bits == 8 else np.uint16)


def _format(suffix: str, alpha: np.ndarray | None, bits: int | None) -> Format:
    form = FORMATS.get(suffix.lower())
    if form is None:
        raise OutputError(f'has the ending "{suffix}", which names no format. Choose one of {", ".join(FORMATS)}.')
    if alpha is not None and not form.alpha:
        raise OutputError(f"{form.name} has no room for an alpha channel. Choose PNG, TIFF, WebP or OpenEXR.")
    if bits is not None and bits not in form.integers + form.floats:
        choice = " or ".join(map(str, form.integers + form.floats)) or "none; it keeps the values as they are"
        raise OutputError(f"{form.name} has no {bits} bits per sample. Choose {choice}.")
    return form


def _checked(pixels: np.ndarray, alpha: np.ndarray | None) -> np.ndarray:
    """The pixels in float32 or float64, if they can be a picture."""
    if pixels.dtype.kind != "f" or pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        raise OutputError(
            f"the pixels are {pixels.dtype} {pixels.shape}; a picture is floating point (height, width, 3)."
        )
    if alpha is not None and alpha.shape != pixels.shape[:2]:
        raise OutputError(f"the alpha channel is {alpha.shape}, but the picture is {pixels.shape[:2]}.")
    if alpha is not None and not np.isfinite(alpha).all():
        raise OutputError("the alpha channel holds NaN or infinity. Give an opacity from 0 to 1.")
    return pixels if pixels.dtype in (np.float32, np.float64) else pixels.astype(np.float32)


def nonfinite(samples: np.ndarray) -> str:
    """How many samples are NaN or infinite, and where the first is, in words; empty if there is none."""
    finite = np.isfinite(samples)
    if finite.all():
        return ""
    row, column = np.unravel_index(np.argmin(finite), samples.shape)[:2]
    nans = np.count_nonzero(np.isnan(samples))
    infinite = np.count_nonzero(np.isinf(samples))
    counts = " and ".join(f"{count} {what}" for count, what in ((nans, "NaN"), (infinite, "infinite")) if count)
    return f"{counts} of {samples.size} values, the first at row {row}, column {column} (from 0)"


def _refuse_nonfinite(samples: np.ndarray, form: Format) -> None:
    if found := nonfinite(samples):
        raise OutputError(f"the picture holds {found}, and {form.name} cannot hold them. Choose OpenEXR or .npy.")


def _with_alpha(samples: np.ndarray, alpha: np.ndarray | None) -> np.ndarray:
    return samples if alpha is None else np.dstack([samples, alpha.astype(samples.dtype)])


def _narrowed(linear: np.ndarray, bits: int, *, insist: bool) -> np.ndarray:
    """As float16 or float32; as float32, too, where float16 is only the default and a value is too large for it."""
    if bits == 16:
        if not np.any((np.abs(linear) > LARGEST_HALF) & np.isfinite(linear)):
            return linear.astype(np.float16)
        if insist:
            raise OutputError(f"a value is above {LARGEST_HALF:g}, the largest that 16 bits hold. Choose 32 bits.")
    with np.errstate(over="ignore"):  # beyond float32 there is only infinity
        return linear.astype(np.float32, copy=False)


def encode_png(samples: np.ndarray) -> bytes:
    """PNG of 8 or 16 bits. OpenCV is as fast as PNG gets, and Pillow has no colour of 16 bits.

    One filter for all rows takes two thirds of the time of choosing one for each row, at nearly the same size. What it
    leaves of a photograph of 8 bits repeats in runs, if at all.
    """
    import cv2

    photograph = samples.dtype == np.uint8 and samples.ndim == 3
    strategy = cv2.IMWRITE_PNG_STRATEGY_RLE if photograph else cv2.IMWRITE_PNG_STRATEGY_FILTERED
    settings = {
        cv2.IMWRITE_PNG_COMPRESSION: 1,
        cv2.IMWRITE_PNG_STRATEGY: strategy,
        cv2.IMWRITE_PNG_FILTER: cv2.IMWRITE_PNG_FILTER_AVG,
    }
    return _by_opencv(".png", samples, settings)


def encode_jpeg(samples: np.ndarray) -> bytes:
    """JPEG of quality 95 with full resolution of colour."""
    return _by_pillow(samples, format="JPEG", quality=95, subsampling=0)


def encode_webp(samples: np.ndarray) -> bytes:
    """Lossless WebP, which also keeps colour where nothing is opaque."""
    return _by_pillow(samples, format="WEBP", lossless=True, exact=True, method=1, quality=50)


def encode_tiff(samples: np.ndarray) -> bytes:
    """TIFF with ZIP compression and straight alpha."""
    import tifffile

    stream = BytesIO()
    tifffile.imwrite(
        stream,
        samples,
        photometric="minisblack" if samples.ndim == 2 else "rgb",
        extrasamples=["unassalpha"] if samples.shape[2:] == (4,) else None,
        compression="zlib",
        compressionargs={"level": 2},
        predictor=samples.dtype.kind == "u",
        metadata=None,
        software=False,
    )
    return stream.getvalue()


def encode_exr(samples: np.ndarray) -> bytes:
    """OpenEXR with channels R, G, B and A, or Y for grey."""
    from fogpipe.io.exr import write_channels

    if samples.ndim == 2:
        return write_channels({"Y": samples})
    return write_channels({name: samples[..., index] for index, name in enumerate("RGBA"[: samples.shape[2]])})


def encode_hdr(samples: np.ndarray) -> bytes:
    """Radiance HDR: 8 bits of mantissa and a shared exponent per pixel, so an error up to 1/128 of the largest channel.

    It cannot hold negative light, which becomes black.
    """
    return _by_opencv(".hdr", np.maximum(samples, 0), {})


def encode_npy(samples: np.ndarray) -> bytes:
    """An array as it is."""
    stream = BytesIO()
    np.save(stream, samples, allow_pickle=False)
    return stream.getvalue()


def _by_opencv(suffix: str, samples: np.ndarray, settings: Mapping[int, int]) -> bytes:
    import cv2

    if samples.ndim == 3:
        samples = cv2.cvtColor(samples, cv2.COLOR_RGB2BGR if samples.shape[2] == 3 else cv2.COLOR_RGBA2BGRA)
    listed = [number for setting in settings.items() for number in setting]
    return cv2.imencode(suffix, np.ascontiguousarray(samples), listed)[1].tobytes()


def _by_pillow(samples: np.ndarray, **settings: object) -> bytes:
    from PIL import Image

    stream = BytesIO()
    Image.fromarray(samples).save(stream, **settings)  # type: ignore[arg-type]
    return stream.getvalue()


PNG = Format("PNG", encode_png, integers=(8, 16))
JPEG = Format("JPEG", encode_jpeg, integers=(8,), alpha=False)
TIFF = Format("TIFF", encode_tiff, integers=(8, 16), floats=(32,))
WEBP = Format("WebP", encode_webp, integers=(8,))
EXR = Format("OpenEXR", encode_exr, floats=(16, 32), premultiplied=True)
HDR = Format("Radiance HDR", encode_hdr, floats=(32,), alpha=False, nonfinite=False)
NPY = Format(".npy", encode_npy)

FORMATS = {
    ".png": PNG,
    ".jpg": JPEG,
    ".jpeg": JPEG,
    ".tif": TIFF,
    ".tiff": TIFF,
    ".webp": WEBP,
    ".exr": EXR,
    ".hdr": HDR,
    ".npy": NPY,
}
