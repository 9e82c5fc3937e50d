"""What a measurement gives, and how it is written down."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields


@dataclass(frozen=True)
class Row:
    """One way of doing one thing.

    Attributes
    ----------
    case : what was done.
    way : how it was done.
    seconds : median time.
    ratio : time over that of the yardstick.
    yardstick : what the ratio refers to.
    error : root-mean-square difference from the reference; None where there is none.
    largest_error : largest difference.
    note : what a reader must know.
    measure : what the error is.
    """

    case: str
    way: str
    seconds: float
    ratio: float | None = None
    yardstick: str = ""
    error: float | None = None
    largest_error: float | None = None
    note: str = ""
    measure: str = "RMS error"


def as_json(rows: Sequence[Row]) -> str:
    """The rows as a JSON list."""
    return json.dumps([asdict(row) for row in rows], indent=2, ensure_ascii=False) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    """The rows as CSV with a header line."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()


def as_text(rows: Sequence[Row]) -> str:
    """The rows as an aligned table for people."""
    header = ("case", "way", "ms", "ratio", "error", "largest", "note")
    cells: list[tuple[str, ...]] = [header]
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:.3g}"
        errors = ("" if e is None else f"{e:.2g}" for e in (row.error, row.largest_error))
        cells.append((row.case, row.way, f"{row.seconds * 1e3:.4g}", ratio, *errors, row.note))
    widths = [max(len(line[column]) for line in cells) for column in range(len(header))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in cells]
    yardsticks = dict.fromkeys(f"{row.case}: ratio to {row.yardstick}" for row in rows if row.yardstick)
    return "\n".join([*lines, *yardsticks, ""])
