"""``fogpipe run``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fogpipe.cli import options as o
from fogpipe.errors import ExpectationError, RequestError


def command(
    pipeline: o.PipelineName,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for the outputs.")] = Path("out"),
    scene: o.Scene = None,
    inputs: o.InputFiles = None,
    depth: o.DepthEncoding = None,
    camera: o.CameraFile = None,
    settings: o.Settings = None,
    to: o.Outputs = None,
    seed: o.Seed = None,
    tolerance: o.Tolerance = None,
    cache: o.CacheFolder = None,
    cache_limit: o.CacheLimit = None,
    plugins: o.Plugins = None,
    image_format: Annotated[str, typer.Option(help="png, png16, jpg, webp, tif, exr, hdr or npy.")] = "png",
    map_format: Annotated[str, typer.Option(help="npy, exr, tif or png (16 bit, for values in 0…1).")] = "npy",
    opaque: Annotated[bool, typer.Option("--opaque", help="Leave away the opacity of the input picture.")] = False,
    sheet: Annotated[bool, typer.Option(help="Write the proof sheet, a picture of every value.")] = True,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads to use; the result is the same.")] = None,
    as_json: o.AsJson = False,
) -> None:
    """Run a pipeline and write its outputs, a proof sheet and a record."""
    from fogpipe.cli.progress import Progress, summarise
    from fogpipe.kernels.bands import set_threads
    from fogpipe.runtime.cache import Cache
    from fogpipe.runtime.job import run_job
    from fogpipe.runtime.outputs import Options
    from fogpipe.runtime.record import strict_json

    if threads:
        set_threads(threads)
    loaded = o.load_pipeline(pipeline, settings, plugins, seed, tolerance)
    request = o.make_request(scene, inputs, depth, camera)
    folders = tuple(str(folder.resolve()) for folder in o.plugin_folders(plugins))
    chosen = Options(tuple(to) if to else None, image_format, map_format, folders, sheet, opaque)
    if cache_limit is not None and not cache:
        raise RequestError("--cache-limit: there is no cache to limit; say --cache DIR too.")
    store = Cache(cache, int((4.0 if cache_limit is None else cache_limit) * 2**30)) if cache else None
    with Progress(len(loaded.plan(to).nodes)) as progress:
        record = run_job(loaded, request, chosen, out, workers=threads, cache=store, observer=progress)
    summarise(record, out)
    if as_json:
        typer.echo(strict_json(record), nl=False)
    if record["expectations_missed"]:
        raise ExpectationError("\n".join(record["expectations_missed"]))
