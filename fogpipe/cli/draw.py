"""``fogpipe draw``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from fogpipe.cli import options as o
from fogpipe.errors import RequestError

_SUFFIXES = {".svg": "svg", ".dot": "dot", ".gv": "dot", ".mmd": "mermaid", ".mermaid": "mermaid"}


def command(
    pipeline: o.PipelineName,
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="FILE", help=".svg, .dot or .mmd file.")] = None,
    form: Annotated[str | None, typer.Option("--format", help="svg, dot or mermaid.")] = None,
    settings: o.Settings = None,
    plugins: o.Plugins = None,
) -> None:
    """Draw a pipeline, with the kind of value on every edge."""
    from fogpipe.io.atomic import atomic_write_text
    from fogpipe.pipeline.draw import draw

    chosen = form or (_SUFFIXES.get(out.suffix) if out else "svg")
    if chosen not in _SUFFIXES.values():
        what = f"--format {form}" if form else f"the ending of {out}"
        raise RequestError(f"draw: {what} names no format; choose svg, dot or mermaid (.svg, .dot or .mmd).")
    text = draw(o.load_pipeline(pipeline, settings, plugins).graph, cast(Literal["svg", "dot", "mermaid"], chosen))
    if out is None:
        typer.echo(text, nl=False)
        return
    atomic_write_text(out, text)
    typer.echo(f"wrote {out}", err=True)
