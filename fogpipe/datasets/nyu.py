"""NYU Depth V2."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader

# The toolbox counts pixels from 1, fogpipe from 0.
CAMERA = {"fx": 518.85790, "fy": 519.46961, "cx": 324.58245, "cy": 252.73617, "width": 640, "height": 480}
"""Intrinsics of the colour camera, from camera_params.m of the toolbox."""


@reader("nyu")
def nyu(folder: Folder) -> Iterator[Item]:
    """NYU Depth V2: Kinect depth registered to the colour camera, 16-bit millimetres, Z = v/1000 m, 0 unknown.

    Synchronised frames as the usual scripts extract them from the recordings, or from the labelled set::

        sync/basement_0001a/rgb_00000.jpg
        sync/basement_0001a/sync_depth_00000.png
        official_splits/test/bathroom/rgb_00045.jpg
        official_splits/test/bathroom/sync_depth_00045.png

    Depth that was saved with 8 bits has lost its metres and is refused. The white frame around the pictures is part
    of them.
    """
    for path, found in folder.matches(r"(?P<scene>(?:.+/)?)rgb_(?P<frame>\d+)\.(?:jpg|png)"):
        measured = f"{found['scene']}sync_depth_{found['frame']}.png"
        yield Item(
            id=path.rpartition(".")[0],
            files={"image": folder.path(path), "range_map": folder.path(measured)},
            encoding="millimetres",
            camera=CAMERA,
        )
