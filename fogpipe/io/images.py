"""Pictures in and out: files or arrays on one side, the pipeline's working space on the other.

The working space is *what the numbers mean inside*: ``linear`` light, or ``srgb`` display values for papers that
work on those. Files of 8 and 16 bits hold sRGB display values; OpenEXR, Radiance HDR and TIFF of floats hold linear
light; ``.npy`` holds working values as they are.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fogpipe.errors import InputError, OutputError
from fogpipe.io.atomic import atomic_write
from fogpipe.io.files import read_bytes, split_layer
from fogpipe.io.readers import Raster, Reader, described, read_exr, read_hdr, read_jpeg, read_npy, read_png, read_webp
from fogpipe.io.tiff import read_tiff
from fogpipe.io.writers import encode, nonfinite
from fogpipe.kernels.srgb import linear_from_srgb, srgb_from_linear
from fogpipe.ports import Color, FloatArray

MAX_PIXELS = 400_000_000
"""The largest picture that is read; a few kilobytes can promise to unpack to terabytes."""

APART = 100
"""Levels of 65535 next to a number that marks unknown depth, in which no depth is; a dark photograph has some there."""
MARKED = 0.001
"""Least share of a depth map that is marked; a photograph may have some black pixels."""

_READERS = (
    (b"\x89PNG\r\n\x1a\n", "PNG", read_png),
    (b"\xff\xd8\xff", "JPEG", read_jpeg),
    (b"II*\0", "TIFF", read_tiff),
    (b"MM\0*", "TIFF", read_tiff),
    (b"II+\0", "TIFF", read_tiff),
    (b"MM\0+", "TIFF", read_tiff),
    (b"RIFF", "WebP", read_webp),
    (b"\x76\x2f\x31\x01", "OpenEXR", read_exr),
    (b"#?RADIANCE", "Radiance HDR", read_hdr),
    (b"#?RGBE", "Radiance HDR", read_hdr),
    (b"\x93NUMPY", ".npy", read_npy),
)


@dataclass(frozen=True)
class Picture:
    """A picture in the working space.

    Attributes
    ----------
    pixels : (H, W, 3) float32 (float64 from a float64 array), finite. 1 is display white, more is HDR.
    alpha : (H, W) float32 in [0, 1], the opacity, by which ``pixels`` is not multiplied; or None.
    description : what it was and what was done to it, for people.
    orientation : the EXIF orientation (1 to 8) that was applied; 1 where the file was upright.
    """

    pixels: FloatArray
    alpha: FloatArray | None
    description: str
    orientation: int = 1


def read_image(path: str | os.PathLike[str], *, color: Color = "linear", max_pixels: int = MAX_PIXELS) -> Picture:
    """Read a picture from a file: PNG, JPEG, TIFF, WebP, OpenEXR, Radiance HDR or ``.npy``, told by its content.

    An embedded ICC profile is converted to sRGB and the EXIF orientation is applied. Grey becomes three equal
    channels. ``picture.exr#left`` reads the layer or view ``left`` of an OpenEXR file.

    Parameters
    ----------
    path : the file.
    color : the working space.
    max_pixels : refuse a picture whose header states more pixels than that, before it is decoded.

    Raises
    ------
    InputError
        If the file is missing, damaged, too large, of an unknown format, or holds NaN or infinity.
    """
    file, layer = split_layer(path)
    data = read_bytes(file)
    return decode_image(data, color=color, name=str(path), layer=layer or None, max_pixels=max_pixels)


def decode_image(
    data: bytes,
    *,
    color: Color = "linear",
    name: str = "the data",
    layer: str | None = None,
    max_pixels: int = MAX_PIXELS,
) -> Picture:
    """Read a picture from the content of a file; otherwise as :func:`read_image`.

    Parameters
    ----------
    data : the content of the file.
    name : how messages call it.
    layer : layer or view of an OpenEXR file.
    """
    raster = decode_raster(data, name=name, layer=layer, max_pixels=max_pixels)
    try:
        return _picture(raster, color)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def decode_raster(
    data: bytes, *, name: str, layer: str | None = None, max_pixels: int = MAX_PIXELS, exr: Reader = read_exr
) -> Raster:
    """The samples of an encoded picture or map as they are; whatever goes wrong is one :class:`InputError`.

    ``exr`` reads OpenEXR, whose named channels may be a picture's or a map's.
    """
    try:
        return _decode(data, layer, max_pixels, exr)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error.__cause__


def picture_from_array(array: np.ndarray, *, color: Color = "linear") -> Picture:
    """Take a picture from an array.

    Parameters
    ----------
    array : (H, W), (H, W, 1), (H, W, 2), (H, W, 3) or (H, W, 4): grey or colour, with or without a straight alpha.
        uint8 and uint16 are sRGB display values, alpha excepted. Floats are working values as they are; float16
        becomes float32, float64 stays. A float array may be shared with the result.
    color : the working space.

    Raises
    ------
    InputError
        For another shape or dtype, an empty array, or NaN or infinity.
    """
    light = "srgb" if array.dtype.kind == "u" else "working"
    try:
        return _picture(Raster(array, light, f"{array.dtype} array of shape {array.shape}"), color)
    except InputError as error:
        raise InputError(f"the array {error}") from None


def write_image(
    path: str | os.PathLike[str],
    pixels: np.ndarray,
    *,
    color: Color = "linear",
    alpha: np.ndarray | None = None,
    bits: int | None = None,
) -> None:
    """Write a picture to a file, in the format that its suffix names; the file is complete or not there.

    Parameters
    ----------
    path : a file that ends in ``.png`` (8 or 16 bits), ``.jpg``, ``.jpeg`` (8), ``.tif``, ``.tiff`` (8, 16 or 32),
        ``.webp`` (8, lossless), ``.exr`` (16 or 32), ``.hdr`` (32) or ``.npy``.
    pixels : (H, W, 3) floats in the working space. Formats of integers clip them to [0, 1].
    color : the working space.
    alpha : (H, W) opacity in [0, 1], by which ``pixels`` is not multiplied.
    bits : bits per sample; the default is 8, and for OpenEXR 16 (32 where a value is too large for it).

    Raises
    ------
    OutputError
        If the format is unknown or cannot hold the picture, or if the file cannot be written.
    """
    try:
        data = encode_image(pixels, Path(path).suffix, color=color, alpha=alpha, bits=bits)
    except OutputError as error:
        raise OutputError(f"{path}: {error}") from error.__cause__
    with atomic_write(path) as temporary:
        temporary.write_bytes(data)


def encode_image(
    pixels: np.ndarray,
    suffix: str,
    *,
    color: Color = "linear",
    alpha: np.ndarray | None = None,
    bits: int | None = None,
) -> bytes:
    """The content of a file that :func:`write_image` would write; ``suffix`` names the format."""
    return encode(pixels, suffix, color=color, alpha=alpha, bits=bits)


def _decode(data: bytes, layer: str | None, max_pixels: int, exr: Reader) -> Raster:
    found = next(((name, read) for magic, name, read in _READERS if data.startswith(magic)), None)
    if found is None:
        known = ", ".join(dict.fromkeys(name for _, name, _ in _READERS))
        raise InputError(f"is not a picture that is read here ({known}). Convert it to one of these.")
    name, read = found
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what libraries remark on odd files; what matters is raised
            return (exr if name == "OpenEXR" else read)(data, layer, max_pixels)
    except InputError:
        raise
    except Exception as error:  # decoders raise almost anything on a damaged file
        cause = str(error).strip().rstrip(".") or type(error).__name__
        raise InputError(
            f"cannot be decoded as {name}: {cause}. It is damaged or cut off, or of a rare kind;"
            f" get a fresh copy, or save it anew as PNG."
        ) from error


def _picture(raster: Raster, color: Color) -> Picture:
    samples = _checked(raster.samples)
    channels = samples.shape[2]
    alpha = None
    if channels in (2, 4):
        alpha = np.clip(_display(samples[..., -1]), 0, 1).astype(np.float32, copy=False)
        samples = samples[..., :-1]
    pixels = _working(samples, raster.light, color)
    if pixels.shape[2] == 1:
        pixels = np.repeat(pixels, 3, axis=2)
    orientation = raster.orientation if raster.orientation in range(2, 9) else 1
    turned = f"EXIF orientation {orientation} applied" if orientation != 1 else ""
    description = described(raster.description, turned, _doubt(samples))
    return Picture(np.ascontiguousarray(pixels), alpha, description, orientation)


def _doubt(samples: np.ndarray) -> str:
    """A question about a picture that looks like a depth map, or an empty text.

    Depth maps are grey, of 16 bits, and mark what was not measured by 0 or the largest number, with nothing near it.
    """
    if samples.dtype != np.uint16 or samples.shape[2] != 1:
        return ""
    for mark, near in ((0, samples < APART), (65535, samples > 65535 - APART)):
        marked = np.count_nonzero(samples == mark)
        if MARKED * samples.size < marked == np.count_nonzero(near) < samples.size:
            return f"is this a depth map? {marked / samples.size:.1%} of it is {mark}, and nothing is near that number"
    return ""


def _checked(samples: np.ndarray) -> np.ndarray:
    """The samples as (H, W, C) in native byte order, if they can be a picture."""
    shape, dtype = samples.shape, samples.dtype.newbyteorder("=")
    if samples.ndim not in (2, 3) or (samples.ndim == 3 and shape[2] not in (1, 2, 3, 4)):
        raise InputError(
            f"has the shape {shape}, but a picture is (height, width) or (height, width, channels), 1 to 4 channels."
        )
    if samples.size == 0:
        raise InputError(f"is empty: its shape is {shape}. Give at least one pixel.")
    if dtype not in (np.uint8, np.uint16, np.float16, np.float32, np.float64):
        raise InputError(
            f"has the dtype {dtype}, but a picture is uint8 or uint16 (display values) or float (working values)."
        )
    if dtype.kind == "f" and (found := nonfinite(samples)):
        raise InputError(f"holds {found}. A picture is finite: fill or clip them first.")
    return samples.astype(dtype, copy=False).reshape(*shape[:2], -1)


def _working(samples: np.ndarray, light: str, color: Color) -> FloatArray:
    if samples.dtype.kind == "u":
        return linear_from_srgb(samples) if color == "linear" else _display(samples)
    floats = samples.astype(np.float32) if samples.dtype == np.float16 else samples
    if light in ("working", color):
        return floats
    return linear_from_srgb(floats) if color == "linear" else srgb_from_linear(floats)


def _display(samples: np.ndarray) -> FloatArray:
    """Samples as float32, where integers count up to 1."""
    return samples / np.float32(np.iinfo(samples.dtype).max if samples.dtype.kind == "u" else 1)
