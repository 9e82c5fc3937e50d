"""Any folder in which pictures and depth maps pair up by their names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from fogpipe.datasets.folder import Folder, without_suffix
from fogpipe.datasets.item import Item, reader
from fogpipe.datasets.video import frame
from fogpipe.errors import RequestError
from fogpipe.io.encodings import encoding_named


@reader("folder")
def pairs(
    folder: Folder,
    *,
    image: str = "images/{id}.*",
    depth: str | None = None,
    encoding: str | None = None,
    camera: str | None = None,
    labels: str | None = None,
    rate: float | None = None,
) -> Iterator[Item]:
    """A folder of your own: pictures and depth that pair up by their names.

    ``{id}`` stands for what the names share, folders included, and ``*`` for anything within one name::

        images/street/0001.jpg      --option image='images/{id}.jpg'
        depth/street/0001.png       --option depth='depth/{id}.png' --option encoding=kitti
        labels/street/0001.txt      --option labels='labels/{id}.txt'
        camera.json                 --option camera=camera.json

    Parameters
    ----------
    image : pattern of the pictures.
    depth : pattern of the depth maps; without it the items are pictures only.
    encoding : how depth is written, a name of ``--depth``; each has its formula.
    camera : one camera file for all, or a pattern with ``{id}``.
    labels : patterns of label files, separated by commas.
    rate : frames per second, where each folder is a video whose frames are numbered.
    """
    if depth and encoding is None:
        raise RequestError("the reader folder needs --option encoding=… to read depth; a wrong name lists them all.")
    distance = "relative_depth" if encoding and encoding_named(encoding).quantity == "relative" else "range_map"
    for path, found in folder.matches(_expression(image)):
        name = found["id"]
        files = {"image": folder.path(path)}
        if depth:
            files[distance] = folder.path(next(_filled(folder, depth, name), depth.replace("{id}", name)))
        named = [label for pattern in (labels or "").split(",") if pattern for label in _filled(folder, pattern, name)]
        item = Item(
            id=name,
            files=files,
            encoding=encoding if depth else None,
            camera=camera and folder.path(camera.replace("{id}", name)),
            labels=folder.labels(*named),
            path=without_suffix(path),
        )
        yield replace(item, **frame(name.rpartition("/")[0], name, rate)) if rate else item


def _expression(pattern: str) -> str:
    """The regular expression of a pattern with one ``{id}``."""
    before, marked, after = pattern.partition("{id}")
    if not marked or "{id}" in after:
        raise RequestError(f'the pattern "{pattern}" must hold {{id}} once.')
    return f"{_glob(before)}(?P<id>.+){_glob(after)}"


def _glob(text: str) -> str:
    return "".join("[^/]*" if part == "*" else re.escape(part) for part in re.split(r"(\*)", text))


def _filled(folder: Folder, pattern: str, name: str) -> Iterator[str]:
    """The files that a pattern names for one id."""
    filled = pattern.replace("{id}", name)
    if "*" not in filled:
        yield filled
        return
    for path in sorted(folder.files):
        if re.fullmatch(_glob(filled), path):
            yield path
