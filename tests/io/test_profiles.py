"""Embedded profiles: colours of another space arrive as the same colours in sRGB, at every depth."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from PIL import Image, ImageCms

from fogpipe.io.images import decode_image, picture_from_array
from fogpipe.io.profiles import linear_from_profile
from fogpipe.kernels.srgb import srgb_levels_from_linear
from tests.io.handmade import COLOUR, levels, png, saved

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
TAG_TABLE = 128


def with_tags(profile: bytes, **tags: bytes) -> bytes:
    """A profile with some tags replaced; the new contents go to its end."""
    edited = bytearray(profile)
    (count,) = struct.unpack_from(">I", profile, TAG_TABLE)
    for index in range(count):
        place = TAG_TABLE + 4 + 12 * index
        content = tags.get(profile[place : place + 4].decode())
        if content is not None:
            edited += bytes(-len(edited) % 4)
            struct.pack_into(">II", edited, place + 4, len(edited), len(content))
            edited += content
    struct.pack_into(">I", edited, 0, len(edited))
    return bytes(edited)


def fixed(*numbers: float) -> bytes:
    return struct.pack(f">{len(numbers)}i", *(round(65536 * number) for number in numbers))


def curve(kind: int, *numbers: float) -> bytes:
    return b"para" + bytes(4) + struct.pack(">HH", kind, 0) + fixed(*numbers)


def colorant(*numbers: float) -> bytes:
    return b"XYZ " + bytes(4) + fixed(*numbers)


def with_profile(array: np.ndarray, profile: bytes) -> bytes:
    """A 16-bit PNG with a profile."""
    return png(array, 16, COLOUR, iCCP=b"profile\0\0" + zlib.compress(profile))


def all_curves(content: bytes) -> dict[str, bytes]:
    return dict.fromkeys(("rTRC", "gTRC", "bTRC"), content)


# Adobe RGB (1998): its primaries adapted to D50, and a power of 563/256.
ADOBE = with_tags(
    SRGB,
    rXYZ=colorant(0.60974, 0.31111, 0.01947),
    gXYZ=colorant(0.20528, 0.62567, 0.06087),
    bXYZ=colorant(0.14919, 0.06322, 0.74457),
    **all_curves(b"curv" + bytes(4) + struct.pack(">IH", 1, 563)),
)
SAMPLED = np.round(65535 * np.linspace(0, 1, 1024) ** 1.8).astype(">u2")
# Black is black in each: LittleCMS would otherwise move it there, as is right for ink.
PROFILES = {
    "Adobe RGB": ADOBE,
    "sampled curve": with_tags(SRGB, **all_curves(b"curv" + bytes(4) + struct.pack(">I", 1024) + SAMPLED.tobytes())),
    "no curve": with_tags(SRGB, **all_curves(b"curv" + bytes(8))),
    "power": with_tags(SRGB, **all_curves(curve(0, 1.8))),
    "power with offset": with_tags(SRGB, **all_curves(curve(1, 2.0, 1.1, -0.1))),
    "power in a pit": with_tags(SRGB, **all_curves(curve(2, 2.0, 0.9, 0.1, -0.01))),
    "line and power": with_tags(SRGB, **all_curves(curve(3, 2.2, 0.95, 0.05, 0.1, 0.05))),
    "line and power on a pedestal": with_tags(SRGB, **all_curves(curve(4, 2.2, 0.9, 0.1, 0.1, 0.05, 0.002, 0.0))),
}


@pytest.mark.parametrize("bits", [8, 16])
def test_an_srgb_profile_changes_nothing(bits):
    array = levels(4, 5, 3, bits=bits)
    data = saved(Image.fromarray(array), format="PNG", icc_profile=SRGB) if bits == 8 else with_profile(array, SRGB)
    picture = decode_image(data)
    np.testing.assert_array_equal(picture.pixels, picture_from_array(array).pixels)
    assert picture.description == f"{bits}-bit colour PNG, sRGB"


def test_adobe_green_is_beyond_srgb_and_adobe_grey_is_grey():
    array = np.array([[[0, 255, 0], [128, 128, 128]]], np.uint8)
    picture = decode_image(saved(Image.fromarray(array), format="PNG", icc_profile=ADOBE), color="srgb")
    assert "converted from" in picture.description
    # Level 128 of a power 2.2 is level 128 of sRGB but for the curves' difference in shape, below one level.
    np.testing.assert_allclose(picture.pixels[0] * 255, [[0, 255, 0], [128, 128, 128]], atol=1.01)


@pytest.mark.parametrize("name", PROFILES)
def test_16_bits_agree_with_littlecms_at_8(name):
    array = levels(16, 16, 3, seed=3)
    by_littlecms = decode_image(saved(Image.fromarray(array), format="PNG", icc_profile=PROFILES[name]))
    deep = decode_image(with_profile(257 * array.astype(np.uint16), PROFILES[name]))
    assert "converted from" in by_littlecms.description
    assert "converted from" in deep.description
    difference = srgb_levels_from_linear(deep.pixels).astype(int) - srgb_levels_from_linear(by_littlecms.pixels)
    # LittleCMS computes 8 bits in fixed point: one level, and more where the sRGB curve is steep near black.
    assert np.percentile(np.abs(difference), 95) <= 1
    assert np.abs(difference).max() <= 6


def test_16_bits_are_not_narrowed_by_a_profile():
    ramp = np.dstack([np.arange(0, 65536, 16, dtype=np.uint16).reshape(64, 64)] * 3)
    linear, _ = linear_from_profile(ramp, ADOBE)
    assert linear is not None
    # The darkest steps of the power 2.2 fall below what float32 can add to a row of the matrix; the rest stay apart.
    assert len(np.unique(linear[..., 1])) > 0.99 * ramp[..., 0].size


def test_alpha_passes_a_profile_untouched():
    array = levels(4, 5, 4)
    picture = decode_image(saved(Image.fromarray(array), format="PNG", icc_profile=ADOBE))
    np.testing.assert_array_equal(picture.alpha, array[..., 3] / np.float32(255))


def test_a_profile_for_grey_is_applied():
    header = bytearray(SRGB[:TAG_TABLE])
    header[16:20] = b"GRAY"
    tags = {b"wtpt": colorant(0.9642, 1, 0.8249), b"kTRC": curve(0, 1.0)}
    table, body = struct.pack(">I", len(tags)), b""
    for name, content in tags.items():
        table += name + struct.pack(">II", TAG_TABLE + 4 + 12 * len(tags) + len(body), len(content))
        body += content + bytes(-len(content) % 4)
    struct.pack_into(">I", header, 0, len(header) + len(table) + len(body))
    grey = np.array([[0, 64, 128, 255]], np.uint8)
    data = saved(Image.fromarray(grey), format="PNG", icc_profile=bytes(header) + table + body)
    linear = decode_image(data).pixels[0, :, 0]
    # A curve of power 1 says that the levels are light itself; half a level of sRGB is at most 0.5 % of white.
    np.testing.assert_allclose(linear, grey[0] / 255, atol=0.005)


@pytest.mark.parametrize("profile", [b"no profile at all", SRGB[:300], b"\0" * 500])
@pytest.mark.parametrize("bits", [8, 16])
def test_a_broken_profile_is_ignored_and_said(profile, bits):
    array = levels(4, 5, 3, bits=bits)
    data = (
        saved(Image.fromarray(array), format="PNG", icc_profile=profile) if bits == 8 else with_profile(array, profile)
    )
    picture = decode_image(data)
    assert "ignored" in picture.description or "is not applied" in picture.description
    np.testing.assert_array_equal(picture.pixels, picture_from_array(array).pixels)


def test_a_profile_for_other_inks_is_ignored_and_said():
    grey_profile_on_colour = bytearray(SRGB)
    grey_profile_on_colour[16:20] = b"CMYK"
    data = saved(Image.fromarray(levels(4, 5, 3)), format="PNG", icc_profile=bytes(grey_profile_on_colour))
    picture = decode_image(data)
    assert "ignored" in picture.description


def test_a_damaged_curve_leaves_16_bits_as_srgb_and_says_so():
    broken = with_tags(SRGB, rXYZ=colorant(0.2, 0.6, 0.06), **all_curves(b"what" + bytes(20)))
    array = levels(4, 5, 3, bits=16)
    picture = decode_image(with_profile(array, broken))
    assert "taken as sRGB" in picture.description
    np.testing.assert_array_equal(picture.pixels, picture_from_array(array).pixels)


def test_jpeg_with_a_profile():
    stream = BytesIO()
    Image.new("RGB", (16, 16), (255, 0, 0)).save(stream, "JPEG", quality=95, icc_profile=ADOBE)
    assert "converted from" in decode_image(stream.getvalue()).description
