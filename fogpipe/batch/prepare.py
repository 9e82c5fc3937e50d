"""From what a person asks for to a batch, with everything checked that can be checked before anything runs."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatch

from fogpipe.batch.job import Job, Labels, graph_of, outputs_of, pipeline_of
from fogpipe.batch.names import KNOWN_BEFORE, fields_of, filled, known_values, layout_from
from fogpipe.batch.variation import Variation
from fogpipe.datasets.catalogue import Dataset
from fogpipe.datasets.folder import Folder
from fogpipe.errors import OutputError, RequestError
from fogpipe.io.files import is_url
from fogpipe.pipeline.graph import Graph
from fogpipe.pipeline.plan import make_plan
from fogpipe.pipeline.shipped import read_pipeline
from fogpipe.pipeline.spec import parse_override
from fogpipe.ports import Kind
from fogpipe.runtime.outputs import Options, check_formats

RECORD = "record"


def prepare(
    pipeline: str,
    data: Dataset,
    root: str,
    *,
    variation: Variation = Variation(),  # noqa: B008 (it is frozen)
    settings: Sequence[str] = (),
    seed: int | None = None,
    tolerance: float | None = None,
    plugins: Sequence[str] = (),
    output: str | None = None,
    also: Sequence[str] = (),
    names: str | None = None,
    preset: str | None = None,
    image_format: str | None = None,
    map_format: str = "npy",
    labels: Labels = "link",
    threads: int = 1,
) -> Job:
    """The job that a request describes.

    Parameters
    ----------
    pipeline : name or path.
    root : folder or URL of the outputs.
    seed : of the set; by default the pipeline's.
    output : the output that is the result; by default the first picture of the pipeline.
    also : outputs that are written beside it, and ``record`` for a JSON record.
    names, preset : the layout, see :mod:`fogpipe.batch.names`.
    image_format : by default what the ending of ``names`` says, or png.

    Raises
    ------
    RequestError
        If anything in it cannot be; nothing was run.
    """
    if not is_url(root) and os.path.realpath(root) == os.path.realpath(data.root):
        raise RequestError(f"-o {root}: is the folder of the data set itself. Choose another for the outputs.")
    text, source = read_pipeline(pipeline)
    fixed = {"settings": tuple(settings), "tolerance": tolerance, "plugins": tuple(plugins)}
    graph = pipeline_of(Job(text, source, **fixed)).graph
    picture = output or _first_picture(graph)
    suffix = f".{(image_format or 'png').removesuffix('16')}"
    layout = layout_from(preset, names, variation.differing, variation.draws, suffix)
    named = "" if layout.picture.endswith("{suffix}") else posixpath.splitext(layout.picture)[1].removeprefix(".")
    if image_format and image_format.removesuffix("16") != named:
        raise RequestError(f'--image-format {image_format}: but the names end in ".{named}".')
    job = Job(
        text=text,
        source=source,
        **fixed,
        seed=graph.seed if seed is None else seed,
        picture=picture,
        extras=tuple(dict.fromkeys(name for name in also if name != RECORD)),
        numbers=tuple(name for name, ref in graph.outputs.items() if _is_few(graph.kind(ref))),
        record=RECORD in also,
        layout=layout,
        image_format=image_format or named,
        map_format=map_format,
        labels=labels,
        root=root.rstrip("/"),
        threads=threads,
    )
    _check_outputs(job, graph)
    _refuse_said_twice(job, data, variation)
    _check_first_item(job, data, variation)
    return job


def kept(data: Dataset, patterns: Sequence[str]) -> dict[str, str]:
    """Files of the whole set that match a pattern, such as COCO annotations.

    Raises
    ------
    RequestError
        If a pattern matches nothing.
    """
    folder = Folder(data.root)
    found = {}
    for pattern in patterns:
        matching = [path for path in sorted(folder.files) if fnmatch(path, pattern)]
        if not matching:
            raise RequestError(f"--keep {pattern}: no file of {data.root} matches.")
        found |= {path: folder.path(path) for path in matching}
    return found


def _first_picture(graph: Graph) -> str:
    found = [name for name, ref in graph.outputs.items() if graph.kind(ref).name == "Image"]
    if not found:
        raise RequestError(f"{graph.source} has no output that is an Image; name the result with --to.")
    return found[0]


def _is_few(kind: Kind) -> bool:
    """Whether a value may be a few numbers rather than a map."""
    return any(not any(isinstance(size, str) for size in shape) for shape in kind.shapes)


def _check_outputs(job: Job, graph: Graph) -> None:
    try:
        plan = make_plan(graph, job.outputs)
    except RequestError as error:
        raise RequestError(str(error).replace("--to", "--to or --also", 1)) from None
    if graph.kind(plan.outputs[job.picture]).shapes[0][-1:] != (3,):
        kind = graph.kind(plan.outputs[job.picture])
        raise RequestError(f"--to {job.picture}: is a {kind.name}, but the result of a batch is a picture.")
    check_formats(plan, Options(job.outputs, job.image_format or "png", job.map_format, sheet=False))


def _refuse_said_twice(job: Job, data: Dataset, variation: Variation) -> None:
    """A parameter that varies is said once: one of the other values would be passed over without a word."""
    fixed = {parse_override(text)[0] for text in job.settings}
    for parameter, option in variation.options.items():
        if parameter in fixed:
            raise RequestError(f"{option} {parameter}: --set sets it too; leave one of them out.")
        if item := next((item for item in data.items.values() if parameter in item.settings), None):
            value = item.settings[parameter]
            raise RequestError(
                f"{option} {parameter}: {data.root} sets it too, to {value} for {item.id}; leave one of them out."
            )


def _check_first_item(job: Job, data: Dataset, variation: Variation) -> None:
    """Settings and names, tried on the first item, but not what it says itself: that is its own affair."""
    first = next(iter(data.items.values()))
    item = replace(first, id="folder/name", path="folder/name", settings={})
    computed = fields_of(job.layout.picture) & set(job.numbers)
    paths = set()
    variants = variation.variants(item, job.seed)
    for variant in variants:
        outputs_of(job, graph_of(job, variant))
        fields = known_values(item, variant)
        fields |= dict.fromkeys([*job.numbers, *first.settings], 1.0)
        try:
            paths.add(filled(job.layout.picture, fields))
        except OutputError as error:  # of every item, so that of none anything would be written
            raise RequestError(str(error)) from None
    if not {"path", "id", "name"} & fields_of(job.layout.picture):
        raise RequestError(
            f'--names "{job.layout.picture}": must hold {{path}}, {{id}} or {{name}}, to tell items apart.'
        )
    if len(paths) < len(variants) and not computed:
        known = [*KNOWN_BEFORE, *variation.differing]
        raise RequestError(
            f'--names "{job.layout.picture}": does not tell the {len(variants)} outputs of an item apart; put in'
            f" what differs: {', '.join(f'{{{name}}}' for name in known)}."
        )
