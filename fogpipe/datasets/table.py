"""A table of paths and parameters: the way out for every data set without a reader."""

from __future__ import annotations

import csv
import io
import posixpath
from collections.abc import Iterator, Mapping

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader
from fogpipe.errors import InputError
from fogpipe.io.files import is_url, read_bytes

COLUMNS = ("id", "encoding", "camera", "labels", "sequence", "time")
"""Columns with a meaning of their own."""


@reader("csv")
def table(folder: Folder) -> Iterator[Item]:
    """A table (CSV with a header) that lists images; depth as its column ``encoding`` says.

    A row per image::

        id,image,range_map,encoding,camera,fog.visibility
        street/1,rgb/1.png,depth/1.png,kitti,camera.json,120
        street/2,rgb/2.png,depth/2.npy,metres,camera.json,80

    ``id`` names the outputs. ``encoding``, ``camera``, ``labels`` (paths separated by ``;``), ``sequence`` and ``time``
    are what an item has; a column with a dot sets that parameter of the pipeline; every other column names an input of
    the pipeline and holds a file, or a number. Paths are relative to the table; an empty cell gives nothing.
    """
    try:
        text = read_bytes(folder.root).decode("utf-8-sig")
        rows = list(csv.DictReader(io.StringIO(text), strict=True))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{folder.root}: is not a table in CSV with a header: {error}.") from error
    base = folder.root.rpartition("/")[0]
    for line, row in enumerate(rows, start=2):
        if None in row or None in row.values():
            raise InputError(f"{folder.root}:{line}: has not as many cells as the header.")
        cells = {name.strip(): cell.strip() for name, cell in row.items() if cell.strip()}
        if "id" not in cells:
            raise InputError(f"{folder.root}:{line}: has no id; outputs are named after it.")
        yield _item(cells, base, f"{folder.root}:{line}")


def _item(cells: Mapping[str, str], base: str, where: str) -> Item:
    others = {name: cell for name, cell in cells.items() if name not in COLUMNS}
    labels = [path.strip() for path in cells.get("labels", "").split(";") if path.strip()]
    values = {name: number for name, cell in cells.items() if (number := _number(cell)) is not None and name != "id"}
    if "time" in cells and "time" not in values:
        raise InputError(f'{where}: time is "{cells["time"]}", but it must be a number of seconds.')
    return Item(
        id=cells["id"],
        files={name: _path(base, cell) for name, cell in others.items() if "." not in name},
        encoding=cells.get("encoding"),
        camera=_path(base, cells["camera"]) if "camera" in cells else None,
        labels={path: _path(base, path) for path in labels},
        values=values,
        settings={name: cell for name, cell in others.items() if "." in name},
        sequence=cells.get("sequence"),
    )


def _path(base: str, cell: str) -> str:
    if _number(cell) is not None or is_url(cell) or posixpath.isabs(cell) or not base:
        return cell
    return f"{base}/{cell}"


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None
