"""``fogpipe stages``."""

from __future__ import annotations

import json

import typer

from fogpipe.cli import options as o


def command(plugins: o.Plugins = None, as_json: o.AsJson = False) -> None:
    """List every stage, and the plugins that could not be imported."""
    from fogpipe.pipeline.cards import markdown
    from fogpipe.registry import Registry

    registry = Registry(o.plugin_folders(plugins))
    found = registry.all()
    if as_json:
        rows = [
            {"name": name, "summary": markdown(stage.summary), "origin": registry.origin(name)}
            for name, stage in found.items()
        ]
        typer.echo(json.dumps({"stages": rows, "failures": registry.failures}, indent=2, ensure_ascii=False))
        return
    width = max((len(name) for name in found), default=0)
    for name, contract in found.items():
        typer.echo(f"{name:<{width}}  {markdown(contract.summary)}")
    for subject, reason in registry.failures.items():
        typer.echo(f"{subject}.* cannot be used: {reason}", err=True)
