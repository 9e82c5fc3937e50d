"""``fogpipe check``."""

from __future__ import annotations

import json

import typer

from fogpipe.cli import options as o
from fogpipe.errors import PipelineError


def command(
    pipeline: o.PipelineName,
    settings: o.Settings = None,
    plugins: o.Plugins = None,
    as_json: o.AsJson = False,
) -> None:
    """Find every problem in a pipeline; run nothing."""
    try:
        loaded = o.load_pipeline(pipeline, settings, plugins)
    except PipelineError as error:
        if as_json:
            keys = ("line", "column", "where", "what")
            problems = [{key: getattr(problem, key) for key in keys} for problem in error.problems]
            typer.echo(json.dumps({"source": error.source, "problems": problems}, indent=2, ensure_ascii=False))
        raise
    if as_json:
        typer.echo(json.dumps({"source": loaded.graph.source, "problems": []}, indent=2))
    typer.echo(f"{loaded.graph.source}: {len(loaded.graph.nodes)} stages, no problems.", err=True)
