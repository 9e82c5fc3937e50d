"""A picture means the same inside, whatever it was outside; what cannot be one is refused in one clear sentence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.errors import InputError, OutputError
from fogpipe.io.images import decode_image, encode_image, picture_from_array, read_image, write_image
from fogpipe.kernels.srgb import linear_from_srgb, srgb_from_linear

SIZES = st.tuples(st.integers(1, 9), st.integers(1, 9))
COLORS = ("linear", "srgb")


def pixels_of(seed: int, height: int = 6, width: int = 7) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3), np.float32)


# Round trips

QUANTISED = [(".png", 8), (".png", 16), (".tif", 8), (".tif", 16), (".tiff", 8), (".webp", 8)]


@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize(("suffix", "bits"), QUANTISED)
@settings(deadline=None, max_examples=20)
@given(data=st.data())
def test_integer_formats_lose_half_a_level_and_no_more(suffix, bits, color, data):
    height, width = data.draw(SIZES)
    display = data.draw(hnp.arrays(np.float32, (height, width, 3), elements=st.floats(-0.5, 1.5, width=32)))
    alpha = data.draw(st.none() | hnp.arrays(np.float32, (height, width), elements=st.floats(0, 1, width=32)))
    pixels = linear_from_srgb(display) if color == "linear" else display

    picture = decode_image(encode_image(pixels, suffix, color=color, alpha=alpha, bits=bits), color=color)

    back = srgb_from_linear(picture.pixels) if color == "linear" else picture.pixels
    half_a_level = 0.5 / (2**bits - 1) + 1e-6  # the second term: roundings to float32 on the way
    np.testing.assert_allclose(back, np.clip(display, 0, 1), atol=half_a_level)
    if alpha is None:
        assert picture.alpha is None
    else:
        np.testing.assert_allclose(picture.alpha, alpha, atol=half_a_level)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("color", COLORS)
def test_every_level_of_colour_and_alpha_survives_reading_and_writing(suffix, bits, color):
    levels = np.arange(2**bits).astype(np.uint8 if bits == 8 else np.uint16).reshape(2 ** (bits // 2), -1)
    rgba = np.dstack([levels, levels[::-1], levels[:, ::-1], levels.T])
    picture = picture_from_array(rgba, color=color)
    data = encode_image(picture.pixels, suffix, color=color, alpha=picture.alpha, bits=bits)
    again = decode_image(data, color=color)
    np.testing.assert_array_equal(again.pixels, picture.pixels)
    np.testing.assert_array_equal(again.alpha, picture.alpha)
    assert f"{bits}-bit colour with alpha" in again.description


@pytest.mark.parametrize(("suffix", "bits"), [(".exr", 32), (".tif", 32), (".npy", None)])
@settings(deadline=None, max_examples=20)
@given(data=st.data())
def test_float_formats_keep_every_bit(suffix, bits, data):
    shape = (*data.draw(SIZES), 3)
    pixels = data.draw(hnp.arrays(np.float32, shape, elements=st.floats(-(2.0**100), 2.0**100, width=32)))
    alpha = data.draw(st.none() | hnp.arrays(np.float32, shape[:2], elements=st.sampled_from([0.0, 1.0])))
    picture = decode_image(encode_image(pixels, suffix, alpha=alpha, bits=bits))
    if suffix == ".exr" and alpha is not None:  # OpenEXR multiplies colour by alpha, and nothing is left of it
        pixels = pixels * alpha[..., np.newaxis]
    np.testing.assert_array_equal(picture.pixels, pixels)
    assert (alpha is None) == (picture.alpha is None)
    if alpha is not None:
        np.testing.assert_array_equal(picture.alpha, alpha)


@pytest.mark.parametrize(("suffix", "bits", "relative"), [(".exr", 16, 2**-11), (".hdr", None, 2**-7)])
@settings(deadline=None, max_examples=20)
@given(data=st.data())
def test_compact_float_formats_lose_what_their_mantissa_lacks(suffix, bits, relative, data):
    shape = (*data.draw(SIZES), 3)
    pixels = data.draw(hnp.arrays(np.float32, shape, elements=st.floats(0, 2.0**15, width=32)))
    back = decode_image(encode_image(pixels, suffix, bits=bits)).pixels
    # Radiance HDR shares the exponent, so the error is relative to the largest channel. Below 2^-14 a half
    # has steps of 2^-24.
    bound = np.maximum(relative * pixels.max(axis=2, keepdims=True), 2.0**-24)
    assert np.all(np.abs(back - pixels) <= bound)


def test_jpeg_is_close_on_smooth_pictures():
    rows, columns = np.mgrid[0:1:32j, 0:1:40j]
    display = np.dstack([rows, columns, (rows + columns) / 2]).astype(np.float32)
    back = decode_image(encode_image(display, ".jpg", color="srgb"), color="srgb").pixels
    # Quality 95 quantises the lowest frequencies in steps of 2 levels; with full-resolution colour 3 levels are safe.
    np.testing.assert_allclose(back, display, atol=3 / 255)


def test_semitransparent_exr_holds_premultiplied_light():
    from fogpipe.io.exr import read_channels

    pixels, alpha = pixels_of(1), np.full((6, 7), 0.25, np.float32)
    data = encode_image(pixels, ".exr", alpha=alpha, bits=32)
    channels, _ = read_channels(data, max_pixels=100)
    np.testing.assert_array_equal(channels["G"], 0.25 * pixels[..., 1])
    np.testing.assert_array_equal(decode_image(data).pixels, pixels)  # times and over 1/4 is exact


@pytest.mark.parametrize("suffix", [".exr", ".tif", ".hdr"])
def test_float_files_hold_linear_light(suffix):
    display = np.full((2, 2, 3), 0.5, np.float32)
    data = encode_image(display, suffix, color="srgb", bits=32)
    linear = decode_image(data, color="linear").pixels
    # Half of display white is 21.4 % of its light; Radiance HDR truncates to 1/128.
    np.testing.assert_allclose(linear, 0.21404, rtol=2**-7)


@pytest.mark.parametrize("suffix", [".exr", ".tif", ".npy"])
def test_float_files_keep_nan_for_whoever_looks_for_it(suffix):
    pixels = pixels_of(2)
    pixels[3, 4, 1] = np.nan
    data = encode_image(pixels, suffix, bits=None if suffix == ".npy" else 32)
    with pytest.raises(InputError, match=r"^x: holds 1 NaN of 126 values, the first at row 3, column 4 "):
        decode_image(data, name="x")


def test_the_default_exr_is_half_unless_a_value_is_too_large():
    assert decode_image(encode_image(pixels_of(1), ".exr")).description.startswith("half")
    bright = pixels_of(1)
    bright[0, 0, 0] = 1e6
    picture = decode_image(encode_image(bright, ".exr"))
    assert picture.description.startswith("float")
    assert picture.pixels[0, 0, 0] == 1e6


def test_what_is_too_large_for_a_float_is_infinite_or_refused():
    pixels = 1e300 * pixels_of(1).astype(np.float64)
    with pytest.raises(OutputError, match="Radiance HDR cannot hold them"):
        encode_image(pixels, ".hdr")
    with pytest.raises(InputError, match="infinite of 126 values"):
        decode_image(encode_image(pixels, ".exr"))


def test_the_same_picture_gives_the_same_bytes():
    for suffix in (".png", ".jpg", ".tif", ".webp", ".exr", ".hdr", ".npy"):
        assert encode_image(pixels_of(3), suffix) == encode_image(pixels_of(3), suffix), suffix


def test_files_and_memory_agree(tmp_path):
    path = tmp_path / "picture.PNG"
    write_image(path, pixels_of(3))
    assert path.read_bytes() == encode_image(pixels_of(3), ".png")
    np.testing.assert_array_equal(read_image(path).pixels, decode_image(path.read_bytes()).pixels)
    assert list(tmp_path.iterdir()) == [path]


def test_the_content_tells_the_format_not_the_name(tmp_path):
    path = tmp_path / "in_truth_a_png.jpg"
    path.write_bytes(encode_image(pixels_of(3), ".png"))
    assert "PNG" in read_image(path).description


# Arrays


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_arrays_of_integers_are_display_values(dtype):
    levels = np.full((2, 3, 3), np.iinfo(dtype).max // 2, dtype)
    share = levels[0, 0, 0] / np.iinfo(dtype).max
    np.testing.assert_allclose(picture_from_array(levels, color="srgb").pixels, share, rtol=1e-6)  # float32
    linear = picture_from_array(levels, color="linear").pixels
    np.testing.assert_allclose(linear, linear_from_srgb(np.array(share)), rtol=1e-6)
    assert linear.dtype == np.float32


@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize(("dtype", "inside"), [(np.float16, np.float32), (np.float32, np.float32), ("f8", "f8")])
def test_arrays_of_floats_are_working_values(dtype, inside, color):
    values = (10 * pixels_of(4) - 2).astype(dtype)
    picture = picture_from_array(values, color=color)
    assert picture.pixels.dtype == inside
    np.testing.assert_array_equal(picture.pixels, values)


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 1), (4, 5, 2)])
def test_grey_becomes_three_equal_channels(shape):
    grey = np.random.default_rng(0).random(shape, np.float32)
    picture = picture_from_array(grey)
    assert picture.pixels.shape == (4, 5, 3)
    for channel in range(3):
        np.testing.assert_array_equal(picture.pixels[..., channel], grey.reshape(4, 5, -1)[..., 0])
    assert (picture.alpha is not None) == (shape[2:] == (2,))


def test_alpha_is_a_share_and_never_curved():
    rgba = np.full((1, 1, 4), 51, np.uint8)
    assert picture_from_array(rgba).alpha == pytest.approx(0.2)
    overdone = np.full((1, 1, 4), 1.5, np.float32)
    assert picture_from_array(overdone).alpha == 1


def test_any_layout_of_an_array_will_do():
    levels = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    levels.flags.writeable = False
    for view in (levels[::-1, ::2], levels.transpose(1, 0, 2), levels.astype(">u2")):
        np.testing.assert_array_equal(
            picture_from_array(view).pixels, picture_from_array(np.array(view, view.dtype.newbyteorder("="))).pixels
        )


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((4, 5, 5)), r"shape \(4, 5, 5\)"),
        (np.zeros(7), r"shape \(7,\)"),
        (np.zeros((0, 5, 3)), "is empty"),
        (np.zeros((4, 5), bool), "dtype bool"),
        (np.zeros((4, 5, 3), np.int64), "dtype int64"),
        (np.zeros((4, 5, 3), np.complex64), "dtype complex64"),
        (
            np.array([[[0, np.inf, np.nan]]]),
            "^the array holds 1 NaN and 1 infinite of 3 values, the first at row 0, column 0",
        ),
    ],
)
def test_what_is_no_picture_is_refused(array, message):
    with pytest.raises(InputError, match=message):
        picture_from_array(array)


# Refusals on the way out


@pytest.mark.parametrize(
    ("suffix", "options", "message"),
    [
        (".gif", {}, r'ending "\.gif".*\.png'),
        ("", {}, 'ending ""'),
        (".jpg", {"alpha": np.ones((6, 7), np.float32)}, "JPEG has no room for an alpha channel"),
        (".jpg", {"bits": 16}, "JPEG has no 16 bits per sample. Choose 8"),
        (".npy", {"bits": 16}, "Choose none"),
        (".png", {"alpha": np.ones((2, 2), np.float32)}, r"alpha channel is \(2, 2\)"),
        (".png", {"alpha": np.full((6, 7), np.nan)}, "alpha channel holds NaN"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(tmp_path, suffix, options, message):
    path = tmp_path / f"out{suffix}"
    with pytest.raises(OutputError, match=message) as refusal:
        write_image(path, pixels_of(1), **options)
    assert str(path) in str(refusal.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("suffix", [".png", ".jpg", ".webp", ".hdr"])
def test_formats_without_nan_refuse_it(suffix, value):
    pixels = pixels_of(1)
    pixels[2, 3] = value
    with pytest.raises(
        OutputError, match=r"3 (NaN|infinite) of 126 values, the first at row 2, column 3 .*cannot hold"
    ):
        encode_image(pixels, suffix)


def test_half_refuses_what_is_too_large_for_it():
    with pytest.raises(OutputError, match="65504"):
        encode_image(1e6 * pixels_of(1), ".exr", bits=16)


@pytest.mark.parametrize("pixels", [np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2)), np.zeros((0, 2, 3))])
def test_only_working_values_are_written(pixels):
    with pytest.raises(OutputError, match="floating point"):
        encode_image(pixels, ".png")


def test_a_picture_too_wide_for_its_format_is_refused():
    with pytest.raises(OutputError, match="cannot be encoded as WebP"):
        encode_image(np.zeros((1, 16384, 3), np.float32), ".webp")  # WebP counts to 16383


# Real pictures


def test_real_photographs_survive_a_lossless_round_trip(shared_data: Path):
    for name in ("kitti/rgb.png", "kinect/color.jpg", "hazy/house.jpg"):
        picture = read_image(shared_data / name)
        assert picture.pixels.dtype == np.float32
        assert math.isclose(picture.pixels.max(), 1, rel_tol=1e-6), name  # all three have a saturated pixel
        np.testing.assert_array_equal(decode_image(encode_image(picture.pixels, ".png")).pixels, picture.pixels)


def test_a_grey_picture_that_looks_like_a_depth_map_is_doubted():
    ramp = np.linspace(0, 65535, 4000).astype(np.uint16).reshape(40, 100)
    for mark in (0, 65535):
        codes = np.clip(ramp // 4 + 5000, 5000, 30000).astype(np.uint16)
        codes[:3] = mark
        description = decode_image(_grey_png(codes)).description
        assert f"is this a depth map? 7.5% of it is {mark}" in description
    for photograph in (ramp, np.clip(ramp.astype(int) - 9000, 0, 65535).astype(np.uint16), np.zeros_like(ramp)):
        assert "depth map" not in decode_image(_grey_png(photograph)).description


def _grey_png(levels: np.ndarray) -> bytes:
    import cv2

    return cv2.imencode(".png", levels)[1].tobytes()
