"""Scenes: what a reference gives to a pipeline, and what is wrong with a bad one."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from fogpipe.errors import InputError
from fogpipe.io.scenes import open_scene, scene_from_files

CAMERA = {"fx": 40.0, "fy": 40.0, "cx": 3.5, "cy": 2.5}


@pytest.fixture
def folder(tmp_path):
    """An 8×6 image, depth of 2 m with one unknown pixel, a camera, and a scene file that names them."""
    Image.fromarray(np.full((6, 8, 3), 188, np.uint8)).save(tmp_path / "rgb.png")
    codes = np.full((6, 8), 2000, np.uint16)
    codes[0, 0] = 0
    Image.fromarray(codes).save(tmp_path / "depth.png")
    (tmp_path / "camera.json").write_text(json.dumps(CAMERA))
    return tmp_path


def scene(folder, text):
    (folder / "scene.yaml").write_text(text)
    return open_scene(folder / "scene.yaml")


FULL = "title: A wall\nimage: rgb.png\ndepth: depth.png\nencoding: millimetres\ncamera: camera.json\n"


def test_a_scene_file_gives_image_range_and_camera(folder):
    wall = scene(folder, FULL)
    assert wall.title == "A wall"
    inputs = wall.load("linear")
    assert set(inputs.values) == {"image", "range_map", "camera"}
    # 188 of 255 is 0.5029 in linear light (IEC 61966-2-1).
    assert inputs.values["image"] == pytest.approx(0.5029, abs=1e-4)
    range_map = inputs.values["range_map"]
    assert np.isnan(range_map[0, 0])
    # Planar 2 m at the corner: 2·sqrt(1 + (3.5/40)² + (2.5/40)²).
    assert range_map[5, 7] == pytest.approx(2 * np.sqrt(1 + (3.5**2 + 2.5**2) / 1600))
    np.testing.assert_array_equal(inputs.values["camera"], [[40, 0, 3.5], [0, 40, 2.5], [0, 0, 1]])
    assert inputs.alpha is None
    assert inputs.sources == {
        "image": str(folder / "rgb.png"),
        "range_map": str(folder / "depth.png"),
        "camera": str(folder / "camera.json"),
    }
    assert any("planar depth made radial" in note for note in inputs.notes)


def test_display_values_on_request(folder):
    assert scene(folder, FULL).load("srgb").values["image"] == pytest.approx(188 / 255)


def test_a_camera_may_be_written_into_the_scene(folder):
    inline = FULL.replace("camera.json", str(CAMERA))
    np.testing.assert_array_equal(
        scene(folder, inline).load().values["range_map"], scene(folder, FULL).load().values["range_map"]
    )


def test_a_camera_of_another_size_is_scaled_with_a_note(folder):
    (folder / "camera.json").write_text(json.dumps(CAMERA | {"cx": 7.5, "cy": 5.5, "width": 16, "height": 12}))
    inputs = scene(folder, FULL).load()
    np.testing.assert_array_equal(inputs.values["camera"], [[20, 0, 3.5], [0, 20, 2.5], [0, 0, 1]])
    assert sum("was scaled to 8×6" in note for note in inputs.notes) == 1


def test_without_a_camera_depth_is_taken_for_range_with_a_note(folder):
    inputs = scene(folder, FULL.replace("camera: camera.json\n", "")).load()
    assert inputs.values["range_map"][5, 7] == 2
    assert "camera" not in inputs.values
    assert any("no camera" in note for note in inputs.notes)


def test_relative_depth_is_another_input(folder):
    np.save(folder / "relative.npy", np.linspace(0, 1, 48, dtype=np.float32).reshape(6, 8))
    inputs = scene(folder, "image: rgb.png\ndepth: relative.npy\nencoding: relative\n").load()
    assert set(inputs.values) == {"image", "relative_depth"}


def test_an_image_alone_and_its_alpha(folder):
    pixels = np.full((6, 8, 4), 128, np.uint8)
    Image.fromarray(pixels).save(folder / "rgba.png")
    inputs = scene(folder, "image: rgba.png").load()
    assert set(inputs.values) == {"image"}
    assert inputs.alpha == pytest.approx(128 / 255)


def test_single_files_make_a_scene(folder):
    inputs = scene_from_files(folder / "rgb.png", folder / "depth.png", encoding="millimetres", camera=CAMERA).load()
    assert set(inputs.values) == {"image", "range_map", "camera"}


def test_the_description_of_the_picture_is_noted(folder):
    assert scene(folder, FULL).load().notes[0] == "image: 8-bit colour PNG, sRGB"


def test_what_nobody_wants_is_not_read(folder):
    (folder / "depth.png").unlink()
    inputs = scene(folder, FULL).load("linear", ["image", "camera"])
    assert set(inputs.values) == {"image", "camera"}
    assert not any("depth" in note for note in inputs.notes)


def turned(folder, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(np.full((6, 8, 3), 188, np.uint8)).save(folder / "rgb.png", exif=exif)


@pytest.mark.parametrize("orientation", [2, 3])
def test_a_turned_picture_with_depth_is_refused(folder, orientation):
    turned(folder, orientation)
    with pytest.raises(InputError) as caught:
        scene(folder, FULL).load()
    for part in (f"EXIF orientation {orientation}", "rgb.png", "depth.png", "remove the tag"):
        assert part in str(caught.value)


def test_a_turned_picture_alone_is_not(folder):
    turned(folder, 6)
    inputs = scene(folder, "image: rgb.png\n").load()
    assert inputs.values["image"].shape == (8, 6, 3)
    assert "EXIF orientation 6 applied" in inputs.notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: rgb.png\ndepht: depth.png", "unknown key 'depht'. Did you mean \"depth\"?"),
        ("image: [1]", "image must be text"),
        ("image: rgb.png\ncamera: 3", "camera must be a path or a mapping"),
        ("title: nothing", "gives neither an image nor a depth"),
        ("image: rgb.png\nencoding: kitti", "names the depth encoding kitti but gives no depth"),
        ("image: {", "is not readable YAML"),
        ("- image", "must be a mapping with the keys title, image, depth, encoding, camera"),
        ("image: !!python/object/apply:os.getcwd []", "is not readable YAML"),
    ],
    ids=lambda value: value[:20],
)
def test_a_bad_scene_file_is_refused_when_opened(folder, text, message):
    with pytest.raises(InputError) as caught:
        scene(folder, text)
    assert message in str(caught.value)
    assert "scene.yaml" in str(caught.value)


def test_a_picture_is_no_scene(folder):
    with pytest.raises(InputError, match="Give a picture itself by -i image=FILE"):
        open_scene(folder / "rgb.png")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("rgb.png", "none.png"), "none.png: there is no such file"),
        (("encoding: millimetres\n", ""), "depth.png: name the encoding of its depth"),
        (("camera.json", "{fx: 1, fy: 1}"), "scene.yaml: camera: cx, cy missing"),
        (("camera.json", "{fx: 9, fy: 9, cx: 90, cy: 2}"), "principal point (90, 2) is outside the image of 8×6"),
    ],
    ids=lambda value: value[-1][:20],
)
def test_bad_content_is_refused_when_loaded(folder, change, message):
    bad = scene(folder, FULL.replace(*change))
    with pytest.raises(InputError) as caught:
        bad.load()
    assert message in str(caught.value)


def test_a_missing_scene_file_names_the_samples(tmp_path):
    with pytest.raises(InputError, match=r"there is no such file.*sample:motorcycle, sample:outdoor, sample:rocket"):
        open_scene(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("sample:motorcyle", 'no sample scene "motorcyle". Did you mean "motorcycle"?'),
        ("sample:", 'no sample scene ""'),
        ("sample:rocket:7", "sample:rocket takes no options"),
    ],
)
def test_an_unknown_sample_is_refused_when_opened(reference, message):
    with pytest.raises(InputError) as caught:
        open_scene(reference)
    assert message in str(caught.value)


@pytest.mark.parametrize("option", ["big", "1.5", "-1", "64x", "x64", "8x8", "99999x10"])
def test_a_bad_option_of_a_sample_is_refused(option):
    with pytest.raises(InputError, match="sample:outdoor"):
        open_scene(f"sample:outdoor:{option}").load()


def test_a_sample_is_a_scene_like_any_other():
    inputs = open_scene("sample:motorcycle").load("linear")
    assert set(inputs.values) == {"image", "range_map", "camera"}
    assert set(inputs.sources.values()) == {"sample:motorcycle"}
    assert inputs.values["image"].dtype == np.float32
    assert 0 <= inputs.values["image"].min() < inputs.values["image"].max() <= 1


def test_linear_samples_become_display_values_on_request():
    linear = open_scene("sample:outdoor:64x40").load("linear").values["image"]
    display = open_scene("sample:outdoor:64x40").load("srgb").values["image"]
    low = linear <= 0.0031308
    expected = np.where(low, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    # float32 against float64 of the IEC 61966-2-1 curve, values up to 3.
    np.testing.assert_allclose(display, expected, atol=1e-6)


def test_an_image_only_sample_has_no_range():
    assert set(open_scene("sample:rocket").load().values) == {"image"}
