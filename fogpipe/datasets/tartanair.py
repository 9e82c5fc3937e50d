"""TartanAir."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader
from fogpipe.datasets.video import frame

CAMERA = {"fx": 320.0, "fy": 320.0, "cx": 320.0, "cy": 240.0, "width": 640, "height": 480}


@reader("tartanair")
def tartanair(folder: Folder, *, side: str = "left", rate: float = 10.0) -> Iterator[Item]:
    """TartanAir: rendered depth along the optical axis, float32 metres in ``.npy``, Z = v m, sky from 5 km on.

    The archives unpacked into one folder::

        abandonedfactory/Easy/P000/image_left/000000_left.png
        abandonedfactory/Easy/P000/depth_left/000000_left_depth.npy
        abandonedfactory/Easy/P000/seg_left/000000_left_seg.npy

    Parameters
    ----------
    side : left or right.
    rate : frames per second that the trajectories are taken to have; the set does not say.
    """
    for path, found in folder.matches(rf"(?P<clip>(?:.+/)?P\d+)/image_{side}/(?P<frame>\d+)_{side}\.png"):
        clip, number = found["clip"], found["frame"]
        yield Item(
            id=path.removesuffix(".png"),
            files={
                "image": folder.path(path),
                "range_map": folder.path(f"{clip}/depth_{side}/{number}_{side}_depth.npy"),
            },
            encoding="tartanair",
            camera=CAMERA,
            labels=folder.labels(f"{clip}/seg_{side}/{number}_{side}_seg.npy"),
            **frame(f"{clip}/{side}", number, rate),
        )
