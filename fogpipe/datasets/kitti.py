"""KITTI, in the three layouts in which it is downloaded."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader
from fogpipe.datasets.video import frame

RATE = 10.0
"""Frames per second of the recordings."""


@reader("kitti")
def kitti(folder: Folder, *, depth: str = "depth_2") -> Iterator[Item]:
    """KITTI: lidar depth of the left colour camera, 16-bit codes with Z = v/256 m, 0 unknown.

    Three layouts, whichever are there. The selection of the depth benchmark, complete in itself::

        val_selection_cropped/image/2011_09_26_drive_0002_sync_image_0000000005_image_02.png
        val_selection_cropped/groundtruth_depth/2011_09_26_drive_0002_sync_groundtruth_depth_0000000005_image_02.png
        val_selection_cropped/intrinsics/2011_09_26_drive_0002_sync_image_0000000005_image_02.txt

    The recordings, with the annotated depth beside them (only frames that have it)::

        2011_09_26/2011_09_26_drive_0002_sync/image_02/data/0000000005.png
        2011_09_26/calib_cam_to_cam.txt
        val/2011_09_26_drive_0002_sync/proj_depth/groundtruth/image_02/0000000005.png

    The object detection set, with depth that was completed or estimated, as 16-bit codes in a folder of your own::

        training/image_2/000000.png
        training/depth_2/000000.png
        training/calib/000000.txt
        training/label_2/000000.txt

    Parameters
    ----------
    depth : the folder of the object detection set that holds depth.
    """
    yield from _selection(folder)
    yield from _recordings(folder)
    yield from _objects(folder, depth)


def _selection(folder: Folder) -> Iterator[Item]:
    for path, found in folder.matches(
        r"(?P<base>(?:.*/)?)image/(?P<drive>\w+_sync)_image_(?P<frame>\d+)_image_02\.png"
    ):
        base, drive, number = found["base"], found["drive"], found["frame"]
        measured = f"{base}groundtruth_depth/{drive}_groundtruth_depth_{number}_image_02.png"
        yield Item(
            id=path.removesuffix(".png"),
            files={"image": folder.path(path), "range_map": folder.path(measured)},
            encoding="kitti",
            camera=folder.path(f"{base}intrinsics/{drive}_image_{number}_image_02.txt"),
        )


def _recordings(folder: Folder) -> Iterator[Item]:
    drives = r"(?:.*/)?(?:train|val)/(?P<drive>(?P<day>[\d_]+)_drive_\d+_sync)"
    for path, found in folder.matches(drives + r"/proj_depth/groundtruth/image_02/(?P<frame>\d+)\.png"):
        drive, day, number = found["drive"], found["day"], found["frame"]
        name = f"{day}/{drive}/image_02/data/{number}"
        yield Item(
            id=name,
            files={"image": folder.path(f"{name}.png"), "range_map": folder.path(path)},
            encoding="kitti",
            camera=folder.path(f"{day}/calib_cam_to_cam.txt"),
            **frame(drive, number, RATE),
        )


def _objects(folder: Folder, depth: str) -> Iterator[Item]:
    for path, found in folder.matches(r"(?P<split>training|testing)/image_2/(?P<name>\d+)\.png"):
        split, name = found["split"], found["name"]
        yield Item(
            id=path.removesuffix(".png"),
            files={"image": folder.path(path), "range_map": folder.path(f"{split}/{depth}/{name}.png")},
            encoding="kitti",
            camera=folder.path(f"{split}/calib/{name}.txt"),
            labels=folder.labels(f"{split}/label_2/{name}.txt"),
        )
