"""``fogpipe batch``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, cast

import typer

from fogpipe.cli import options as o
from fogpipe.errors import RequestError, RunError

if TYPE_CHECKING:
    from fogpipe.batch.job import Labels


def command(
    pipeline: o.PipelineName,
    data: Annotated[str, typer.Option(metavar="NAME:FOLDER", help="The data set; 'fogpipe datasets' lists readers.")],
    out: Annotated[str, typer.Option("-o", "--out", metavar="DIR", help="Folder or URL for the outputs.")] = "out",
    option: Annotated[list[str] | None, typer.Option(metavar="NAME=VALUE", help="Tell the reader.")] = None,
    settings: o.Settings = None,
    sweep: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE,…", help="Make every combination of these values.")
    ] = None,
    sample: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=DISTRIBUTION", help="Draw a value per image: lognormal(150,0.5), uniform(…), …"),
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Draw so often for each image.")] = 1,
    bind: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Set a parameter to a value of the item: time, …")
    ] = None,
    to: Annotated[str | None, typer.Option(metavar="OUTPUT", help="The result; by default the first picture.")] = None,
    also: Annotated[
        list[str] | None, typer.Option(metavar="OUTPUT", help="Write beside it: transmission, range, …, record.")
    ] = None,
    names: Annotated[
        str | None, typer.Option(metavar="TEMPLATE", help="Name of each output, '{path}_fog.png'.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="Names as in foggy-cityscapes or reside.")] = None,
    image_format: Annotated[str | None, typer.Option(help="png, png16, jpg, webp, tif, exr, hdr or npy.")] = None,
    map_format: Annotated[str, typer.Option(help="npy, exr, tif or png (16 bit, for values in 0…1).")] = "npy",
    labels: Annotated[str, typer.Option(help="link, copy or none.")] = "link",
    keep: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN", help="Copy files of the whole set, 'annotations/*.json'.")
    ] = None,
    seed: o.Seed = None,
    tolerance: o.Tolerance = None,
    plugins: o.Plugins = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; by default one for each core.")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of each process; the result is the same.")] = None,
    engine: Annotated[str, typer.Option(help="processes, here, or dask://HOST:PORT.")] = "processes",
    shard: Annotated[str, typer.Option(metavar="I/N", help="Do only the I-th of N parts.")] = "1/1",
    max_failures: Annotated[int | None, typer.Option(min=1, help="Stop when so many items have failed.")] = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Try again what failed earlier.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Tell what would be done, how long and how much.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="A line of JSON for each event, on standard output.")] = False,
) -> None:
    """Run a pipeline over a data set; go on where an earlier run stopped."""
    from fogpipe.batch.engines import cores, require_engine
    from fogpipe.batch.prepare import kept, prepare
    from fogpipe.batch.run import Batch, run_batch
    from fogpipe.batch.variation import Variation
    from fogpipe.cli.batch_progress import BatchProgress, JsonLines, show_estimate
    from fogpipe.datasets.catalogue import open_dataset

    if labels not in ("link", "copy", "none"):
        raise RequestError(f"--labels {labels}: choose link, copy or none.")
    require_engine(engine)
    folders = o.plugin_folders(plugins)
    variation = Variation.parse(sweep or (), sample or (), bind or (), draws)
    found = open_dataset(data, _named(option), folders)
    processes = workers or (1 if engine == "here" else cores())
    job = prepare(
        pipeline,
        found,
        out,
        variation=variation,
        settings=settings or (),
        seed=seed,
        tolerance=tolerance,
        plugins=[str(folder.resolve()) for folder in folders],
        output=to,
        also=also or (),
        names=names,
        preset=preset,
        image_format=image_format,
        map_format=map_format,
        labels=cast("Labels", labels),
        threads=threads or (1 if engine.startswith("dask:") else max(1, cores() // processes)),
    )
    batch = Batch(
        job=job,
        data=found,
        variation=variation,
        keep=kept(found, keep or ()),
        engine=engine,
        workers=processes,
        shard=_shard(shard),
        max_failures=max_failures,
        retry_failed=retry_failed,
    )
    if dry_run:
        estimate = show_estimate(batch, as_json)
        if estimate and estimate.errors:
            tried = len(estimate.errors) + estimate.trials
            raise RunError(f"{len(estimate.errors)} of {tried} items that were tried failed; nothing was kept.")
        return
    with JsonLines() if as_json else BatchProgress() as watcher:
        summary = run_batch(batch, watcher)
    problems = [f"stopped: {summary.stopped}"] if summary.stopped else []
    if summary.failed:
        problems.append(f"{len(summary.failed)} of {summary.items} items failed; --retry-failed tries them again.")
    if problems:
        raise RunError("\n".join(problems))


def _named(options: list[str] | None) -> dict[str, str]:
    named = {}
    for text in options or ():
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise RequestError(f"--option {text}: write it as NAME=VALUE.")
        named[name] = value
    return named


def _shard(text: str) -> tuple[int, int]:
    form = re.fullmatch(r"(\d+)/(\d+)", text)
    if not form or not 1 <= int(form[1]) <= int(form[2]):
        raise RequestError(f"--shard {text}: write it as I/N, from 1/N to N/N.")
    return int(form[1]), int(form[2])
