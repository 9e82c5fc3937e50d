"""Writes the files of one variant of an item, and the labels that go with it."""

from __future__ import annotations

import hashlib
import os
import posixpath
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fogpipe.batch.job import Job
from fogpipe.batch.names import filled, known_values
from fogpipe.batch.places import Place
from fogpipe.batch.variation import Variant
from fogpipe.datasets.item import Item
from fogpipe.errors import OutputError
from fogpipe.io.files import is_url
from fogpipe.pipeline.graph import Graph, Ref
from fogpipe.runtime.inputs import Inputs
from fogpipe.runtime.outputs import file_digest, write_output
from fogpipe.runtime.record import library_versions, strict_json


@dataclass(frozen=True)
class Made:
    """What a worker made of one variant.

    Attributes
    ----------
    outputs : where each output of the job is among the values.
    """

    item: Item
    variant: Variant
    graph: Graph
    outputs: Mapping[str, Ref]
    values: Mapping[Ref, np.ndarray]
    inputs: Inputs

    def output(self, name: str) -> np.ndarray:
        """An output by name."""
        return self.values[self.outputs[name]]


@dataclass(frozen=True)
class Row:
    """What the journal and the manifest say of one variant.

    Attributes
    ----------
    files : path of each file, relative to the root of the outputs, by output.
    numbers : outputs that are numbers, such as the extinction (1/m) or the airlight.
    sha256 : of the picture.
    """

    item: str
    variant: str
    files: Mapping[str, str]
    settings: Mapping[str, Any]
    numbers: Mapping[str, Any]
    seed: int
    sources: Mapping[str, str]
    sha256: str


def write_variant(job: Job, place: Place, made: Made) -> Row:
    """Write picture, extras and record of one variant; each is there completely, and the record last."""
    numbers = {name: made.output(name).tolist() for name in job.numbers if made.output(name).size <= 3}
    fields = known_values(made.item, made.variant) | _in_names(numbers)
    picture = filled(job.layout.picture, fields)
    fields["stem"] = posixpath.splitext(picture)[0]
    files: dict[str, str] = {}
    with place.draft() as draft:
        written = {}
        for name in (job.picture, *job.extras):
            path = write_output(
                draft,
                name,
                made.graph.kind(made.outputs[name]),
                made.output(name),
                color=made.graph.color,
                alpha=made.inputs.alpha,
                image_format=job.image_format or posixpath.splitext(picture)[1].removeprefix(".").lower(),
                map_format=job.map_format,
            )
            if path:
                written[name] = path
                files[name] = picture if name == job.picture else _beside(job, fields, name, path.suffix)
        sha256 = file_digest(written[job.picture])
        sources = {**made.inputs.sources, "encoding": made.item.encoding or ""}
        if job.record:
            files["record"] = _beside(job, fields, "record", ".json")
        row = Row(
            made.item.id, made.variant.key, files, made.variant.settings, numbers, made.variant.seed, sources, sha256
        )
        if job.record:
            written["record"] = draft / "record.json"
            written["record"].write_text(strict_json(record_of(job, made, row)), encoding="utf-8")
        clear = filled(job.layout.clear, fields) if job.layout.clear else ""
        _refuse_own_files(job.root, made.item, [*files.values(), clear])
        for name, path in written.items():
            place.publish(path, files[name])
    if clear:
        place.copy(made.item.files["image"], clear)
    return row


def record_of(job: Job, made: Made, row: Row) -> dict[str, Any]:
    """How a picture was made, without times or places of this machine: the same batch writes the same bytes."""
    stages = made.graph.resolved()["stages"]
    contracts = {name: node.contract for name, node in made.graph.nodes.items()}
    camera = made.item.camera if isinstance(made.item.camera, str) else ""
    return {
        "versions": dict(library_versions()),
        "pipeline": {
            "source": posixpath.basename(job.source),
            "digest": hashlib.blake2b(job.text.encode(), digest_size=20).hexdigest(),
        },
        "color": made.graph.color,
        "tolerance": made.graph.tolerance,
        **{key: value for key, value in asdict(row).items() if key != "sources"},
        "inputs": {name: posixpath.basename(source) for name, source in made.inputs.sources.items()},
        "depth_encoding": made.item.encoding,
        "notes": [note.replace(camera, posixpath.basename(camera)) for note in made.inputs.notes],
        "stages": {name: f"{contract.name} {contract.mark.version}" for name, contract in contracts.items()},
        "parameters": {name: stage["with"] for name, stage in stages.items()},
    }


def write_labels(job: Job, place: Place, item: Item, rows: Sequence[Row]) -> None:
    """Link or copy the labels of an item.

    A label that is called like the image, as those of YOLO and Pascal VOC are, is called like each output; any other,
    as those of Cityscapes, keeps its name.
    """
    if job.labels == "none":
        return
    image = posixpath.basename(item.files.get("image", ""))
    targets: dict[str, str] = {}
    for relative, source in item.labels.items():
        folder, name = posixpath.split(relative)
        stem, suffix = posixpath.splitext(name)
        stems = [posixpath.splitext(posixpath.basename(row.files[job.picture]))[0] for row in rows]
        called_alike = stem == posixpath.splitext(image)[0]
        targets |= {posixpath.join(folder, own + suffix): source for own in (stems if called_alike else [stem])}
    _refuse_own_files(job.root, item, targets)
    put = place.link if job.labels == "link" else place.copy
    for target, source in targets.items():
        put(source, target)


def _refuse_own_files(root: str, item: Item, outputs: Iterable[str]) -> None:
    """OutputError where an output would take the place of a file that the item is made of."""
    camera = [item.camera] if isinstance(item.camera, str) else []
    own = {_spot(file): file for file in [*item.files.values(), *camera, *item.labels.values()]}
    for output in outputs:
        if file := own.get(_spot(f"{root}/{output}")):
            raise OutputError(
                f"{file}: is part of the data set and would be written over. Choose another folder with -o."
            )


def _spot(path: str) -> str:
    """Where a file would appear: links on the way are followed, and one in its place is not."""
    folder, name = os.path.split(path)
    return path if is_url(path) else os.path.join(os.path.realpath(folder), name)


def _beside(job: Job, fields: Mapping[str, Any], output: str, suffix: str) -> str:
    return filled(job.layout.extra, {**fields, "output": job.layout.called(output)}) + suffix


def _in_names(numbers: Mapping[str, Any]) -> dict[str, float]:
    """Numbers as names have them: a colour by its mean."""
    return {name: float(np.mean(value)) for name, value in numbers.items()}
