"""Camera files in their forms, and how a camera follows the size of an image."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fogpipe.errors import InputError
from fogpipe.io.camera import CameraFile, camera_from, read_camera

OWN = {"fx": 994.978, "fy": 990.5, "cx": 311.193, "cy": 254.877}
CITYSCAPES = {
    "extrinsic": {"baseline": 0.209313, "pitch": 0.038, "roll": 0.0, "x": 1.7, "y": 0.1, "yaw": -0.019, "z": 1.22},
    "intrinsic": {"fx": 2262.52, "fy": 2265.3, "u0": 1096.98, "v0": 513.137},
}
MIDDLEBURY = """cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]
cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
doffs=31.086
baseline=193.001
width=741
height=500
ndisp=70
isint=0
"""
KITTI = """calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.950000e-02
S_rect_02: 1.242000e+03 3.750000e+02
P_rect_02: 7.215377e+02 0 6.095593e+02 4.485728e+01 0 7.215377e+02 1.728540e+02 2.163791e-01 0 0 1 2.7e-03
"""


def written(tmp_path, content, name="camera.json"):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_own_form(tmp_path):
    camera = read_camera(written(tmp_path, OWN | {"baseline": 0.12, "doffs": 3, "width": 741, "height": 500}))
    np.testing.assert_array_equal(camera.matrix, [[994.978, 0, 311.193], [0, 990.5, 254.877], [0, 0, 1]])
    assert camera.matrix.dtype == np.float64
    assert (camera.baseline, camera.doffs, camera.size) == (0.12, 3.0, (741, 500))


def test_own_form_needs_no_more_than_four_numbers(tmp_path):
    camera = read_camera(written(tmp_path, OWN))
    assert (camera.baseline, camera.doffs, camera.size) == (None, None, None)


def test_cityscapes_names_its_centre_u0_v0(tmp_path):
    camera = read_camera(written(tmp_path, CITYSCAPES))
    np.testing.assert_array_equal(camera.matrix, [[2262.52, 0, 1096.98], [0, 2265.3, 513.137], [0, 0, 1]])
    assert camera.baseline == 0.209313


def test_synscapes_holds_its_camera_beside_much_else(tmp_path):
    intrinsic = {"fx": 1590.8, "fy": 1592.8, "u0": 771.3, "v0": 360.8, "resx": 1440, "resy": 720}
    content = {"camera": {"intrinsic": intrinsic, "extrinsic": {"z": 1.4}}, "scene": {"sky": "clear"}}
    camera = read_camera(written(tmp_path, content))
    np.testing.assert_array_equal(camera.matrix, [[1590.8, 0, 771.3], [0, 1592.8, 360.8], [0, 0, 1]])
    assert camera.size == (1440, 720)


def test_kitti_object_calibration_gives_its_left_colour_camera(tmp_path):
    text = "P0: 1 0 1 0 0 1 1 0 0 0 1 0\nP2: 721.5 0 609.6 44.9 0 721.5 172.9 0.2 0 0 1 0.003\nR0_rect: 1 0 0\n"
    camera = read_camera(written(tmp_path, text, "000000.txt"))
    np.testing.assert_array_equal(camera.matrix, [[721.5, 0, 609.6], [0, 721.5, 172.9], [0, 0, 1]])


def test_kitti_depth_selection_gives_nine_numbers(tmp_path):
    camera = read_camera(written(tmp_path, "721.5 0 596.6 0 721.5 149.9 0 0 1\n", "image_02.txt"))
    np.testing.assert_array_equal(camera.matrix, [[721.5, 0, 596.6], [0, 721.5, 149.9], [0, 0, 1]])
    with pytest.raises(InputError, match="is not a camera file"):
        read_camera(written(tmp_path, "1 2 3 4 5 6 7 8 9", "numbers.txt"))


def test_a_camera_may_be_given_by_its_numbers():
    np.testing.assert_array_equal(camera_from(OWN).matrix[0], [994.978, 0, 311.193])
    with pytest.raises(InputError, match="desk: fy, cx, cy missing"):
        camera_from({"fx": 3}, "desk")


def test_middlebury_gives_its_baseline_in_millimetres(tmp_path):
    camera = read_camera(written(tmp_path, MIDDLEBURY, "calib.txt"))
    np.testing.assert_array_equal(camera.matrix, [[994.978, 0, 311.193], [0, 994.978, 254.877], [0, 0, 1]])
    assert camera.baseline == pytest.approx(0.193001)
    assert (camera.doffs, camera.size) == (31.086, (741, 500))


def test_kitti_gives_the_left_colour_camera(tmp_path):
    camera = read_camera(written(tmp_path, KITTI, "calib_cam_to_cam.txt"))
    np.testing.assert_array_equal(camera.matrix, [[721.5377, 0, 609.5593], [0, 721.5377, 172.854], [0, 0, 1]])
    assert camera.size == (1242, 375)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"fx": 1, "fy": 1, "cx": 1}, "cy missing"),
        (OWN | {"fx": 0}, "fx is 0, but it must be positive"),
        (OWN | {"fy": -3}, "fy is -3"),
        (OWN | {"cx": float("nan")}, "cx is 'nan', but it must be a finite number"),
        (OWN | {"cx": float("inf")}, "cx is 'inf'"),
        (OWN | {"cx": "wide"}, "cx is 'wide'"),
        (OWN | {"cx": [1]}, "cx is"),
        (OWN | {"cx": True}, "cx is 'True'"),
        (OWN | {"baseline": 0}, "baseline is 0"),
        (OWN | {"width": 640}, "width and height are given together"),
        (OWN | {"basline": 0.1}, "unknown key 'basline'. Did you mean \"baseline\"?"),
        ({"intrinsic": 3}, "'intrinsic' must be a mapping"),
        ({"intrinsic": {"fx": 1, "fy": 1, "u0": 1}}, "cy missing"),
        ("{'fx': 1}", "is not readable JSON"),
        ("{" * 100_000, "is not readable JSON"),
        ("[1, 2, 3]", "is not a camera file"),
        ("cam0=[1 0 1; 0 1 1]", "cam0 must be written as"),
        ("P_rect_02: 1 2 3", "P_rect_02 holds 3 numbers"),
        ("P_rect_02: " + "x " * 12, "fx is 'x'"),
        ("", "is empty"),
        ("#" * (2 << 20), "is too large"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_a_bad_file_is_one_clear_error(tmp_path, content, message):
    path = written(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_camera(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_missing_and_a_binary_file(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_camera(tmp_path / "none.json")
    path = tmp_path / "binary.json"
    path.write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(InputError, match="is not text"):
        read_camera(path)


def test_a_half_size_image_sees_the_same_rays():
    """The rays through the corners of the sensor do not depend on how many pixels it is divided into."""
    full = CameraFile(np.array([[2262.52, 0, 1096.98], [0, 2265.3, 513.137], [0, 0, 1]]), 0.2, 8.0, (2048, 1024), "cam")
    half, notes = full.fitted_to(1024, 512)
    for camera, width, height in ((full, 2048, 1024), (half, 1024, 512)):
        corner = np.linalg.inv(camera.matrix) @ [width - 0.5, height - 0.5, 1]
        np.testing.assert_allclose(corner, [(2047.5 - 1096.98) / 2262.52, (1023.5 - 513.137) / 2265.3, 1], rtol=1e-12)
    assert half.doffs == 4.0
    assert half.size == (1024, 512)
    assert "scaled to 1024×512" in notes[0]


def test_the_stated_size_needs_no_note():
    camera = CameraFile(np.array([[500.0, 0, 900], [0, 500, 9], [0, 0, 1]]), size=(640, 480))
    assert camera.fitted_to(640, 480) == (camera, ())


def test_rounding_of_the_size_is_no_other_aspect():
    camera = CameraFile(np.array([[1000.0, 0, 620], [0, 1000, 187], [0, 0, 1]]), size=(1242, 375))
    assert camera.fitted_to(414, 125)[0].matrix[0, 0] == pytest.approx(1000 / 3)
    assert camera.fitted_to(621, 188)[0].size == (621, 188)


def test_another_aspect_is_refused():
    camera = CameraFile(np.eye(3), size=(2048, 1024), source="cam.json")
    with pytest.raises(InputError, match=r"cam\.json: is for images of 2048×1024 pixels, but this one has 1024×1024"):
        camera.fitted_to(1024, 1024)


def test_without_a_stated_size_the_centre_must_be_inside():
    camera = CameraFile(np.array([[2262.0, 0, 1096], [0, 2265, 513], [0, 0, 1]]), source="cam.json")
    assert camera.fitted_to(2048, 1024) == (camera, ())
    with pytest.raises(InputError, match=r"principal point \(1096, 513\) is outside the image of 1024×512"):
        camera.fitted_to(1024, 512)
