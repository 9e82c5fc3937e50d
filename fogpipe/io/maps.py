"""Maps in and out: one number, or one yes or no, per pixel.

A map is what its pipeline says it is: a transmission, a density, a mask. Measured depth has encodings and units of its
own, see :mod:`fogpipe.io.depth`.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from fogpipe.errors import InputError, OutputError
from fogpipe.io.atomic import atomic_write
from fogpipe.io.exr import write_channels
from fogpipe.io.files import read_bytes
from fogpipe.io.images import MAX_PIXELS, decode_raster
from fogpipe.io.readers import read_exr_map
from fogpipe.io.writers import encode_npy, encode_png, encode_tiff, quantised

FORMATS = (".npy", ".exr", ".tif", ".tiff", ".png")


def write_map(path: str | os.PathLike[str], array: np.ndarray, *, channel: str = "Y") -> None:
    """Write a map to a file, in the format that its suffix names; the file is complete or not there.

    Parameters
    ----------
    path : a file that ends in ``.npy`` (exact), ``.exr`` or ``.tif`` (float32, NaN and infinity kept) or ``.png``
        (16 bits, 65535 stands for 1; a mask takes 8 bits, 255 stands for true).
    array : (H, W) floats or booleans. ``.npy`` takes an array of any shape; ``.png`` takes floats in [0, 1] only.
    channel : name of the channel in an OpenEXR file; by custom Z is distance and Y is any other single value.

    Raises
    ------
    OutputError
        If the format is unknown or cannot hold the map, or if the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    try:
        data = _encode(array, suffix, channel)
    except OutputError as error:
        raise OutputError(f"{path}: {error}") from None
    with atomic_write(path) as temporary:
        temporary.write_bytes(data)


def read_map(path: str | os.PathLike[str], *, max_pixels: int = MAX_PIXELS) -> np.ndarray:
    """Read a map from a file: what :func:`write_map` writes, and any grey picture.

    Parameters
    ----------
    path : the file. Of OpenEXR the channel Z, else Y, else the only one is read.
    max_pixels : refuse a map whose header states more pixels than that, before it is decoded.

    Returns
    -------
    (H, W) float32, or float64 or bool where ``.npy`` holds that. Integers become shares of the largest, so a mask in a
    PNG comes back as 0 and 1.

    Raises
    ------
    InputError
        If the file is missing, damaged or too large, or has more than one value per pixel.
    """
    raster = decode_raster(read_bytes(path), name=str(path), max_pixels=max_pixels, exr=read_exr_map)
    values = raster.samples[..., 0] if raster.samples.shape[2:] == (1,) else raster.samples
    if values.ndim != 2 or values.size == 0:
        hint = " A map that was painted in colours has lost its numbers." if values.ndim == 3 else ""
        raise InputError(
            f"{path}: has the shape {values.shape}, but a map is (height, width), a value per pixel.{hint}"
        )
    if values.dtype.kind == "u":
        return values / np.float32(np.iinfo(values.dtype).max)
    if values.dtype.kind not in "fb":
        raise InputError(f"{path}: holds {values.dtype}, but a map is floating point, boolean, uint8 or uint16.")
    return values.astype(np.float32 if values.dtype.itemsize == 2 else values.dtype.newbyteorder("="), copy=False)


def _encode(array: np.ndarray, suffix: str, channel: str) -> bytes:
    if suffix not in FORMATS:
        raise OutputError(f'has the ending "{suffix}", which names no format of maps. Choose {" or ".join(FORMATS)}.')
    if array.dtype.kind not in "fb":
        raise OutputError(f"the map is {array.dtype}; a map is floating point or boolean.")
    if suffix == ".npy":
        return encode_npy(array)
    if array.ndim != 2 or array.size == 0:
        raise OutputError(f"the map has the shape {array.shape}, and only .npy holds anything but (height, width).")
    if suffix == ".png":
        return encode_png(_levels(array))
    with np.errstate(over="ignore"):  # beyond float32 there is only infinity
        single = array.astype(np.float32)
    return write_channels({channel: single}) if suffix == ".exr" else encode_tiff(single)


def _levels(array: np.ndarray) -> np.ndarray:
    if array.dtype == bool:
        return np.where(array, np.uint8(255), np.uint8(0))
    if not (array.min() >= 0 and array.max() <= 1):  # NaN is neither
        raise OutputError(
            f"the map reaches from {np.fmin.reduce(array, axis=None):g} to {np.fmax.reduce(array, axis=None):g}"
            f" with {np.count_nonzero(np.isnan(array))} NaN, and PNG holds [0, 1] only. Choose .npy, .exr or .tif."
        )
    return quantised(array, 16)
