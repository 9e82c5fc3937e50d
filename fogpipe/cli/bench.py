"""``fogpipe bench``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from fogpipe import bench
from fogpipe.cli import options as o
from fogpipe.errors import RequestError


def command(
    subject: Annotated[str, typer.Argument(help=f"What to measure: {', '.join(bench.SUBJECTS)}.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Write CSV, JSON and pictures here.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Smaller frames and fewer repeats.")] = False,
    as_json: o.AsJson = False,
) -> None:
    """Measure speed against error, as ratios to a named yardstick in this process."""
    from fogpipe.bench import chart, table
    from fogpipe.io.atomic import atomic_write_text

    if subject not in bench.SUBJECTS:
        raise RequestError(f'bench: there is no subject "{subject}"; there is: {", ".join(bench.SUBJECTS)}.')
    if out:
        out.mkdir(parents=True, exist_ok=True)
    rows = []
    for row in bench.subject(subject)(quick):
        rows.append(row)
        typer.echo(table.as_line(row), err=True)
        if out:  # a long measurement that is ended early leaves what it has found
            atomic_write_text(out / f"{subject}.csv", table.as_csv(rows))
    typer.echo("\n" + table.as_text(rows), err=True, nl=False)
    if as_json:
        typer.echo(table.as_json(rows), nl=False)
    if out:
        atomic_write_text(out / f"{subject}.json", table.as_json(rows))
        for case in dict.fromkeys(row.case for row in rows):
            # A picture says something where several ways are compared in both time and error.
            if sum(1 for row in rows if row.case == case and row.error and row.ratio) > 1:
                name = "-".join(re.findall(r"[\w.]+", f"{subject} {case}"))
                atomic_write_text(out / f"{name}.svg", chart.time_against_error(rows, case))
        if draw := bench.pictures(subject):
            draw(out, quick, rows)
