"""The door of a run: which files are read, which belong together, and what is refused before anything runs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fogpipe.errors import InputError
from fogpipe.pipeline.graph import Graph
from fogpipe.pipeline.plan import Plan
from fogpipe.ports import known_kinds
from fogpipe.runtime.inputs import Request, inputs_from_arrays, inputs_from_request

KINDS = {"image": "Image", "range_map": "Range", "camera": "Camera", "k": "Coefficient"}
HEIGHT, WIDTH = 6, 8
CAMERA = {"fx": 40.0, "fy": 40.0, "cx": 3.5, "cy": 2.5}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder: a picture, depth of 2 m, a range of 7 m, a camera, and a scene of them."""
    Image.fromarray(np.full((HEIGHT, WIDTH, 3), 188, np.uint8)).save(tmp_path / "rgb.png")
    Image.fromarray(np.full((HEIGHT, WIDTH), 2000, np.uint16)).save(tmp_path / "depth.png")
    np.save(tmp_path / "range.npy", np.full((HEIGHT, WIDTH), 7, np.float32))
    (tmp_path / "camera.json").write_text(json.dumps(CAMERA))
    (tmp_path / "scene.yaml").write_text(
        "image: rgb.png\ndepth: depth.png\nencoding: millimetres\ncamera: camera.json\n"
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plan(*needed: str) -> Plan:
    """A plan that needs these inputs; by default a picture, its range and the camera."""
    kinds = {name: known_kinds()[kind] for name, kind in KINDS.items()}
    graph = Graph("test.yaml", "", "linear", 0, 0.002, kinds, {}, {})
    return Plan(graph, {}, (), {}, needed or ("image", "range_map", "camera"))


def refused(request: Request, *needed: str) -> str:
    with pytest.raises(InputError) as caught:
        inputs_from_request(plan(*needed), request)
    return str(caught.value)


def picture(name: str, orientation: int = 1, alpha: int | None = None) -> str:
    exif = Image.Exif()
    exif[0x0112] = orientation
    colour = [188, 188, 188] + ([] if alpha is None else [alpha])
    Image.fromarray(np.full((HEIGHT, WIDTH, len(colour)), colour, np.uint8)).save(name, exif=exif)
    return name


class TestFiles:
    """Inputs from single files."""

    def test_picture_range_and_camera(self, folder):
        files = {"image": "rgb.png", "range_map": "depth.png"}
        inputs = inputs_from_request(plan(), Request(None, files, "millimetres", "camera.json"))
        # Planar 2 m at the corner: 2·sqrt(1 + (3.5/40)² + (2.5/40)²).
        assert inputs.values["range_map"][5, 7] == pytest.approx(2 * np.sqrt(1 + (3.5**2 + 2.5**2) / 1600))
        np.testing.assert_array_equal(inputs.values["camera"], [[40, 0, 3.5], [0, 40, 2.5], [0, 0, 1]])
        assert inputs.sources == {"image": "rgb.png", "range_map": "depth.png", "camera": "camera.json"}

    def test_a_camera_given_as_an_input_also_makes_depth_radial(self, folder):
        files = {"image": "rgb.png", "range_map": "depth.png", "camera": "camera.json"}
        inputs = inputs_from_request(plan(), Request(None, files, "millimetres"))
        assert "planar depth made radial with camera.json" in inputs.notes
        assert not any("no camera" in note for note in inputs.notes)

    def test_sizes_must_agree(self, folder):
        np.save("range.npy", np.ones((HEIGHT, WIDTH + 1), np.float32))
        message = refused(Request(None, {"image": "rgb.png", "range_map": "range.npy"}, "metres"), "image", "range_map")
        for part in ("rgb.png", "range.npy", "(6, 9)", "same height and width", "Resize the picture"):
            assert part in message

    def test_sizes_in_a_scene_must_agree(self, folder):
        Image.fromarray(np.full((HEIGHT, WIDTH + 1, 3), 188, np.uint8)).save("rgb.png")
        assert "same height and width" in refused(Request("scene.yaml"))


class TestOrientation:
    """A picture that EXIF turned does not say which way up its depth is."""

    @pytest.mark.parametrize("orientation", [2, 3, 6, 8])
    @pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "webp"])
    def test_with_a_distance_it_is_refused(self, folder, orientation, suffix):
        name = picture(f"turned.{suffix}", orientation)
        message = refused(Request(None, {"image": name, "range_map": "range.npy"}, "metres-radial"))
        for part in (
            f"EXIF orientation {orientation}",
            name,
            "range.npy",
            "save the picture upright",
            "remove the tag",
        ):
            assert part in message

    def test_over_a_scene_with_depth_it_is_refused(self, folder):
        message = refused(Request("scene.yaml", {"image": picture("turned.jpg", 3)}))
        assert "turned.jpg has EXIF orientation 3" in message
        assert "depth.png" in message

    def test_alone_it_runs(self, folder):
        inputs = inputs_from_request(plan("image"), Request(None, {"image": picture("turned.jpg", 6)}))
        assert inputs.values["image"].shape == (WIDTH, HEIGHT, 3)

    def test_upright_is_no_orientation(self, folder):
        files = {"image": picture("upright.jpg", 1), "range_map": "range.npy"}
        inputs = inputs_from_request(plan("image", "range_map"), Request(None, files, "metres-radial"))
        assert set(inputs.values) == {"image", "range_map"}


