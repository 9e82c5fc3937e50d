"""Cityscapes."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder, without_suffix
from fogpipe.datasets.item import Item, reader

KINDS = ("color.png", "instanceIds.png", "labelIds.png", "labelTrainIds.png", "polygons.json")


@reader("cityscapes")
def cityscapes(folder: Folder, *, split: str | None = None, labels: str = "gtFine") -> Iterator[Item]:
    """Cityscapes: stereo disparity d = (v − 1)/256 px, v = 0 unknown, and Z = baseline·fx/d.

    The archives leftImg8bit, disparity, camera and gtFine, unpacked into one folder::

        leftImg8bit/train/aachen/aachen_000000_000019_leftImg8bit.png
        disparity/train/aachen/aachen_000000_000019_disparity.png
        camera/train/aachen/aachen_000000_000019_camera.json
        gtFine/train/aachen/aachen_000000_000019_gtFine_labelIds.png

    The camera file gives baseline and fx. The labels keep their names and places.

    Parameters
    ----------
    split : train, val, test or train_extra; all of them when left out.
    labels : gtFine or gtCoarse.
    """
    wanted = split or r"\w+"
    for path, found in folder.matches(rf"leftImg8bit/(?P<frame>(?:{wanted})/[^/]+/[^/]+)_leftImg8bit\.png"):
        frame = found["frame"]
        yield Item(
            id=frame,
            files={"image": folder.path(path), "range_map": folder.path(f"disparity/{frame}_disparity.png")},
            encoding="cityscapes",
            camera=folder.path(f"camera/{frame}_camera.json"),
            path=without_suffix(path),
            labels=folder.labels(*(f"{labels}/{frame}_{labels}_{kind}" for kind in KINDS)),
        )
