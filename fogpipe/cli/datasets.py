"""``fogpipe datasets``."""

from __future__ import annotations

import inspect
import json
from typing import Annotated

import typer

from fogpipe.cli import options as o
from fogpipe.errors import InputError


def command(
    name: Annotated[str | None, typer.Argument(help="A reader: show its layout and options.")] = None,
    plugins: o.Plugins = None,
    as_json: o.AsJson = False,
) -> None:
    """List the readers of data sets, or show the layout and the options of one."""
    from fogpipe.datasets.catalogue import find_reader, options_of, readers

    folders = o.plugin_folders(plugins)
    if name:
        from fogpipe.pipeline.cards import reader_card

        o.print_card(reader_card(name, find_reader(name, folders)))
        return
    listed = {}
    for known in readers(folders):
        try:
            listed[known] = find_reader(known, folders)
        except InputError as error:
            typer.echo(str(error), err=True)
    if as_json:
        rows = [
            {"name": key, "summary": _summary(read), "options": [*options_of(read)]} for key, read in listed.items()
        ]
        typer.echo(json.dumps({"datasets": rows}, indent=2, ensure_ascii=False))
        return
    for known, read in listed.items():
        typer.echo(f"{known:<18} {_summary(read)}")


def _summary(read: object) -> str:
    return (inspect.getdoc(read) or "").partition("\n")[0].replace("``", "`")
