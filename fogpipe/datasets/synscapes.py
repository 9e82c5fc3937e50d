"""Synscapes."""

from __future__ import annotations

from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader


@reader("synscapes")
def synscapes(folder: Folder) -> Iterator[Item]:
    """Synscapes: rendered depth in the channel Z of OpenEXR, metres along the optical axis, Z = v m.

    As it unpacks, with a number for each picture::

        img/rgb/1.png
        img/depth/1.exr
        img/class/1.png
        img/instance/1.png
        meta/1.json

    ``meta`` gives the camera, and the boxes of the instances.
    """
    for path, found in folder.matches(r"(?P<base>(?:.*/)?)img/rgb/(?P<name>\d+)\.png"):
        base, name = found["base"], found["name"]
        meta = f"{base}meta/{name}.json"
        yield Item(
            id=path.removesuffix(".png"),
            files={"image": folder.path(path), "range_map": folder.path(f"{base}img/depth/{name}.exr")},
            encoding="exr-z",
            camera=folder.path(meta),
            labels=folder.labels(f"{base}img/class/{name}.png", f"{base}img/instance/{name}.png", meta),
        )
