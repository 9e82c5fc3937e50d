"""Virtual KITTI 2."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader
from fogpipe.datasets.video import frame

CAMERA = {"fx": 725.0087, "fy": 725.0087, "cx": 620.5, "cy": 187.0, "width": 1242, "height": 375}
"""The intrinsics that intrinsic.txt repeats for every frame of both cameras."""
RATE = 10.0


@reader("virtual-kitti2")
def virtual_kitti2(folder: Folder, *, variation: str | None = None, camera: str = "Camera_0") -> Iterator[Item]:
    """Virtual KITTI 2: rendered depth, 16-bit centimetres, Z = v/100 m, 65535 sky.

    The archives as they unpack, each in a folder of its own or all in one::

        vkitti_2.0.3_rgb/Scene01/clone/frames/rgb/Camera_0/rgb_00000.jpg
        vkitti_2.0.3_depth/Scene01/clone/frames/depth/Camera_0/depth_00000.png
        vkitti_2.0.3_classSegmentation/Scene01/clone/frames/classSegmentation/Camera_0/classgt_00000.png

    The scenes are videos of 10 frames per second. Of the variations, ``fog`` has fog in it already.

    Parameters
    ----------
    variation : clone, morning, overcast, sunset, rain, fog, 15-deg-left …; all of them when left out.
    camera : Camera_0 (left) or Camera_1.
    """
    wanted = variation or "[^/]+"
    pictures = (
        rf"(?P<archive>(?:.*rgb[^/]*/)?)(?P<clip>Scene\d+/(?:{wanted}))/frames/rgb/{camera}/rgb_(?P<frame>\d+)\.jpg"
    )
    for path, found in folder.matches(pictures):
        clip, number = found["clip"], found["frame"]

        def sibling(kind: str, name: str, found=found, clip=clip) -> str:
            return f"{found['archive'].replace('rgb', kind)}{clip}/frames/{kind}/{camera}/{name}"

        yield Item(
            id=path.removesuffix(".jpg"),
            files={"image": folder.path(path), "range_map": folder.path(sibling("depth", f"depth_{number}.png"))},
            encoding="virtual-kitti-2",
            camera=CAMERA,
            labels=folder.labels(
                sibling("classSegmentation", f"classgt_{number}.png"),
                sibling("instanceSegmentation", f"instancegt_{number}.png"),
            ),
            **frame(f"{clip}/{camera}", number, RATE),
        )
