"""TIFF files as samples. 8 bits are Pillow's; deeper ones tifffile's, since Pillow narrows or refuses them."""

from __future__ import annotations

import logging
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.readers import (
    CHANNELS,
    ORIENTATION,
    Raster,
    from_deep,
    from_pillow,
    opencv_samples,
    refuse_huge,
    unpremultiplied,
    upright,
)

if TYPE_CHECKING:
    from tifffile import TiffPage

logging.getLogger("tifffile").addHandler(logging.NullHandler())  # its remarks on odd files are not for the terminal

_ICC_PROFILE = 34675
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB = 0, 1, 2
_PREMULTIPLIED = 1
_LZW = 5
_FLOAT_PREDICTOR = 3
_BITS = {"uint16": 16, "float16": 16, "float32": 32, "float64": 64}


def read_tiff(data: bytes, layer: str | None, max_pixels: int) -> Raster:
    """The first page: up to 8 bits of any kind, or 16-bit or float grey or colour, with or without alpha."""
    from PIL.TiffImagePlugin import TiffImageFile
    from tifffile import TiffFile

    with TiffFile(BytesIO(data)) as file:
        page = file.pages.first
        # A damaged tag gives a tuple, and thousands of them when it is multiplied.
        refuse_huge(int(page.imagewidth), int(page.imagelength) * int(page.imagedepth), max_pixels)
        if page.bitspersample <= 8:
            return from_pillow(TiffImageFile(BytesIO(data)), "TIFF")
        return _read_deep(data, page)


def _read_deep(data: bytes, page: TiffPage) -> Raster:
    _refuse_strange(page)
    samples, orientation = _samples(data, page)
    if page.photometric == _WHITE_IS_ZERO:
        samples = 65535 - samples
    if page.extrasamples and page.extrasamples[0] == _PREMULTIPLIED:
        white = np.float32(65535 if samples.dtype.kind == "u" else 1)
        straight = unpremultiplied(samples / white)
        samples = np.rint(np.clip(straight, 0, 1) * white).astype(samples.dtype) if white > 1 else straight
    if samples.dtype.kind == "u":
        profile = page.tags.get(_ICC_PROFILE)
        return from_deep("TIFF", samples, profile.value if profile else None, orientation)
    kind = f"float {CHANNELS[page.samplesperpixel]} TIFF"
    return Raster(samples.astype(np.float32), "linear", kind, orientation)


def _refuse_strange(page: TiffPage) -> None:
    channels = {_WHITE_IS_ZERO: (1,), _BLACK_IS_ZERO: (1, 2), _RGB: (3, 4)}.get(page.photometric, ())
    dtype = str(page.dtype)
    inverted_light = page.photometric == _WHITE_IS_ZERO and dtype != "uint16"
    if (
        page.samplesperpixel not in channels
        or page.axes not in ("YX", "YXS", "SYX")
        or page.bitspersample != _BITS.get(dtype)  # 12 bits in a uint16, for instance, have another white
        or inverted_light
    ):
        raise InputError(
            f"is a TIFF of {page.samplesperpixel} channels of {dtype} ({page.bitspersample} bits, photometric"
            f" {page.photometric}, shape {page.shape}), which is not read."
            f" Save it as grey or RGB, with or without alpha, of 8 or 16 bits or float."
        )


def _samples(data: bytes, page: TiffPage) -> tuple[np.ndarray, int]:
    """Upright samples, channels last, and the orientation that was applied."""
    tag = page.tags.get(ORIENTATION)
    orientation = int(tag.value) if tag else 1
    if page.compression == _LZW or page.predictor == _FLOAT_PREDICTOR:  # tifffile needs another package for these
        samples = opencv_samples(data)  # upright already
        if samples.dtype != page.dtype or samples.size != np.prod(page.shape):
            raise InputError(
                f"is a TIFF of {page.samplesperpixel} channels of {page.dtype} in a compression that is not read."
                f" Save it with ZIP (deflate) compression or none."
            )
        return samples, orientation
    samples = page.asarray()
    return upright(np.moveaxis(samples, 0, -1) if page.axes == "SYX" else samples, orientation), orientation
