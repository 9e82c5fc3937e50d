"""A table with a row for each output: ``manifest.csv``, and ``manifest.parquet`` where pyarrow is installed."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

from fogpipe.batch.files import Row
from fogpipe.batch.places import Place

COLOUR = ("red", "green", "blue")


def write_manifest(place: Place, rows: Sequence[Row]) -> None:
    """Write the tables; each replaces an older one at once."""
    records = [record(row) for row in rows]
    columns = list(dict.fromkeys(name for entry in records for name in entry))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    place.write_text("manifest.csv", text.getvalue())
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError:
        return
    table = arrow.table({name: _column([entry.get(name) for entry in records]) for name in columns})
    with place.draft() as draft:
        parquet.write_table(table, draft / "manifest.parquet")
        place.publish(draft / "manifest.parquet", "manifest.parquet")


def record(row: Row) -> dict[str, Any]:
    """One row with a column for each file, parameter and number; a colour has three."""
    cells: dict[str, Any] = {"id": row.item, "variant": row.variant, **row.files, **row.settings}
    for name, value in row.numbers.items():
        if isinstance(value, list):
            cells |= {f"{name}_{channel}": part for channel, part in zip(COLOUR, value, strict=False)}
        else:
            cells[name] = value
    cells |= {f"source_{name}": source for name, source in row.sources.items()}
    return cells | {"seed": row.seed, "sha256": row.sha256}


def _column(cells: list[Any]) -> list[Any]:
    """A column of one type: numbers where all are numbers, else text."""
    given = [cell for cell in cells if cell is not None]
    if all(isinstance(cell, (int, float)) and not isinstance(cell, bool) for cell in given):
        return (
            [None if cell is None else float(cell) for cell in cells]
            if any(isinstance(c, float) for c in given)
            else cells
        )
    return [None if cell is None else str(cell) for cell in cells]
