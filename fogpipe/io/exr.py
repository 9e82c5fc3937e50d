"""OpenEXR files as named channels."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np

from fogpipe.errors import InputError

CHANNELS_PER_PIXEL = 8
"""How many channels a file of the largest permitted size may have; smaller ones may have more."""
REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities of red, green, blue and white that OpenEXR means where a header is silent."""


def read_channels(data: bytes, *, max_pixels: int) -> tuple[dict[str, np.ndarray], str]:
    """All channels of an OpenEXR file.

    Parameters
    ----------
    data : the content of the file.
    max_pixels : refuse a larger data window, before any pixel is decoded.

    Returns
    -------
    channels : (H, W) arrays of float16, float32 or uint32 by name, such as ``R``, ``Z`` or ``left.R``. They cover
        the data window. Channels of a further part go by ``part.name``, too.
    note : what else the header says about where the pixels lie, or an empty text.

    Raises
    ------
    InputError
        If the file is too large. Without the name of the file.
    RuntimeError, ValueError
        If it is damaged or cut off.
    """
    import OpenEXR

    with OpenEXR.File(BytesIO(data), separate_channels=True, header_only=True) as file:
        for part in file.parts:
            _refuse_huge(part.header, max_pixels)
    channels: dict[str, np.ndarray] = {}
    with OpenEXR.File(BytesIO(data), separate_channels=True) as file:
        for index, part in enumerate(file.parts):
            for name, channel in part.channels.items():
                pixels = np.array(channel.pixels)
                channels.setdefault(name, pixels)
                if index:
                    channels.setdefault(f"{part.name()}.{name}", pixels)
        return channels, _note(file.header())


def map_channel(channels: Mapping[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    """The channel of a map: the first of these names, else the only one of that name in a layer, else the only one."""
    layers = ([channel for channel in channels if channel.endswith(f".{name}")] for name in names)
    for found in (*([name] for name in names if name in channels), *layers, list(channels)):
        if len(found) == 1:
            return channels[found[0]]
    wanted = " or ".join(names)
    raise InputError(f"has no channel {wanted}. It has {listed(channels)}; save the one you mean on its own.")


def listed(channels: Mapping[str, np.ndarray]) -> str:
    """The names of channels, for a message."""
    names = sorted(channels)
    return ", ".join(names[:20]) + (" …" if len(names) > 20 else "")


def write_channels(channels: Mapping[str, np.ndarray]) -> bytes:
    """An OpenEXR file with one part, ZIP compressed, of (H, W) channels in float16 or float32."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    stream = BytesIO()
    # The binding ignores strides.
    contiguous = {name: np.ascontiguousarray(channel) for name, channel in channels.items()}
    with OpenEXR.File(header, contiguous) as file:
        file.write(stream)
    return stream.getvalue()


def _refuse_huge(header: Mapping[str, Any], max_pixels: int) -> None:
    (left, top), (right, bottom) = (map(int, corner) for corner in header["dataWindow"])
    width, height, count = right - left + 1, bottom - top + 1, len(header["channels"])
    if width * height > max_pixels or width * height * count > CHANNELS_PER_PIXEL * max_pixels:
        raise InputError(
            f"says that it has {width}×{height} pixels in {count} channels, and more than {max_pixels} pixels are"
            f" not read. Make it smaller."
        )


def _note(header: Mapping[str, Any]) -> str:
    notes = []
    if any(
        (data != display).any() for data, display in zip(header["dataWindow"], header["displayWindow"], strict=True)
    ):
        notes.append("data window only")
    if not np.allclose(header.get("chromaticities", REC_709), REC_709, atol=1e-3):
        notes.append("primaries of the header taken as Rec. 709")
    return ", ".join(notes)
