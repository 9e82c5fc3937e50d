"""Middlebury stereo 2014."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader


@reader("middlebury2014")
def middlebury2014(folder: Folder) -> Iterator[Item]:
    """Middlebury 2014: structured-light disparity d (PFM, inf unknown), Z = baseline·fx/(d + doffs).

    A folder per scene::

        Motorcycle-perfect/im0.png
        Motorcycle-perfect/disp0.pfm
        Motorcycle-perfect/calib.txt

    ``calib.txt`` gives fx, doffs and the baseline. Of the pair the left picture is taken.
    """
    for path, found in folder.matches(r"(?P<scene>[^/]+)/im0\.png"):
        scene = found["scene"]
        yield Item(
            id=f"{scene}/im0",
            files={"image": folder.path(path), "range_map": folder.path(f"{scene}/disp0.pfm")},
            encoding="middlebury",
            camera=folder.path(f"{scene}/calib.txt"),
        )
