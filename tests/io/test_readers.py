"""Every common variant of every format is read as what it is; hostile files give one clear error and nothing else."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageOps

from fogpipe.errors import InputError
from fogpipe.io.images import Picture, decode_image, encode_image, picture_from_array, read_image
from fogpipe.io.readers import upright
from tests.io.handmade import COLOUR, COLOUR_ALPHA, GREY, GREY_ALPHA, PALETTE, levels, png, png_chunk, saved


def assert_same_picture(picture: Picture, array: np.ndarray) -> None:
    expected = picture_from_array(array)
    np.testing.assert_array_equal(picture.pixels, expected.pixels)
    assert (picture.alpha is None) == (expected.alpha is None)
    if expected.alpha is not None:
        np.testing.assert_array_equal(picture.alpha, expected.alpha)


# PNG


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize(
    ("colour_type", "shape", "name"),
    [
        (GREY, (3, 5), "grey"),
        (GREY_ALPHA, (3, 5, 2), "grey with alpha"),
        (COLOUR, (3, 5, 3), "colour"),
        (COLOUR_ALPHA, (3, 5, 4), "colour with alpha"),
    ],
)
def test_png_of_every_colour_type(bits, colour_type, shape, name):
    array = levels(*shape, bits=bits)
    picture = decode_image(png(array, bits, colour_type))
    assert_same_picture(picture, array)
    assert picture.description.startswith(f"{bits}-bit ")
    assert "PNG, sRGB" in picture.description


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_png_of_few_levels_reaches_from_black_to_white(bits):
    array = np.tile(np.arange(2**bits, dtype=np.uint8), (2, 8 // 2**bits or 1))
    assert_same_picture(decode_image(png(array, bits, GREY)), array * (255 // (2**bits - 1)))


@pytest.mark.parametrize("transparent", [False, True])
def test_png_with_a_palette(transparent):
    palette, opacity = levels(4, 3), np.array([0, 100, 255, 255], np.uint8)
    indices = np.array([[0, 1, 2, 3], [3, 2, 1, 0]], np.uint8)
    chunks = {"PLTE": palette.tobytes()} | ({"tRNS": opacity.tobytes()} if transparent else {})
    picture = decode_image(png(indices, 8, PALETTE, **chunks))
    expected = np.dstack([palette[indices], opacity[indices]]) if transparent else palette[indices]
    assert_same_picture(picture, expected)


@pytest.mark.parametrize("bits", [8, 16])
def test_png_with_one_level_that_is_transparent(bits):
    array = levels(3, 5, bits=bits)
    picture = decode_image(png(array, bits, GREY, tRNS=struct.pack(">H", array[1, 2])))
    np.testing.assert_array_equal(picture.alpha, array != array[1, 2])


@pytest.mark.parametrize("bits", [8, 16])
def test_png_with_one_colour_that_is_transparent(bits):
    array = levels(3, 5, 3, bits=bits)
    picture = decode_image(png(array, bits, COLOUR, tRNS=struct.pack(">3H", *array[1, 2])))
    assert picture.alpha is not None
    assert picture.alpha[1, 2] == 0
    assert picture.alpha.sum() == 14


# JPEG and WebP


def test_jpeg_in_grey():
    smooth = np.tile(np.arange(0, 256, 8, dtype=np.uint8), (8, 1))
    picture = decode_image(saved(Image.fromarray(smooth), format="JPEG", quality=95), color="srgb")
    assert picture.description == "8-bit grey JPEG, sRGB"
    np.testing.assert_allclose(picture.pixels[..., 1], smooth / 255, atol=2 / 255)  # quantised in steps of 2 levels


def test_jpeg_in_cmyk():
    # Ink on paper: no ink is white, all black ink is black, cyan ink takes red away.
    inks = np.zeros((8, 24, 4), np.uint8)
    inks[:, 8:16, 3] = inks[:, 16:, 0] = 255
    picture = decode_image(saved(Image.fromarray(inks, "CMYK"), format="JPEG", quality=95), color="srgb")
    assert "CMYK without a profile" in picture.description
    white, black, cyan = picture.pixels[4, [4, 12, 20]]
    np.testing.assert_allclose(white, 1, atol=0.02)  # JPEG's own error: a few levels
    np.testing.assert_allclose(black, 0, atol=0.02)
    np.testing.assert_allclose(cyan, [0, 1, 1], atol=0.02)


def test_animated_webp_gives_its_first_frame():
    frames = [Image.fromarray(levels(6, 7, 3, seed=seed)) for seed in (0, 1)]
    data = saved(frames[0], format="WEBP", lossless=True, save_all=True, append_images=frames[1:])
    np.testing.assert_array_equal(decode_image(data).pixels, picture_from_array(levels(6, 7, 3)).pixels)


# Orientation


@pytest.mark.parametrize("orientation", range(1, 9))
def test_upright_agrees_with_pillow(orientation):
    array = levels(3, 5, 3)
    image = Image.fromarray(array)
    image.getexif()[0x0112] = orientation
    np.testing.assert_array_equal(upright(array, orientation), np.asarray(ImageOps.exif_transpose(image)))


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("options", [{"format": "PNG"}, {"format": "WEBP", "lossless": True}, {"format": "TIFF"}])
def test_exif_orientation_is_applied_once(options, orientation):
    array = levels(3, 5, 3)
    exif = Image.Exif()
    exif[0x0112] = orientation
    picture = decode_image(saved(Image.fromarray(array), exif=exif, **options))
    assert_same_picture(picture, upright(array, orientation))


@pytest.mark.parametrize("orientation", [1, 6])
def test_exif_orientation_of_16_bits_and_of_jpeg(orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    array = levels(3, 5, 3, bits=16)
    picture = decode_image(png(array, 16, COLOUR, eXIf=exif.tobytes().removeprefix(b"Exif\0\0")))
    assert_same_picture(picture, upright(array, orientation))
    photo = decode_image(saved(Image.new("RGB", (16, 8)), format="JPEG", exif=exif))
    assert photo.pixels.shape[:2] == ((16, 8) if orientation == 6 else (8, 16))
    assert ("EXIF orientation 6 applied" in photo.description) == (orientation == 6)


def test_nonsense_in_exif_is_ignored():
    data = saved(Image.fromarray(levels(3, 5, 3)), format="PNG", exif=b"Exif\0\0MM\0*\0\0\0\x08\0\x05rubbish")
    assert_same_picture(decode_image(data), levels(3, 5, 3))


# Hostile files

SAMPLES = {
    ".png": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".png"),
    "16-bit .png": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".png", bits=16),
    ".jpg": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".jpg"),
    ".tif": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".tif"),
    "float .tif": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".tif", bits=32),
    ".webp": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".webp"),
    ".exr": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".exr"),
    ".hdr": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".hdr"),
    ".npy": encode_image(np.random.default_rng(1).random((9, 8, 3)), ".npy"),
}


@pytest.mark.parametrize("kind", SAMPLES)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_truncated_file_is_refused(kind, share):
    data = SAMPLES[kind]
    with pytest.raises(InputError, match=r"^photo: "):
        decode_image(data[: int(share * len(data))], name="photo")


@pytest.mark.parametrize("kind", SAMPLES)
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_a_damaged_file_gives_a_picture_or_one_error(kind, data):
    damaged = bytearray(SAMPLES[kind])
    for _ in range(data.draw(st.integers(1, 6))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        picture = decode_image(bytes(damaged), name="photo", max_pixels=10_000)
    except InputError as error:
        assert str(error).startswith("photo: ")  # noqa: PT017 (either outcome is right)
    else:
        assert np.isfinite(picture.pixels).all()


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.png: there is no such file"):
        read_image(tmp_path / "nowhere.png")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        read_image(tmp_path)


def test_an_empty_file_is_refused(tmp_path):
    path = tmp_path / "empty.png"
    path.touch()
    with pytest.raises(InputError, match=r"empty\.png: is empty \(0 bytes\)"):
        read_image(path)


def test_a_device_is_refused():
    if not Path("/dev/zero").exists():
        pytest.skip("no devices here")
    with pytest.raises(InputError, match="not a regular file"):
        read_image("/dev/zero")


@pytest.mark.parametrize("data", [b"just some text", b"GIF89a" + bytes(50), b"\x89PNX", b"RIFF" + bytes(50)])
def test_what_is_no_known_picture_is_refused(data):
    with pytest.raises(InputError, match=r"is not a picture that is read here|cannot be decoded as WebP"):
        decode_image(data)


def huge_headers() -> dict[str, bytes]:
    """Small files that promise 60000 × 60000 pixels."""
    size = struct.pack(">II", 60_000, 60_000)
    small = png(levels(1, 1, 3), 8, COLOUR)
    header = png_chunk(b"IHDR", size + small[24:29])
    tiff = bytearray(SAMPLES[".tif"])
    for tag in (256, 257):  # width and height
        place = next(i for i in range(len(tiff)) if tiff[i : i + 2] == struct.pack("<H", tag) and tiff[i + 2] in (3, 4))
        tiff[place + 2 : place + 12] = struct.pack("<HII", 4, 1, 60_000)
    exr = bytearray(SAMPLES[".exr"])
    place = exr.index(b"dataWindow\0box2i\0") + 21
    exr[place : place + 16] = struct.pack("<4i", 0, 0, 59_999, 59_999)
    npy = BytesIO()
    np.lib.format.write_array_header_1_0(npy, {"descr": "|u1", "fortran_order": False, "shape": (60_000, 60_000, 3)})
    return {
        "PNG": small[:8] + header + small[33:],
        "JPEG": SAMPLES[".jpg"].replace(struct.pack(">HH", 9, 8), size[2:4] + size[6:8]),
        "TIFF": bytes(tiff),
        "OpenEXR": bytes(exr),
        "Radiance HDR": SAMPLES[".hdr"].replace(b"-Y 9 +X 8", b"-Y 60000 +X 60000"),
        ".npy": npy.getvalue(),
    }


@pytest.mark.parametrize(("kind", "data"), huge_headers().items())
def test_a_decompression_bomb_is_refused_by_its_header(kind, data):
    with pytest.raises(InputError, match="says that it has 60000×60000 pixels"):
        decode_image(data)


def test_a_webp_bomb_is_refused_by_its_header():
    bomb = saved(Image.new("RGB", (16_000, 40)), format="WEBP", lossless=True)
    assert len(bomb) < 1000
    with pytest.raises(InputError, match="says that it has 16000×40 pixels, and more than 100000 are not read"):
        decode_image(bomb, max_pixels=100_000)


def test_a_chunk_that_claims_gigabytes_is_refused():
    data = SAMPLES["16-bit .png"]
    lying = data[:-12] + struct.pack(">I", 2**31 - 1) + data[-8:]
    with pytest.raises(InputError, match="a chunk is longer than the file"):
        decode_image(lying)


def test_pickled_objects_are_never_read():
    stream = BytesIO()
    np.save(stream, np.array([[{"a": 1}]], dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match="pickled Python objects, which fogpipe never reads"):
        decode_image(stream.getvalue())


def test_an_npy_with_too_little_content_is_refused():
    with pytest.raises(InputError, match="needs more bytes than there are"):
        decode_image(SAMPLES[".npy"][:-1])
