"""Embedded ICC profiles: colours of another space become sRGB."""

from __future__ import annotations

import struct
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from PIL import Image
    from PIL.ImageCms import ImageCmsProfile

SRGB_FROM_XYZ = np.array(
    [
        [3.1338561, -1.6168667, -0.4906146],
        [-0.9787684, 1.9161415, 0.0334540],
        [0.0719453, -0.2289914, 1.4052427],
    ]
)
"""Linear sRGB from XYZ under D50, the white of ICC profiles (Bradford adaptation; Lindbloom, *RGB/XYZ Matrices*)."""

GREY_MODES = ("1", "L", "LA", "La")


def to_srgb(image: Image.Image) -> tuple[Image.Image, str]:
    """An 8-bit picture as sRGB, in mode ``L``, ``LA``, ``RGB`` or ``RGBA``, and what was done for that.

    Colours outside sRGB are clipped (relative colorimetric, black point compensated), by LittleCMS. A profile that
    does not fit the picture is ignored, and the note says so.
    """
    from PIL.ImageCms import PyCMSError

    mode = ("L" if image.mode in GREY_MODES else "RGB") + ("A" if image.has_transparency_data else "")
    data = image.info.get("icc_profile")
    if not data:
        return image.convert(mode), "CMYK without a profile, converted simply" if image.mode == "CMYK" else "sRGB"
    profile = _open(data)
    if profile is None:
        return image.convert(mode), "sRGB, unreadable ICC profile ignored"
    try:
        return _convert(image, mode, profile)
    except PyCMSError:
        return image.convert(mode), f"sRGB, ICC profile {_name(profile)} does not fit and was ignored"


def _convert(image: Image.Image, mode: str, profile: ImageCmsProfile) -> tuple[Image.Image, str]:
    space = _space(profile)
    if space == "RGB" and image.mode != "CMYK" and _is_srgb(profile):
        return image.convert(mode), "sRGB"
    if space == "RGB" and image.mode != "CMYK":
        converted = _transform(image.convert("RGB"), profile)
    elif space == "GRAY" and image.mode in GREY_MODES:
        converted = _transform(image.convert("L"), profile)
    else:
        converted = _transform(image, profile)
    if mode.endswith("A"):
        converted.putalpha(image.convert("RGBA").getchannel("A"))
    return converted, f"converted from {_name(profile)} to sRGB"


def linear_from_profile(samples: np.ndarray, data: bytes) -> tuple[np.ndarray | None, str]:
    """Linear sRGB from 16-bit samples (LittleCMS is bound for 8 bits only), and what was done for that.

    Takes profiles that are three curves and a matrix, such as Adobe RGB, Display P3 and ProPhoto. Colours outside
    sRGB are clipped, as for 8 bits.

    Parameters
    ----------
    samples : (H, W, 3) uint16.
    data : the profile.

    Returns
    -------
    linear : (H, W, 3) float32, or None if the samples are to be taken as sRGB.
    note : what was done.
    """
    from PIL.ImageCms import PyCMSError

    profile = _open(data)
    if profile is None:
        return None, "sRGB, unreadable ICC profile ignored"
    try:
        if _space(profile) == "RGB" and _is_srgb(profile):
            return None, "sRGB"
        matrix = SRGB_FROM_XYZ @ np.transpose([_xyz(data, tag) for tag in (b"rXYZ", b"gXYZ", b"bXYZ")])
        curves = [_curve(_tag(data, tag)) for tag in (b"rTRC", b"gTRC", b"bTRC")]
    except (KeyError, ValueError, struct.error, PyCMSError):
        return None, f"taken as sRGB: ICC profile {_name(profile)} is not applied to 16 bits"
    light = np.stack([curve[samples[..., channel]] for channel, curve in enumerate(curves)], axis=-1)
    linear = np.clip(light @ matrix.T.astype(np.float32), 0, 1)
    return linear, f"converted from {_name(profile)} to sRGB"


