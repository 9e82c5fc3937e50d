"""Each reader on a few files in exactly the layout of its set, read as far as metres."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest

from fogpipe.batch.work import request_for
from fogpipe.datasets.catalogue import Dataset, open_dataset
from fogpipe.errors import InputError, RequestError
from fogpipe.io.camera import camera_from
from fogpipe.io.depth import read_depth
from fogpipe.io.exr import write_channels
from fogpipe.runtime.inputs import inputs_from_request

HEIGHT, WIDTH = 6, 8
PICTURE = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)


def put(root: Path, relative: str, content: np.ndarray | str | bytes) -> None:
    """Write a picture, an array, or text, as the ending says."""
    path = root / relative
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, str):
        path.write_text(content)
    elif path.suffix == ".npy":
        np.save(path, content)
    else:
        assert cv2.imwrite(str(path), content)


def codes(value: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), value, np.uint16)


def touch(root: Path, files: Iterable[str]) -> None:
    for file in files:
        put(root, file, "label")


def metres(data: Dataset, name: str) -> float:
    """The depth of the first pixel of an item, decoded as its encoding and camera say."""
    item = data.items[name]
    camera = None if item.camera is None else camera_from(item.camera)
    return float(read_depth(item.files["range_map"], encoding=item.encoding, camera=camera).values[0, 0])


def test_kitti_depth_selection(tmp_path: Path):
    drive = "2011_09_26_drive_0002_sync"
    base = "val_selection_cropped"
    put(tmp_path, f"{base}/image/{drive}_image_0000000005_image_02.png", PICTURE)
    put(tmp_path, f"{base}/groundtruth_depth/{drive}_groundtruth_depth_0000000005_image_02.png", codes(2560))
    put(tmp_path, f"{base}/intrinsics/{drive}_image_0000000005_image_02.txt", "7 0 3.5 0 7 2.5 0 0 1")
    data = open_dataset(f"kitti:{tmp_path}")
    (name,) = data.items
    assert name == f"{base}/image/{drive}_image_0000000005_image_02"
    assert metres(data, name) == 10
    assert camera_from(data.items[name].camera or "").matrix[0].tolist() == [7, 0, 3.5]


def test_kitti_recordings_take_the_frames_that_have_depth(tmp_path: Path):
    drive = "2011_09_26_drive_0002_sync"
    for number in range(3):
        put(tmp_path, f"2011_09_26/{drive}/image_02/data/{number:010}.png", PICTURE)
    put(tmp_path, f"val/{drive}/proj_depth/groundtruth/image_02/0000000002.png", codes(256))
    projection = "P_rect_02: 7 0 3.5 0 0 7 2.5 0 0 0 1 0\nS_rect_02: 8 6\n"
    put(tmp_path, "2011_09_26/calib_cam_to_cam.txt", projection)
    data = open_dataset(f"kitti:{tmp_path}")
    name = f"2011_09_26/{drive}/image_02/data/0000000002"
    assert [*data.items] == [name]
    assert metres(data, name) == 1
    assert data.items[name].values == {"frame": 2, "time": 0.2}
    assert data.items[name].sequence == drive


def test_kitti_objects_with_labels(tmp_path: Path):
    put(tmp_path, "training/image_2/000007.png", PICTURE)
    put(tmp_path, "training/estimated/000007.png", codes(512))
    put(tmp_path, "training/calib/000007.txt", "P0: 0 0\nP2: 7 0 3.5 45 0 7 2.5 0 0 0 1 0\n")
    touch(tmp_path, ["training/label_2/000007.txt"])
    data = open_dataset(f"kitti:{tmp_path}", {"depth": "estimated"})
    name = "training/image_2/000007"
    assert metres(data, name) == 2
    assert camera_from(data.items[name].camera or "").matrix[1].tolist() == [0, 7, 2.5]
    assert data.items[name].labels == {"training/label_2/000007.txt": f"{tmp_path}/training/label_2/000007.txt"}


def test_cityscapes(tmp_path: Path):
    frame = "aachen/aachen_000000_000019"
    for split in ("train", "val"):
        put(tmp_path, f"leftImg8bit/{split}/{frame}_leftImg8bit.png", PICTURE)
        put(tmp_path, f"disparity/{split}/{frame}_disparity.png", codes(256 * 4 + 1))
        camera = {"intrinsic": {"fx": 7, "fy": 7, "u0": 3.5, "v0": 2.5}, "extrinsic": {"baseline": 0.2}}
        put(tmp_path, f"camera/{split}/{frame}_camera.json", json.dumps(camera))
    labels = [f"gtFine/val/{frame}_gtFine_{kind}" for kind in ("labelIds.png", "polygons.json")]
    touch(tmp_path, labels)
    data = open_dataset(f"cityscapes:{tmp_path}", {"split": "val"})
    assert [*data.items] == [f"val/{frame}"]
    assert data.items[f"val/{frame}"].path == f"leftImg8bit/val/{frame}_leftImg8bit"
    assert metres(data, f"val/{frame}") == pytest.approx(0.2 * 7 / 4)  # baseline · fx / ((v − 1)/256)
    assert [*data.items[f"val/{frame}"].labels] == labels
    assert len(open_dataset(f"cityscapes:{tmp_path}").items) == 2


@pytest.mark.parametrize("archive", ["vkitti_2.0.3_{}/", ""])
def test_virtual_kitti_2(tmp_path: Path, archive: str):
    clip = "Scene01/clone/frames"
    put(tmp_path, f"{archive.format('rgb')}{clip}/rgb/Camera_0/rgb_00012.jpg", PICTURE)
    put(tmp_path, f"{archive.format('rgb')}{clip}/rgb/Camera_1/rgb_00012.jpg", PICTURE)
    put(tmp_path, f"{archive.format('depth')}{clip}/depth/Camera_0/depth_00012.png", codes(1234))
    segments = f"{archive.format('classSegmentation')}{clip}/classSegmentation/Camera_0/classgt_00012.png"
    touch(tmp_path, [segments])
    data = open_dataset(f"virtual-kitti2:{tmp_path}", {"variation": "clone"})
    name = f"{archive.format('rgb')}{clip}/rgb/Camera_0/rgb_00012"
    assert [*data.items] == [name]
    assert metres(data, name) == pytest.approx(12.34)
    item = data.items[name]
    assert (item.values["time"], item.sequence) == (1.2, "Scene01/clone/Camera_0")
    assert [*item.labels] == [segments]


def test_middlebury_2014(tmp_path: Path):
    put(tmp_path, "Motorcycle-perfect/im0.png", PICTURE)
    rows = np.full((HEIGHT, WIDTH), 30, "<f4")
    put(tmp_path, "Motorcycle-perfect/disp0.pfm", f"Pf\n{WIDTH} {HEIGHT}\n-1\n".encode() + rows.tobytes())
    calibration = "cam0=[7 0 3.5; 0 7 2.5; 0 0 1]\ndoffs=5\nbaseline=200\nwidth=8\nheight=6\n"
    put(tmp_path, "Motorcycle-perfect/calib.txt", calibration)
    data = open_dataset(f"middlebury2014:{tmp_path}")
    assert metres(data, "Motorcycle-perfect/im0") == pytest.approx(0.2 * 7 / (30 + 5))


def test_nyu(tmp_path: Path):
    put(tmp_path, "official_splits/test/bathroom/rgb_00045.jpg", PICTURE)
    put(tmp_path, "official_splits/test/bathroom/sync_depth_00045.png", codes(2345))
    data = open_dataset(f"nyu:{tmp_path}")
    assert metres(data, "official_splits/test/bathroom/rgb_00045") == pytest.approx(2.345)


def test_tartanair(tmp_path: Path):
    clip = "abandonedfactory/Easy/P000"
    put(tmp_path, f"{clip}/image_left/000003_left.png", PICTURE)
    put(tmp_path, f"{clip}/depth_left/000003_left_depth.npy", np.full((HEIGHT, WIDTH), 7.5, np.float32))
    put(tmp_path, f"{clip}/seg_left/000003_left_seg.npy", np.zeros((HEIGHT, WIDTH), np.uint8))
    data = open_dataset(f"tartanair:{tmp_path}", {"rate": "20"})
    name = f"{clip}/image_left/000003_left"
    assert metres(data, name) == 7.5
    assert data.items[name].values["time"] == 0.15
    assert [*data.items[name].labels] == [f"{clip}/seg_left/000003_left_seg.npy"]


def test_synscapes(tmp_path: Path):
    put(tmp_path, "img/rgb/1.png", PICTURE)
    put(tmp_path, "img/depth/1.exr", write_channels({"Z": np.full((HEIGHT, WIDTH), 20, np.float32)}))
    touch(tmp_path, ["img/class/1.png", "img/instance/1.png"])
    intrinsic = {"fx": 7, "fy": 7, "u0": 3.5, "v0": 2.5, "resx": 8, "resy": 6}
    put(tmp_path, "meta/1.json", json.dumps({"camera": {"intrinsic": intrinsic, "extrinsic": {"z": 1.5}}, "scene": {}}))
    data = open_dataset(f"synscapes:{tmp_path}")
    assert metres(data, "img/rgb/1") == 20
    assert camera_from(data.items["img/rgb/1"].camera or "").size == (8, 6)
    assert [*data.items["img/rgb/1"].labels] == ["img/class/1.png", "img/instance/1.png", "meta/1.json"]


def test_a_folder_of_pairs(tmp_path: Path):
    for number in (1, 2):
        put(tmp_path, f"rgb/street/{number}.jpg", PICTURE)
        put(tmp_path, f"distance/street/{number}_d.png", codes(256 * number))
        touch(tmp_path, [f"yolo/street/{number}.txt", f"voc/street/{number}-a.xml"])
    options = {"image": "rgb/{id}.jpg", "depth": "distance/{id}_d.png", "encoding": "kitti"}
    data = open_dataset(f"folder:{tmp_path}", options | {"labels": "yolo/{id}.txt,voc/{id}-*.xml", "rate": "5"})
    assert [*data.items] == ["street/1", "street/2"]
    assert data.items["street/2"].path == "rgb/street/2"
    assert metres(data, "street/2") == 2
    assert [*data.items["street/2"].labels] == ["yolo/street/2.txt", "voc/street/2-a.xml"]
    assert data.items["street/2"].values["time"] == 0.4
    assert data.items["street/2"].sequence == "street"


def test_a_folder_of_pictures_without_depth(tmp_path: Path):
    put(tmp_path, "images/1.png", PICTURE)
    put(tmp_path, "images/deeper/2.jpg", PICTURE)
    assert {name: [*item.files] for name, item in open_dataset(f"folder:{tmp_path}").items.items()} == {
        "1": ["image"],
        "deeper/2": ["image"],
    }


def test_relative_depth_is_another_input(tmp_path: Path):
    put(tmp_path, "images/1.png", PICTURE)
    data = open_dataset(f"folder:{tmp_path}", {"depth": "depth/{id}.png", "encoding": "relative-16bit"})
    assert data.items["1"].files["relative_depth"] == f"{tmp_path}/depth/1.png"  # there or not


TABLE = """\
id,image,range_map,encoding,camera,labels,sequence,time,fog.visibility,wetness
a/1,rgb/1.png,depth/1.png,kitti,camera.json,l/1.txt;l/1.xml,clip,0.5,120,0.7
2,https://host/2.png,,,,,,,,
"""


def test_a_table(tmp_path: Path):
    put(tmp_path, "set.csv", TABLE)
    data = open_dataset(f"csv:{tmp_path}/set.csv")
    item = data.items["a/1"]
    assert item.files["image"] == f"{tmp_path}/rgb/1.png"
    assert (item.encoding, item.camera) == ("kitti", f"{tmp_path}/camera.json")
    assert item.labels == {"l/1.txt": f"{tmp_path}/l/1.txt", "l/1.xml": f"{tmp_path}/l/1.xml"}
    assert (item.sequence, item.values["time"], item.values["wetness"]) == ("clip", 0.5, 0.7)
    assert item.settings == {"fog.visibility": "120"}
    assert data.items["2"].files == {"image": "https://host/2.png"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image\nx.png\n", r"set\.csv:2: has no id"),
        ("id,image\n1,x.png,y\n", r"set\.csv:2: has not as many cells"),
        ("id,image\n1,x.png\n1,y.png\n", 'two items are called "1"'),
        ("id,time\n1,noon\n", 'time is "noon"'),
        ("id,image\n", "holds no image in the layout of csv"),
        ("id,\xff\n", "is not a table"),
    ],
)
def test_a_table_that_is_none_is_one_clear_error(tmp_path: Path, text: str, message: str):
    put(tmp_path, "set.csv", text.encode("latin-1"))
    with pytest.raises(InputError, match=message):
        open_dataset(f"csv:{tmp_path}/set.csv")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"image": "images/*.png"}, "must hold {id} once"),
        ({"depth": "depth/{id}.png"}, "needs --option encoding"),
        ({"depht": "x"}, 'no such option. Did you mean "depth"'),
        ({"rate": "often"}, "--option rate=often: Input should be a valid number"),
    ],
)
def test_options_that_cannot_be_are_one_clear_error(tmp_path: Path, options: dict[str, str], message: str):
    put(tmp_path, "images/1.png", PICTURE)
    with pytest.raises(RequestError, match=message):
        open_dataset(f"folder:{tmp_path}", options)


def test_a_root_in_another_layout_says_where_the_layout_is_shown(tmp_path: Path):
    put(tmp_path, "photo.png", PICTURE)
    with pytest.raises(InputError, match=r"holds no image in the layout of kitti\. .fogpipe datasets kitti. shows"):
        open_dataset(f"kitti:{tmp_path}")
    with pytest.raises(InputError, match="there is no such folder, or it holds no files"):
        open_dataset(f"kitti:{tmp_path}/nowhere")


def test_folders_that_are_links_are_followed(tmp_path: Path):
    put(tmp_path / "elsewhere", "1.png", PICTURE)
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "images").symlink_to(tmp_path / "elsewhere")
    assert [*open_dataset(f"folder:{tmp_path}/set").items] == ["1"]


def test_a_link_that_leads_back_ends_nothing(tmp_path: Path):
    put(tmp_path, "images/1.png", PICTURE)
    (tmp_path / "images" / "again").symlink_to(tmp_path / "images")
    assert [*open_dataset(f"folder:{tmp_path}").items] == ["1"]


def test_only_what_a_pipeline_needs_is_read(tmp_path: Path, build: Callable):
    put(tmp_path, "images/1.png", PICTURE)
    options = {"depth": "depth/{id}.png", "encoding": "kitti", "camera": "camera.json"}
    item = open_dataset(f"folder:{tmp_path}", options).items["1"]
    graph = build("inputs: {image: Image}\nstages: {same: {use: toy.mean, in: {image: image}}}\noutputs: {o: same}")
    from fogpipe.pipeline.plan import make_plan

    plan = make_plan(graph)
    assert inputs_from_request(plan, request_for(plan, item)).values["image"].shape == (HEIGHT, WIDTH, 3)
