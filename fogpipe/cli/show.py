"""``fogpipe show``."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from fogpipe.cli import options as o


def command(
    name: Annotated[str, typer.Argument(metavar="STAGE", help="Name of a stage, as in 'fogpipe stages'.")],
    plugins: o.Plugins = None,
    as_json: o.AsJson = False,
) -> None:
    """Show the card of a stage: ports, parameters, formula, source."""
    from fogpipe.pipeline.cards import card, card_data
    from fogpipe.registry import Registry

    registry = Registry(o.plugin_folders(plugins))
    contract = registry.find(name)
    if as_json:
        typer.echo(json.dumps(card_data(contract, registry.origin(name)), indent=2, ensure_ascii=False))
    else:
        o.print_card(card(contract, registry.origin(name)))
