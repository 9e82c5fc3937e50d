"""A map comes back as the numbers that went out, or the format is refused before anything is written."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.errors import InputError, OutputError
from fogpipe.io.exr import read_channels, write_channels
from fogpipe.io.images import write_image
from fogpipe.io.maps import read_map, write_map
from tests.io.handmade import GREY, levels, png

SHAPES = st.tuples(st.integers(1, 7), st.integers(1, 7))
ANY_FLOAT = st.floats(width=32, allow_nan=True, allow_infinity=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("maps")


@pytest.mark.parametrize("suffix", [".npy", ".exr", ".tif", ".tiff"])
@settings(deadline=None, max_examples=25)
@given(values=hnp.arrays(np.float32, SHAPES, elements=ANY_FLOAT))
def test_floats_come_back_to_the_last_bit_unknown_and_sky_included(folder, suffix, values):
    path = folder / f"map{suffix}"
    write_map(path, values)
    back = read_map(path)
    assert back.dtype == np.float32
    np.testing.assert_array_equal(back, values)


@settings(deadline=None, max_examples=25)
@given(values=hnp.arrays(np.float32, SHAPES, elements=st.floats(0, 1, width=32)))
def test_png_keeps_shares_to_half_a_step(folder, values):
    path = folder / "map.png"
    write_map(path, values)
    np.testing.assert_allclose(read_map(path), values, atol=0.5 / 65535 + 1e-7)  # and a rounding to float32


@pytest.mark.parametrize("suffix", [".npy", ".exr", ".tif", ".png"])
@settings(deadline=None, max_examples=10)
@given(mask=hnp.arrays(bool, SHAPES))
def test_masks_come_back_in_every_format(folder, suffix, mask):
    path = folder / f"mask{suffix}"
    write_map(path, mask)
    back = read_map(path)
    assert back.dtype == (bool if suffix == ".npy" else np.float32)
    np.testing.assert_array_equal(back, mask)


def test_npy_keeps_double_precision_and_layers(tmp_path):
    for array in (np.random.default_rng(0).random((3, 4)), np.zeros((3, 4, 4), np.float32)):
        write_map(tmp_path / "map.npy", array)
        np.testing.assert_array_equal(np.load(tmp_path / "map.npy"), array)


def test_the_channel_of_an_openexr_map_can_be_named(tmp_path):
    values = np.array([[2.5, np.inf, np.nan]], np.float32)
    path = tmp_path / "range.exr"
    write_map(path, values, channel="Z")
    assert list(read_channels(path.read_bytes(), max_pixels=10)[0]) == ["Z"]
    np.testing.assert_array_equal(read_map(path), values)


def test_grey_pictures_are_maps_too(tmp_path):
    path = tmp_path / "grey.png"
    for bits in (8, 16):
        array = levels(3, 5, bits=bits)
        path.write_bytes(png(array, bits, GREY))
        np.testing.assert_array_equal(read_map(path), array / np.float32(2**bits - 1))


def test_openexr_with_several_channels_and_none_of_them_the_map(tmp_path):
    path = tmp_path / "map.exr"
    path.write_bytes(write_channels({name: np.zeros((2, 2), np.float32) for name in ("u", "v")}))
    with pytest.raises(InputError, match=r"map\.exr: has no channel Z or Y\. It has u, v"):
        read_map(path)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_a_picture_in_colours_is_refused(tmp_path, suffix):
    path = tmp_path / f"colours{suffix}"
    write_image(path, np.random.default_rng(0).random((4, 5, 3), np.float32))
    with pytest.raises(InputError, match=r"\(4, 5, 3\), but a map is .* painted in colours has lost its numbers"):
        read_map(path)


def test_other_numbers_are_refused(tmp_path):
    path = tmp_path / "map.npy"
    np.save(path, np.zeros((2, 2), np.int32))
    with pytest.raises(InputError, match="holds int32"):
        read_map(path)


def test_a_damaged_map_is_refused(tmp_path):
    path = tmp_path / "map.exr"
    write_map(path, np.random.default_rng(0).random((8, 9)))
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(InputError, match=r"map\.exr: cannot be decoded as OpenEXR"):
        read_map(path)


def test_a_huge_map_is_refused(tmp_path):
    path = tmp_path / "map.tif"
    write_map(path, np.zeros((8, 9)))
    with pytest.raises(InputError, match="9×8 pixels, and more than 50"):
        read_map(path, max_pixels=50)


@pytest.mark.parametrize(
    ("suffix", "array", "message"),
    [
        (".png", np.array([[2.11, 5.02]]), r"from 2\.11 to 5\.02 with 0 NaN, and PNG holds \[0, 1\] only"),
        (".png", np.array([[0.5, np.nan]]), r"from 0\.5 to 0\.5 with 1 NaN"),
        (".png", np.full((2, 2), np.nan), "with 4 NaN"),
        (".jpg", np.zeros((2, 2)), r'ending "\.jpg".*Choose \.npy'),
        (".exr", np.zeros((2, 2, 4)), r"shape \(2, 2, 4\)"),
        (".tif", np.zeros((0, 2)), r"shape \(0, 2\)"),
        (".npy", np.zeros((2, 2), np.int32), "int32"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(tmp_path, suffix, array, message):
    with pytest.raises(OutputError, match=message):
        write_map(tmp_path / f"map{suffix}", array)
    assert not list(tmp_path.iterdir())
