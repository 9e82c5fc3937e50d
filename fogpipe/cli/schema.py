"""``fogpipe schema``."""

from __future__ import annotations

import json

import typer

from fogpipe.cli import options as o


def command(plugins: o.Plugins = None) -> None:
    """Print the JSON Schema of pipeline files, for completion in editors."""
    from fogpipe.pipeline.schema import pipeline_schema
    from fogpipe.registry import Registry

    typer.echo(json.dumps(pipeline_schema(Registry(o.plugin_folders(plugins))), indent=2, ensure_ascii=False))
