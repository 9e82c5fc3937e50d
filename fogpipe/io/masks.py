"""Regions that a person has painted: a file each, the labels of one picture, the pages of a layered TIFF or the
channels of an OpenEXR file."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.files import read_bytes, split_part
from fogpipe.io.images import MAX_PIXELS, decode_raster
from fogpipe.io.readers import Raster, refuse_huge

_EXR = b"\x76\x2f\x31\x01"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PAGE_NAME = 285
_LABELS = ("1", "L", "P", "I", "I;16")


def read_mask(text: str, *, max_pixels: int = MAX_PIXELS) -> np.ndarray:
    """Read a region from a picture, from its labels, or from a page of it.

    Parameters
    ----------
    text : ``tree.png``: where the picture is opaque if parts of it are transparent, else where it is brighter than
        half. ``labels.png#3``: where the grey level or the index of the palette is 3. ``layers.tif#2`` or
        ``layers.tif#tree``: the same as for a file, of the second page or the page of that name.
        ``render.exr#tree.mask``: where that channel is above half; without a name, its alpha.
    max_pixels : refuse a picture whose header states more pixels than that, before it is decoded.

    Returns
    -------
    (H, W) bool.

    Raises
    ------
    InputError
        If the file is missing, damaged or too large, or has no such page, label or channel.
    """
    path, part = split_part(text)
    data = read_bytes(path)
    if not part:
        return _painted(decode_raster(data, name=path, max_pixels=max_pixels, exr=_exr).samples, path)
    if data.startswith(_EXR):
        return _painted(decode_raster(data, name=text, layer=part, max_pixels=max_pixels, exr=_exr).samples, text)
    try:
        if data[:4] in _TIFF:
            return _painted(_page(data, part, max_pixels), text)
        return _label(data, part, max_pixels)
    except InputError as error:
        raise InputError(f"{text}: {error}") from None
    except Exception as error:  # Pillow raises almost anything for a damaged file
        raise InputError(f"{text}: is damaged or no picture: {error}.") from error


def _painted(samples: np.ndarray, name: str) -> np.ndarray:
    if samples.dtype == bool:
        return samples
    if samples.ndim not in (2, 3) or samples.size == 0:
        raise InputError(f"{name}: has the shape {samples.shape}, but a mask is a picture.")
    full = np.iinfo(samples.dtype).max if samples.dtype.kind == "u" else 1
    channels = samples.reshape(*samples.shape[:2], -1)
    if channels.shape[2] in (2, 4):
        opacity, channels = channels[..., -1], channels[..., :-1]
        if opacity.min() < full:
            return opacity > full / 2
    return channels.mean(axis=2) > full / 2


def _exr(data: bytes, part: str | None, max_pixels: int) -> Raster:
    from fogpipe.io.exr import listed, map_channel, read_channels

    channels, note = read_channels(data, max_pixels=max_pixels)
    if part and part not in channels:
        raise InputError(f"has no channel {part}. It has {listed(channels)}.")
    see_through = "A" in channels and channels["A"].min() < 1
    region = channels[part] if part else channels["A"] if see_through else map_channel(channels, ("Y",))
    return Raster(region.astype(np.float32), "working", note)


def _page(data: bytes, part: str, max_pixels: int) -> np.ndarray:
    from PIL.TiffImagePlugin import TiffImageFile

    image = TiffImageFile(BytesIO(data))
    names = []
    for number in range(image.n_frames):
        image.seek(number)
        names.append(str(image.tag_v2.get(_PAGE_NAME, "")).strip("\0 "))
        if part in (str(number + 1), names[-1]):
            refuse_huge(*image.size, max_pixels)
            return np.asarray(image.convert("RGBA" if "A" in image.getbands() or image.mode == "P" else "L"))
    listed = ", ".join(f"{number} {name}".strip() for number, name in enumerate(names, 1))
    raise InputError(f"it has no page {part}. It has {listed}.")


def _label(data: bytes, part: str, max_pixels: int) -> np.ndarray:
    from PIL import Image

    if not part.isdecimal():
        raise InputError(f'"{part}" is no label: give a whole number after #.')
    with Image.open(BytesIO(data)) as image:
        refuse_huge(*image.size, max_pixels)
        if image.mode not in _LABELS:
            raise InputError(f"it has no labels, but colours ({image.mode}). Save it as grey or with a palette.")
        labels = np.asarray(image)
    mask = labels == int(part)
    if not mask.any():
        known = np.unique(labels)
        raise InputError(f"it has no label {part}. It has {', '.join(map(str, known[:16]))}{' …' * (known.size > 16)}.")
    return mask
