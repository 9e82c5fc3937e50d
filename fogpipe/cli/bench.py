"""``fogpipe bench``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fogpipe.cli import options as o
from fogpipe.errors import RequestError


def command(
    subject: Annotated[str, typer.Argument(help="What to measure: overhead, haze.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="DIR", help="Write CSV and JSON here.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Smaller frames and fewer repeats.")] = False,
    as_json: o.AsJson = False,
) -> None:
    """Measure speed against error, as ratios to a named yardstick in this process."""
    from fogpipe import bench
    from fogpipe.bench import table
    from fogpipe.io.atomic import atomic_write

    if subject not in bench.SUBJECTS:
        raise RequestError(f'bench: there is no subject "{subject}"; there is: {", ".join(bench.SUBJECTS)}.')
    rows = list(bench.subject(subject)(quick))
    typer.echo(table.as_text(rows), err=True, nl=False)
    if as_json:
        typer.echo(table.as_json(rows), nl=False)
    if out:
        out.mkdir(parents=True, exist_ok=True)
        for suffix, text in (("csv", table.as_csv(rows)), ("json", table.as_json(rows))):
            with atomic_write(out / f"{subject}.{suffix}") as temporary:
                temporary.write_text(text, encoding="utf-8")
