"""What a batch is, as plain data that travels to every worker."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import fogpipe
from fogpipe.batch.names import Layout
from fogpipe.batch.variation import Variant
from fogpipe.datasets.item import Item
from fogpipe.errors import RequestError
from fogpipe.pipeline.graph import Graph, Ref
from fogpipe.pipeline.plan import make_plan
from fogpipe.pipeline.spec import parse_override
from fogpipe.registry import Registry
from fogpipe.runtime.pipeline import Pipeline, from_text

Labels = Literal["link", "copy", "none"]


@dataclass(frozen=True)
class Job:
    """What is done to each item, and where the results go.

    Attributes
    ----------
    text, source : the pipeline as YAML, and what messages call it.
    settings : ``stage.parameter=value`` as on the command line.
    seed : of the set; that of an image follows from it and from the image's id.
    tolerance : replaces the pipeline's.
    plugins : folders of local stages, as they are called on the machine that reads them.
    picture : the output that is the result; its name is the template's.
    extras : outputs that are written beside it.
    numbers : outputs that are a few numbers, recorded for each image.
    record : whether to write a JSON record beside each image.
    layout : names of the files.
    image_format, map_format : as for a single run; empty where each picture has the format of its input.
    labels : whether label files are linked, copied or left out.
    root : folder or URL of the outputs.
    drafts : folder for files that are not complete yet; empty where the root is a URL.
    threads : that a worker may use; the result does not depend on it.
    """

    text: str
    source: str
    settings: tuple[str, ...] = ()
    seed: int = 0
    tolerance: float | None = None
    plugins: tuple[str, ...] = ()
    picture: str = "hazy"
    extras: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    record: bool = False
    layout: Layout = Layout("{path}.png")  # noqa: RUF009 (it is frozen)
    image_format: str = "png"
    map_format: str = "npy"
    labels: Labels = "link"
    root: str = "out"
    drafts: str = ""
    threads: int = 1
    version: str = fogpipe.__version__

    @property
    def outputs(self) -> tuple[str, ...]:
        """Every output of the pipeline that is computed."""
        return tuple(dict.fromkeys((self.picture, *self.extras, *self.numbers)))

    def settled(self) -> dict[str, Any]:
        """What shapes the pixels and the names, as plain data: a folder holds the outputs of one such job."""
        data = asdict(self)
        for name in ("root", "drafts", "threads", "plugins", "source"):
            del data[name]
        data["text"] = hashlib.blake2b(self.text.encode(), digest_size=8).hexdigest()
        return data


@dataclass(frozen=True)
class Task:
    """One item and its variants that are to be made."""

    item: Item
    variants: tuple[Variant, ...]


@lru_cache(maxsize=4)
def pipeline_of(job: Job) -> Pipeline:
    """The checked pipeline of a job, without what differs between outputs."""
    return _checked(job, {}, {})


def graph_of(job: Job, variant: Variant) -> Graph:
    """The pipeline of a job with what a variant sets.

    Raises
    ------
    PipelineError
        If the variant names a parameter that does not exist, or gives it a value that it cannot have.
    """
    graph = _graph(job, json.dumps(dict(variant.settings)), json.dumps(dict(variant.said_by)))
    return replace(graph, seed=variant.seed)


def outputs_of(job: Job, graph: Graph) -> dict[str, Ref]:
    """Where the outputs of a job come from; RequestError where the pipeline has none of that name."""
    return dict(make_plan(graph, job.outputs).outputs)


@lru_cache(maxsize=64)
def _graph(job: Job, settings: str, said_by: str) -> Graph:
    return _checked(job, json.loads(settings), json.loads(said_by)).graph


def _checked(job: Job, settings: Mapping[str, Any], said_by: Mapping[str, str]) -> Pipeline:
    try:
        fixed = dict(parse_override(text) for text in job.settings)
    except ValueError as error:
        raise RequestError(str(error)) from error
    registry = _registry(job.plugins)
    settled = {**fixed, **settings}
    return from_text(job.text, job.source, set=settled, said_by=said_by, tolerance=job.tolerance, registry=registry)


@lru_cache(maxsize=4)
def _registry(folders: tuple[str, ...]) -> Registry:
    return Registry([Path(folder) for folder in folders])
