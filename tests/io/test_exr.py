"""OpenEXR as named channels, in layers, parts and views."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import OpenEXR
import pytest

from fogpipe.errors import InputError
from fogpipe.io.exr import read_channels, write_channels
from fogpipe.io.images import decode_image, read_image


def channel(seed: int, dtype: type = np.float32, shape: tuple[int, int] = (4, 5)) -> np.ndarray:
    return np.random.default_rng(seed).random(shape).astype(dtype)


def colour(prefix: str = "", seed: int = 0) -> dict[str, np.ndarray]:
    return {f"{prefix}{name}": channel(seed + index) for index, name in enumerate("RGB")}


def in_parts(**parts: dict[str, np.ndarray]) -> bytes:
    stream = BytesIO()
    OpenEXR.File([OpenEXR.Part({}, channels, name) for name, channels in parts.items()]).write(stream)
    return stream.getvalue()


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_channels_survive_with_name_and_type(dtype):
    channels = {"Z": channel(1, dtype), "left.R": channel(2, dtype), "Y": channel(3, dtype)[:, ::-1]}
    back, note = read_channels(write_channels(channels), max_pixels=100)
    assert not note
    assert back.keys() == channels.keys()
    for name, expected in channels.items():
        assert back[name].dtype == dtype
        np.testing.assert_array_equal(back[name], expected)


def test_channels_keep_nan_and_infinity():
    values = np.array([[np.nan, np.inf, -np.inf, 0]], np.float32)
    np.testing.assert_array_equal(read_channels(write_channels({"Z": values}), max_pixels=9)[0]["Z"], values)


def test_a_picture_is_r_g_b_whatever_else_there_is():
    data = write_channels({**colour(), "Z": channel(8), "left.R": channel(9)})
    np.testing.assert_array_equal(decode_image(data).pixels, np.dstack([channel(0), channel(1), channel(2)]))


def test_luminance_alone_is_grey():
    picture = decode_image(write_channels({"Y": channel(1), "A": np.full((4, 5), 0.5, np.float32)}))
    np.testing.assert_array_equal(picture.pixels[..., 2], 2 * channel(1))  # stored premultiplied by one half
    assert picture.alpha is not None
    assert (picture.alpha == 0.5).all()


def test_a_layer_is_chosen_by_name(tmp_path):
    path = tmp_path / "two.exr"
    path.write_bytes(write_channels({**colour(), **colour("left.", seed=5)}))
    assert read_image(path).pixels[0, 0, 0] == channel(0)[0, 0]
    left = read_image(f"{path}#left")
    assert left.pixels[0, 0, 0] == channel(5)[0, 0]
    assert "layer left" in left.description


def test_a_part_is_chosen_by_name():
    data = in_parts(first=colour(), second=colour(seed=5))
    assert decode_image(data).pixels[0, 0, 0] == channel(0)[0, 0]
    assert decode_image(data, layer="second").pixels[0, 0, 0] == channel(5)[0, 0]


def test_light_without_opacity_is_kept():
    glow = {**{name: np.full((1, 1), 3, np.float32) for name in "RGB"}, "A": np.zeros((1, 1), np.float32)}
    picture = decode_image(write_channels(glow))
    np.testing.assert_array_equal(picture.pixels, 3)
    assert picture.alpha is not None
    assert picture.alpha == 0


def test_other_primaries_are_mentioned():
    stream = BytesIO()
    aces = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
    OpenEXR.File({"chromaticities": aces, "type": OpenEXR.scanlineimage}, colour()).write(stream)
    assert "taken as Rec. 709" in decode_image(stream.getvalue()).description


@pytest.mark.parametrize(
    ("channels", "layer", "message"),
    [
        ({"Z": channel(0)}, None, r"no channels R, G and B, nor Y\. It has Z\."),
        (colour(), "left", r"no channels left\.R, left\.G and left\.B"),
        ({"R": channel(0), "G": channel(1)}, None, "It has G, R"),
        ({"Y": channel(0), "RY": channel(1), "BY": channel(2)}, None, "luminance and chroma"),
        ({name: np.ones((4, 5), np.uint32) for name in "RGB"}, None, "of integers"),
    ],
)
def test_what_is_no_picture_is_refused(channels, layer, message):
    with pytest.raises(InputError, match=message):
        decode_image(write_channels(channels), layer=layer)


def test_very_many_channels_count_as_many_pixels():
    data = write_channels({f"c{index}": channel(index) for index in range(9)})
    with pytest.raises(InputError, match="4 pixels in 9 channels"):
        read_channels(data, max_pixels=20)


def test_a_real_file_with_two_views(shared_data):
    path = shared_data / "exr" / "beachball.exr"
    right, left = read_image(path), read_image(f"{path}#left")
    assert right.pixels.shape == left.pixels.shape == (876, 911, 3)
    assert right.alpha is not None
    assert not np.array_equal(right.pixels, left.pixels)
    assert "data window only" in right.description
