"""``fogpipe plan``."""

from __future__ import annotations

import json
from dataclasses import asdict

import typer

from fogpipe.cli import options as o


def command(
    pipeline: o.PipelineName,
    scene: o.Scene = None,
    inputs: o.InputFiles = None,
    depth: o.DepthEncoding = None,
    camera: o.CameraFile = None,
    settings: o.Settings = None,
    to: o.Outputs = None,
    seed: o.Seed = None,
    tolerance: o.Tolerance = None,
    cache: o.CacheFolder = None,
    plugins: o.Plugins = None,
    as_json: o.AsJson = False,
) -> None:
    """Tell what would run, what is pruned, skipped or cached, and why.

    With a scene or inputs, the stages that decide what is skipped are run; nothing is written.
    """
    from fogpipe.runtime.cache import Cache
    from fogpipe.runtime.inputs import inputs_from_request
    from fogpipe.runtime.preview import preview

    plan = o.load_pipeline(pipeline, settings, plugins, seed, tolerance).plan(to)
    given = (
        inputs_from_request(plan, o.make_request(scene, inputs, depth, camera))
        if scene or inputs or depth or camera
        else None
    )
    found = preview(plan, given.values if given else None, Cache(cache, read_only=True) if cache else None)
    if as_json:
        typer.echo(json.dumps(asdict(found), indent=2, ensure_ascii=False))
        return
    width = max((len(row.name) for row in found.rows), default=0)
    for row in found.rows:
        typer.echo(f"{row.name:<{width}}  {row.use:<24} {row.fate:<8} {row.reason}".rstrip())
    if found.decided_by:
        typer.echo(f"run to decide what is skipped: {', '.join(found.decided_by)}", err=True)
