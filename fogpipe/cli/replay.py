"""``fogpipe replay``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    record: Annotated[Path, typer.Argument(metavar="RUN.JSON", help="The record that a run wrote.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder for the outputs.")] = None,
) -> None:
    """Run again what a record says, and check that the same bytes come out."""
    from fogpipe.cli.progress import Progress
    from fogpipe.runtime.job import replay_job
    from fogpipe.runtime.record import read_record

    folder = out or record.parent / "replay"
    with Progress(len(read_record(record)["pipeline"]["stages"])) as progress:
        replay_job(record, folder, observer=progress)
    typer.echo(f"the same bytes as in {record}, in {folder}", err=True)
