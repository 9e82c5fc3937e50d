"""The numbers of a depth file, as stored: PNG, ``.npy``, ``.npz``, PFM and the ``Z`` channel of OpenEXR.

What the numbers mean is the business of :mod:`fogpipe.io.encodings`. A reader takes the content of a file and raises
:class:`InputError` without the file's name, or whatever its library raises for a damaged file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.files import read_bytes
from fogpipe.io.images import MAX_PIXELS

ORIGINAL = "Give the original numbers: a 16-bit grey PNG, or a .npy, PFM or EXR file."
JPEG = b"\xff\xd8\xff"
_PNG_COLOURS = {0: "grey", 2: "colour", 3: "palette", 4: "grey with alpha", 6: "colour with alpha"}
_PFM_HEADER = re.compile(rb"(P[fF])\s+(\d{1,9})\s+(\d{1,9})\s+([-+.\deE]{1,32})\s")


class Numbers(NamedTuple):
    """What a depth file holds: its format (as in ``DepthEncoding.files``), (H, W) values of any dtype, and a remark."""

    format: str
    values: np.ndarray
    note: str = ""


def read_numbers(path: str | Path) -> Numbers:
    """The numbers that a depth file holds, with their own dtype; the format is told by the content.

    Raises
    ------
    InputError
        If the file is missing, empty, damaged, too large, of an unknown format, in colour or of 8 bits.
    """
    data = read_bytes(path)
    read = next((read for magic, read in _READERS if data.startswith(magic)), None)
    if read is None:
        raise InputError(
            f"{path}: is no format that depth is read from (PNG, .npy, .npz, PFM, OpenEXR)."
            f"{' A photograph is the image, not the depth.' if data.startswith(JPEG) else ''} {ORIGINAL}"
        )
    try:
        numbers = read(data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error.__cause__
    except Exception as error:  # decoders raise almost anything on a damaged file
        cause = str(error).strip().rstrip(".") or type(error).__name__
        raise InputError(f"{path}: cannot be decoded: {cause}. It is damaged or cut off; get a fresh copy.") from error
    values = numbers.values
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[:, :, 0]
    if values.ndim != 2 or not values.size:
        hint = " A picture of depth in colour has lost the depth." if values.ndim == 3 else ""
        raise InputError(f"{path}: has the shape {values.shape}, but a depth map is (H, W), one value per pixel.{hint}")
    return numbers._replace(values=values)


def _read_png(data: bytes) -> Numbers:
    from fogpipe.io.readers import read_png

    if len(data) < 33:
        raise ValueError("it ends within its header")
    bits, colour = data[24], data[25]
    if colour != 0:
        raise InputError(
            f"is a {_PNG_COLOURS.get(colour, 'strange')} picture, a photograph or one of depth;"
            f" the depth cannot be told from it. {ORIGINAL}"
        )
    if bits != 16:
        raise InputError(
            f"has {bits} bits per pixel: a picture of depth, with {2**bits} steps at most and no unit. {ORIGINAL}"
        )
    raster = read_png(data, None, MAX_PIXELS)
    if raster.samples.ndim == 3:
        raise InputError(f"declares one of its levels to be transparent, as a picture does. {ORIGINAL}")
    if raster.orientation != 1:
        raise InputError(f"has EXIF orientation {raster.orientation}, as a picture has. Save it without that tag.")
    return Numbers("png", raster.samples)


def _read_npy(data: bytes) -> Numbers:
    from fogpipe.io.readers import npy_array

    return Numbers("npy", npy_array(data, MAX_PIXELS))


def _read_npz(data: bytes) -> Numbers:
    from zipfile import ZipFile

    from fogpipe.io.readers import npy_array

    with ZipFile(BytesIO(data)) as archive:
        names = archive.namelist()
        if len(names) != 1:
            raise InputError(f"holds {len(names)} arrays, but a depth file holds one. Save the one you mean as .npy.")
        if archive.getinfo(names[0]).file_size > 16 * MAX_PIXELS:
            raise InputError(f"unpacks to more than {MAX_PIXELS} values.")
        return Numbers("npz", npy_array(archive.read(names[0]), MAX_PIXELS))


def _read_pfm(data: bytes) -> Numbers:
    """Portable float map: ``Pf``, width, height, a scale whose sign is the byte order (negative: little endian), then
    rows from the bottom up. The size of the scale is ignored, as Middlebury's own reader does."""
    header = _PFM_HEADER.match(data)
    scale = float(header[4]) if header else 0.0
    if header is None or scale == 0 or not math.isfinite(scale):
        raise InputError("is not a valid PFM file: its header must be Pf, width, height and a scale.")
    if header[1] == b"PF":
        raise InputError(f"is a colour PFM (PF), but a depth map has one channel (Pf). {ORIGINAL}")
    width, height = int(header[2]), int(header[3])
    if len(data) - header.end() < 4 * width * height:
        raise InputError(
            f"is cut off: {width}×{height} values take {4 * width * height} bytes,"
            f" and {len(data) - header.end()} are there. Get a fresh copy."
        )
    values = np.frombuffer(data, "<f4" if scale < 0 else ">f4", width * height, header.end())
    return Numbers("pfm", values.reshape(height, width)[::-1].astype(np.float32))


def _read_exr(data: bytes) -> Numbers:
    from fogpipe.io.exr import map_channel, read_channels

    channels, note = read_channels(data, max_pixels=MAX_PIXELS)
    return Numbers("exr", map_channel(channels, ("Z",)), note)


_READERS: tuple[tuple[bytes, Callable[[bytes], Numbers]], ...] = (
    (b"\x89PNG\r\n\x1a\n", _read_png),
    (b"\x93NUMPY", _read_npy),
    (b"PK\x03\x04", _read_npz),
    (b"Pf", _read_pfm),
    (b"PF", _read_pfm),
    (b"\x76\x2f\x31\x01", _read_exr),
)