def _open(data: bytes) -> ImageCmsProfile | None:
    from PIL import ImageCms

    try:
        return ImageCms.ImageCmsProfile(BytesIO(data))
    except (OSError, ValueError, TypeError):
        return None


def _core(profile: ImageCmsProfile) -> Any:
    """What LittleCMS knows of the profile."""
    return profile.profile


def _space(profile: ImageCmsProfile) -> str:
    """``RGB``, ``GRAY``, ``CMYK`` …"""
    return _core(profile).xcolor_space.strip()


def _name(profile: ImageCmsProfile) -> str:
    name = (_core(profile).profile_description or "").strip()
    return f'"{name[:60]}"' if name else "an unnamed profile"


def _is_srgb(profile: ImageCmsProfile) -> bool:
    """Whether it moves no colour by more than one level; there are dozens of sRGB profiles, by many names."""
    from PIL import Image

    levels = np.linspace(0, 255, 9).astype(np.uint8)
    cube = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(27, 27, 3)
    moved = np.asarray(_transform(Image.fromarray(cube), profile)).astype(int) - cube
    return bool(np.abs(moved).max() <= 1)


def _transform(image: Image.Image, profile: ImageCmsProfile) -> Image.Image:
    """Through LittleCMS, which raises PyCMSError where the profile is for another kind of picture."""
    from PIL import ImageCms

    transform = ImageCms.buildTransform(
        profile,
        ImageCms.createProfile("sRGB"),
        image.mode,
        "RGB",
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
        flags=ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )
    converted = ImageCms.applyTransform(image, transform)
    assert converted is not None  # it is None only where the picture is changed in place
    return converted


def _tag(data: bytes, name: bytes) -> bytes:
    """The content of a tag: the table of tags starts at byte 128 with their number (ICC.1:2022, 7.3)."""
    (count,) = struct.unpack_from(">I", data, 128)
    for index in range(min(count, 200)):
        signature, offset, size = struct.unpack_from(">4sII", data, 132 + 12 * index)
        if signature == name:
            return data[offset : offset + size]
    raise KeyError(name)


def _xyz(data: bytes, name: bytes) -> np.ndarray:
    return np.array(struct.unpack_from(">3i", _tag(data, name), 8)) / 65536


def _curve(tag: bytes) -> np.ndarray:
    """Light for each of the 65536 levels, float32: ``curv`` and ``para`` (ICC.1:2022, 10.6 and 10.18)."""
    level = np.linspace(0, 1, 65536)
    if tag[:4] == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        values = np.frombuffer(tag, ">u2", count, offset=12)
        if count <= 1:
            return (level ** (values[0] / 256 if count else 1)).astype(np.float32)
        return np.interp(level, np.linspace(0, 1, count), values / 65535).astype(np.float32)
    if tag[:4] != b"para":
        raise ValueError("unknown type of curve")
    (kind,) = struct.unpack_from(">H", tag, 8)
    count = (1, 3, 4, 5, 7)[kind] if kind < 5 else 0
    given = np.array(struct.unpack_from(f">{count}i", tag, 12)) / 65536
    return _parametric(kind, given, level).astype(np.float32)


def _parametric(kind: int, given: np.ndarray, level: np.ndarray) -> np.ndarray:
    """The five parametric curves; each is a case of ``(a·x + b)^g + e`` above ``d``, else ``c·x + f``."""
    if kind > 4:
        raise ValueError("unknown parametric curve")
    g, a, b, c, d, e, f = (*given, *(0.0,) * 7)[:7]
    if kind == 0:
        a, b, c, d, e, f = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    elif kind in (1, 2):
        offset = c if kind == 2 else 0.0
        c, d, e, f = 0.0, -b / a, offset, offset
    elif kind == 3:
        e, f = 0.0, 0.0
    power = np.maximum(a * level + b, 0) ** g + e
    return np.where(level >= d, power, c * level + f)
