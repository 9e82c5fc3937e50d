"""Encoded pictures as samples: PNG, JPEG, WebP, OpenEXR, Radiance HDR, ``.npy`` (and TIFF, in its own module).

A reader takes the content of a file. It raises :class:`InputError` without the file's name, or whatever its library
raises for a damaged file; :func:`fogpipe.io.images.decode_image` makes one clear error of either.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Literal

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.profiles import linear_from_profile, to_srgb

if TYPE_CHECKING:
    from PIL import ImageFile

ORIENTATION = 0x0112
MODES = {
    "1": "1-bit",
    "L": "8-bit grey",
    "LA": "8-bit grey with alpha",
    "P": "8-bit palette",
    "PA": "8-bit palette with alpha",
    "RGB": "8-bit colour",
    "RGBA": "8-bit colour with alpha",
    "CMYK": "8-bit CMYK",
}
CHANNELS = {1: "grey", 2: "grey with alpha", 3: "colour", 4: "colour with alpha"}


@dataclass(frozen=True)
class Raster:
    """Samples as a file holds them, but upright and with straight alpha.

    Attributes
    ----------
    samples : (H, W) or (H, W, C), C from 1 to 4: grey, grey and alpha, colour, colour and alpha.
    light : what the samples of colour mean: ``srgb`` display values, ``linear`` light, or ``working`` for whatever
        the pipeline works on. Integers count up to display white.
    description : for people, such as ``8-bit grey PNG, sRGB``.
    orientation : the EXIF orientation that the file states and that was applied.
    """

    samples: np.ndarray
    light: Literal["srgb", "linear", "working"]
    description: str
    orientation: int = 1


Reader = Callable[[bytes, str | None, int], Raster]
"""Takes the content, the layer to read (OpenEXR only) and the largest number of pixels."""


def refuse_huge(width: int, height: int, max_pixels: int) -> None:
    """Refuse a picture by the size in its header, before its pixels are decoded."""
    if width * height > max_pixels:
        raise InputError(
            f"says that it has {width}×{height} pixels, and more than {max_pixels} are not read."
            f" Make it smaller, or raise max_pixels if the file is to be trusted."
        )


def upright(samples: np.ndarray, orientation: int) -> np.ndarray:
    """Turn samples as the EXIF orientation asks (1 to 8; anything else means 1)."""
    if orientation in (5, 6, 7, 8):
        samples = np.swapaxes(samples, 0, 1)
    if orientation in (3, 4, 7, 8):
        samples = samples[::-1]
    if orientation in (2, 3, 6, 7):
        samples = samples[:, ::-1]
    return samples


def unpremultiplied(samples: np.ndarray) -> np.ndarray:
    """Divide float colour by alpha, the last channel, where there is any; light without opacity stays as it is."""
    alpha = samples[..., -1:]
    straight = samples / np.where(alpha > 0, alpha, 1)
    straight[..., -1:] = alpha
    return straight


def described(*parts: str) -> str:
    """The description of a raster, from those of its parts that say something."""
    return ", ".join(part for part in parts if part)


def read_png(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """PNG of any colour type; 16 bits by OpenCV, since Pillow narrows them."""
    from PIL.PngImagePlugin import PngImageFile

    image = PngImageFile(BytesIO(data))
    refuse_huge(*image.size, max_pixels)
    if data[24] < 16:
        return from_pillow(image, "PNG")
    image.load()  # finds damage in the pixels, and an EXIF chunk after them
    _check_lengths(data)
    samples = opencv_samples(data)
    if samples.ndim == 2 and "transparency" in image.info:  # a level that means "nothing here"
        opaque = np.where(samples == image.info["transparency"], 0, 65535)
        samples = np.stack([samples, opaque.astype(np.uint16)], axis=-1)
    orientation = image.getexif().get(ORIENTATION, 1)
    return from_deep("PNG", upright(samples, orientation), image.info.get("icc_profile"), orientation)


def _check_lengths(data: bytes) -> None:
    """OpenCV takes a chunk's word for its length, and would reserve gigabytes for it."""
    place, name = 8, b""
    while name != b"IEND":
        length, name = int.from_bytes(data[place : place + 4]), data[place + 4 : place + 8]
        place += 12 + length
        if place > len(data):
            raise ValueError("a chunk is longer than the file")


