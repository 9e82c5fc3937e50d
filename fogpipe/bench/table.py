"""What a measurement gives, and how it is written down."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields


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
    scores : other figures by name; each name is a column of the table.
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
    scores: Mapping[str, float] = field(default_factory=dict)


def as_json(rows: Sequence[Row]) -> str:
    """The rows as a JSON list."""
    return json.dumps([asdict(row) for row in rows], indent=2, ensure_ascii=False) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    """The rows as CSV with a header line."""
    text = io.StringIO()
    own = [column.name for column in fields(Row) if column.name != "scores"]
    writer = csv.DictWriter(text, [*own, *score_names(rows)], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) | dict(row.scores) for row in rows)
    return text.getvalue()


def score_names(rows: Sequence[Row]) -> list[str]:
    """The names of all scores, in the order in which they come."""
    return list(dict.fromkeys(name for row in rows for name in row.scores))


def as_line(row: Row) -> str:
    """One row for people, to be told as it comes."""
    ratio = "" if row.ratio is None else f", ratio {row.ratio:.3g}"
    error = "" if row.error is None else f", error {row.error:.2g}"
    return f"{row.case}: {row.way}, {row.seconds * 1e3:.4g} ms{ratio}{error}"


def as_text(rows: Sequence[Row]) -> str:
    """The rows as an aligned table for people."""
    names = score_names(rows)
    cells: list[tuple[str, ...]] = [("case", "way", "ms", "ratio", "error", "largest", *names, "note")]
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:.3g}"
        errors = ("" if e is None else f"{e:.2g}" for e in (row.error, row.largest_error))
        scores = (f"{row.scores[name]:.4g}" if name in row.scores else "" for name in names)
        cells.append((row.case, row.way, f"{row.seconds * 1e3:.4g}", ratio, *errors, *scores, row.note))
    # A column without a figure says nothing here.
    kept = [column for column in zip(*cells, strict=True) if any(column[1:])]
    cells = list(zip(*kept, strict=True))
    widths = [max(map(len, column)) for column in kept]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in cells]
    yardsticks = list(dict.fromkeys(f"{row.case}: ratio to {row.yardstick}" for row in rows if row.yardstick))
    if len({row.yardstick for row in rows if row.yardstick}) == 1:
        yardsticks = [yardsticks[0].partition(": ")[2]]
    return "\n".join([*lines, *yardsticks, ""])