class TestScene:
    """Files replace parts of a scene; the rest is the scene's."""

    def test_the_scenes_own_depth_is_not_read(self, folder):
        (folder / "depth.png").write_bytes(b"damaged")
        inputs = inputs_from_request(plan(), Request("scene.yaml", {"range_map": "range.npy"}, "metres-radial"))
        assert (inputs.values["range_map"] == 7).all()
        assert not any("depth.png" in note for note in inputs.notes)

    def test_the_scenes_camera_is_used(self, folder):
        inputs = inputs_from_request(plan(), Request("scene.yaml", {"range_map": "range.npy"}, "metres"))
        assert inputs.values["range_map"][5, 7] == pytest.approx(7 * np.sqrt(1 + (3.5**2 + 2.5**2) / 1600))
        assert not any("no camera" in note for note in inputs.notes)

    def test_a_camera_on_request_comes_first(self, folder):
        (folder / "wide.json").write_text(json.dumps(CAMERA | {"fx": 10.0, "fy": 10.0}))
        request = Request("scene.yaml", {"range_map": "range.npy"}, "metres", "wide.json")
        inputs = inputs_from_request(plan(), request)
        assert inputs.values["range_map"][5, 7] == pytest.approx(7 * np.sqrt(1 + (3.5**2 + 2.5**2) / 100))
        assert inputs.values["camera"][0, 0] == 10

    def test_a_sample_lends_its_camera_too(self, folder):
        np.save("range.npy", np.full((40, 64), 7, np.float32))
        request = Request("sample:outdoor:64x40", {"range_map": "range.npy"}, "metres")
        inputs = inputs_from_request(plan(), request)
        assert "planar depth made radial with sample:outdoor:64x40" in inputs.notes
        assert not any("no camera" in note or "centre ray" in note for note in inputs.notes)

    def test_an_opaque_picture_does_not_keep_the_old_opacity(self, folder):
        picture("rgb.png", alpha=128)
        assert inputs_from_request(plan(), Request("scene.yaml")).alpha is not None
        request = Request("scene.yaml", {"image": picture("opaque.png")})
        assert inputs_from_request(plan(), request).alpha is None

    @pytest.mark.parametrize("scene", ["scene.yaml", "sample:motorcycle"])
    @pytest.mark.parametrize(
        ("options", "named"),
        [
            ({"depth": "nonsense"}, "--depth nonsense would"),
            ({"camera": "nowhere.json"}, "--camera nowhere.json would"),
            ({"depth": "kitti", "camera": "nowhere.json"}, "--depth kitti and --camera nowhere.json would"),
        ],
    )
    def test_what_would_change_nothing_is_refused(self, folder, scene, options, named):
        message = refused(Request(scene, **options))
        assert named in message
        assert "the scene says both for its own" in message

    def test_nor_is_an_encoding_taken_without_any_depth(self, folder):
        assert "--depth kitti would change nothing" in refused(Request(None, {"image": "rgb.png"}, "kitti"), "image")


class TestRequestAsData:
    """A record finds the files from any folder."""

    def test_paths_are_absolute(self, folder):
        data = Request("scene.yaml", {"image": "rgb.png"}, "kitti", "camera.json").to_data(plan().graph.inputs)
        assert data == {
            "scene": str(folder / "scene.yaml"),
            "files": {"image": str(folder / "rgb.png")},
            "depth": "kitti",
            "camera": str(folder / "camera.json"),
        }

    def test_a_layer_stays_with_its_file(self, folder):
        (folder / "x.exr").touch()
        assert Request(None, {"image": "x.exr#left"}).to_data(plan().graph.inputs)["files"] == {
            "image": f"{folder / 'x.exr'}#left"
        }

    def test_a_number_stays_as_it_is_written(self, folder):
        (folder / "3").touch()
        files = Request(None, {"k": "3", "image": "3"}).to_data(plan().graph.inputs)["files"]
        assert files == {"k": "3", "image": str(folder / "3")}

    def test_a_sample_is_no_path(self, folder):
        assert Request("sample:motorcycle").to_data(plan().graph.inputs)["scene"] == "sample:motorcycle"


def test_levels_that_were_made_floats_are_refused_and_hdr_is_not():
    levels = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3))
    with pytest.raises(InputError, match=r"input image holds whole numbers up to 25. as float32, but 1 is white"):
        inputs_from_arrays(plan("image"), {"image": levels.astype(np.float32)})
    for fine in (levels.astype(np.uint8), levels / 255, levels + 0.5, np.ones((HEIGHT, WIDTH, 3))):
        assert inputs_from_arrays(plan("image"), {"image": fine}).values["image"].shape == (HEIGHT, WIDTH, 3)


def test_whole_numbers_are_no_metres():
    codes = np.random.default_rng(0).integers(500, 4000, (40, 50))
    with pytest.raises(InputError, match=r"input range_map: all values are whole numbers, as millimetres"):
        inputs_from_arrays(plan("range_map"), {"range_map": codes.astype(np.float32)})
    for metres in (codes / 1000, codes + 0.25, np.full((40, 50), 2.0), (codes % 100).astype(float)):
        assert inputs_from_arrays(plan("range_map"), {"range_map": metres}).values["range_map"].shape == (40, 50)


def test_one_file_is_not_picture_and_depth_but_an_exr_is(folder):
    Image.fromarray(np.full((HEIGHT, WIDTH), 2000, np.uint16)).save("d.png")
    both = Request(files={"image": "d.png", "range_map": "./d.png"}, depth="millimetres")
    assert "is given as image and as range_map, but it can only be one of them" in refused(both, "image", "range_map")
    import OpenEXR

    channels = {name: np.full((HEIGHT, WIDTH), 2.5, np.float32) for name in ("R", "G", "B", "Z")}
    with OpenEXR.File({}, channels) as file:
        file.write("render.exr")
    request = Request(files={"image": "render.exr", "range_map": "render.exr"}, depth="exr-z")
    assert set(inputs_from_request(plan("image", "range_map"), request).values) == {"image", "range_map"}