def read_jpeg(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """JPEG: grey, colour or CMYK."""
    from PIL.JpegImagePlugin import JpegImageFile

    image = JpegImageFile(BytesIO(data))
    refuse_huge(*image.size, max_pixels)
    return from_pillow(image, "JPEG")


def read_webp(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """WebP; of an animation, the first frame."""
    from PIL.WebPImagePlugin import WebPImageFile

    image = WebPImageFile(BytesIO(data))
    refuse_huge(*image.size, max_pixels)
    return from_pillow(image, "WebP")


def from_pillow(image: ImageFile.ImageFile, name: str) -> Raster:
    """An 8-bit picture that Pillow has opened."""
    stated = image.getexif().get(ORIENTATION, 1)
    image.load()
    left = image.getexif().get(ORIENTATION, 1)  # gone where Pillow has turned it on loading
    kind = MODES.get(image.mode, f"8-bit {image.mode}")
    converted, profile = to_srgb(image)
    return Raster(upright(np.asarray(converted), left), "srgb", described(f"{kind} {name}", profile), stated)


def from_deep(name: str, samples: np.ndarray, profile: bytes | None, orientation: int = 1) -> Raster:
    """Upright uint16 samples with the profile that came with them."""
    channels = 1 if samples.ndim == 2 else samples.shape[2]
    kind = f"16-bit {CHANNELS[channels]} {name}"
    if profile is None or channels < 3:
        note = "sRGB" if profile is None else "taken as sRGB: ICC profiles are not applied to 16-bit grey"
        return Raster(samples, "srgb", described(kind, note), orientation)
    linear, note = linear_from_profile(samples[..., :3], profile)
    description = described(kind, note)
    if linear is None:
        return Raster(samples, "srgb", description, orientation)
    alpha = samples[..., 3:] / np.float32(65535)
    return Raster(np.concatenate([linear, alpha], axis=-1), "linear", description, orientation)


def opencv_samples(data: bytes) -> np.ndarray:
    """Samples by OpenCV, with channels in the usual order."""
    import cv2
    from cv2.utils import logging

    level = logging.setLogLevel(logging.LOG_LEVEL_SILENT)  # a damaged file is told by an error, not on the terminal
    try:
        samples = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    finally:
        logging.setLogLevel(level)
    if samples is None:
        raise ValueError("OpenCV cannot decode it")
    if samples.ndim == 2:
        return samples
    return samples[..., [2, 1, 0, 3][: samples.shape[2]]]


def read_exr(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """OpenEXR: R, G, B and A, or Y and A, of one layer; linear light, premultiplied."""
    from fogpipe.io.exr import listed, read_channels

    channels, note = read_channels(data, max_pixels=max_pixels)
    prefix = f"{layer}." if layer else ""
    for names in ("RGB", "Y"):
        found = [channels[prefix + name] for name in names if prefix + name in channels]
        if len(found) == len(names):
            break
    else:
        wanted = f"{prefix}R, {prefix}G and {prefix}B, nor {prefix}Y"
        raise InputError(f"has no channels {wanted}. It has {listed(channels)}.")
    if names == "Y" and f"{prefix}RY" in channels:
        raise InputError("holds luminance and chroma (Y, RY, BY). Save it with channels R, G and B.")
    if alpha := f"{prefix}A" in channels:
        found.append(channels[f"{prefix}A"])
    if any(channel.shape != found[0].shape or channel.dtype.kind != "f" for channel in found):
        raise InputError("has colour channels of different sizes, or of integers. Save it with channels of one size.")
    samples = np.stack(found, axis=-1).astype(np.float32)
    if alpha:
        samples = unpremultiplied(samples)
    depth = "half" if found[0].dtype == np.float16 else "float"
    kind = f"{depth} {CHANNELS[samples.shape[2]]} OpenEXR"
    return Raster(samples, "linear", described(kind, f"layer {layer}" if layer else "", note))


def read_exr_map(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """OpenEXR: the one channel of a map."""
    from fogpipe.io.exr import map_channel, read_channels

    channels, note = read_channels(data, max_pixels=max_pixels)
    return Raster(map_channel(channels, ("Z", "Y")), "working", described("OpenEXR map", note))


def read_hdr(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """Radiance HDR: linear light."""
    size = re.search(rb"\n\n([-+][XY]) +(\d{1,9}) +([-+][XY]) +(\d{1,9})\n", data[:65536])
    if size is None or size[1] != b"-Y" or size[3] != b"+X":
        raise InputError("has no size line of the form -Y height +X width. Save it anew.")
    refuse_huge(int(size[4]), int(size[2]), max_pixels)
    return Raster(opencv_samples(data), "linear", "float colour Radiance HDR")


def read_npy(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """An array: integers are display values, floats are working values as they are."""
    array = npy_array(data, max_pixels)
    light = "srgb" if array.dtype.kind == "u" else "working"
    return Raster(array, light, f"{array.dtype} .npy of shape {array.shape}")


def npy_array(data: bytes, max_pixels: int) -> np.ndarray:
    """The array of an ``.npy`` file, which must hold as much as its header says; nothing is unpickled."""
    stream = BytesIO(data)
    version = np.lib.format.read_magic(stream)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = header(stream)
    if dtype.hasobject:
        raise InputError("holds pickled Python objects, which fogpipe never reads. Save a plain array of numbers.")
    refuse_huge(*(shape[:2] if len(shape) > 1 else (math.prod(shape), 1)), max_pixels)
    if math.prod(shape) * dtype.itemsize > len(data) - stream.tell():
        raise ValueError(f"an array of shape {shape} and dtype {dtype} needs more bytes than there are")
    return np.load(BytesIO(data), allow_pickle=False)
