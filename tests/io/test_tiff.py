"""TIFF of 16 bits and floats: nothing is narrowed, inverted or turned without being asked for."""

from __future__ import annotations

from io import BytesIO

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from fogpipe.errors import InputError
from fogpipe.io.images import decode_image, picture_from_array
from fogpipe.io.readers import upright


def tiff(samples: np.ndarray, **options: object) -> bytes:
    stream = BytesIO()
    if samples.ndim == 2 or samples.shape[2] == 2:
        options = {"photometric": "minisblack", **options}
    else:
        options = {"photometric": "rgb", **options}
    tifffile.imwrite(stream, samples, metadata=None, **options)
    return stream.getvalue()


def twelve_bits() -> bytes:
    """A grey TIFF of 16 bits whose header is changed to 12."""
    data = bytearray(tiff(np.zeros((2, 4), np.uint16)))
    with tifffile.TiffFile(BytesIO(data)) as file:
        place = file.pages.first.tags["BitsPerSample"].valueoffset
    data[place] = 12
    return bytes(data)


def deep(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 65536, shape).astype(np.uint16)


@pytest.mark.parametrize("byteorder", ["<", ">"])
@pytest.mark.parametrize(
    ("shape", "options"),
    [
        ((3, 5), {}),
        ((3, 5, 2), {"planarconfig": "contig", "extrasamples": ["unassalpha"]}),
        ((3, 5, 3), {"compression": "zlib", "predictor": True}),
        ((3, 5, 4), {"extrasamples": ["unassalpha"]}),
        ((32, 48, 3), {"tile": (16, 16)}),
    ],
)
def test_16_bits_of_every_kind(shape, options, byteorder):
    array = deep(*shape)
    picture = decode_image(tiff(array, byteorder=byteorder, **options))
    expected = picture_from_array(array)
    np.testing.assert_array_equal(picture.pixels, expected.pixels)
    assert (picture.alpha is None) == (expected.alpha is None)
    assert picture.description.startswith("16-bit")


def test_16_bits_in_planes():
    array = deep(3, 5, 6)
    picture = decode_image(tiff(array, planarconfig="separate"))
    np.testing.assert_array_equal(picture.pixels, picture_from_array(np.moveaxis(array, 0, -1)).pixels)


def test_16_bits_where_zero_is_white():
    array = deep(3, 5)
    picture = decode_image(tiff(array, photometric="miniswhite"))
    np.testing.assert_array_equal(picture.pixels, picture_from_array(65535 - array).pixels)


@pytest.mark.parametrize("compression", [5, 8])  # LZW and ZIP as OpenCV writes them
@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_compression_of_other_programs(dtype, compression):
    array = deep(9, 8, 3).astype(dtype)
    data = cv2.imencode(".tif", array[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, compression])[1].tobytes()
    picture = decode_image(data)
    np.testing.assert_array_equal(picture.pixels, picture_from_array(array).pixels)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_floats_are_linear_light_beyond_white(dtype):
    array = (np.random.default_rng(0).random((3, 5, 3)) * 9 - 1).astype(dtype)
    picture = decode_image(tiff(array))
    np.testing.assert_array_equal(picture.pixels, array.astype(np.float32))
    assert picture.description == "float colour TIFF"


def test_premultiplied_alpha_is_undone():
    straight = np.array([[[40_000, 20_000, 0, 32_768], [9, 9, 9, 0]]], np.uint16)
    premultiplied = straight.copy()
    premultiplied[0, 0, :3] = [20_000, 10_000, 0]
    picture = decode_image(tiff(premultiplied, extrasamples=["assocalpha"]), color="srgb")
    # 32768/65535 is a hair above one half, which costs one level in rounding.
    np.testing.assert_allclose(picture.pixels[0, 0] * 65535, straight[0, 0, :3], atol=1)
    assert picture.alpha[0, 1] == 0


@pytest.mark.parametrize("compression", ["raw", "tiff_lzw"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_applied_once(orientation, compression):
    array = deep(3, 5)
    stream = BytesIO()
    Image.fromarray(array).save(stream, "TIFF", compression=compression, tiffinfo={274: orientation})
    picture = decode_image(stream.getvalue())
    np.testing.assert_array_equal(picture.pixels, picture_from_array(upright(array, orientation)).pixels)
    assert ("EXIF orientation" in picture.description) == (orientation > 1)


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg"])
def test_8_bits_in_any_compression(compression):
    smooth = np.dstack([np.tile(np.arange(0, 240, 5, dtype=np.uint8), (16, 1))] * 3)
    stream = BytesIO()
    Image.fromarray(smooth).save(stream, "TIFF", compression=compression)
    picture = decode_image(stream.getvalue(), color="srgb")
    lost = 8 / 255 if compression == "jpeg" else 1e-7  # JPEG at Pillow's default quality of 75
    np.testing.assert_allclose(picture.pixels, smooth / np.float32(255), atol=lost)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (tiff(deep(3, 5, 3).astype(np.int16)), "3 channels of int16"),
        (tiff(deep(3, 5, 3).astype(np.uint32)), "3 channels of uint32"),
        (tiff(deep(3, 5, 4), photometric="separated"), "4 channels of uint16"),
        (tiff(deep(3, 5).astype(np.float32), photometric="miniswhite"), "1 channels of float32"),
        (twelve_bits(), r"uint16 \(12 bits"),
        (tiff(deep(3, 5, 6), planarconfig="contig", extrasamples=[0, 0, 0]), "6 channels of uint16"),
    ],
)
def test_what_is_not_read_is_named(data, message):
    with pytest.raises(InputError, match=message):
        decode_image(data)
