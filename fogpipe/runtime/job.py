"""A whole run from files to files: read, execute, write the outputs, the proof sheet and the record."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fogpipe.errors import InputError, ReplayError
from fogpipe.pipeline.check import check
from fogpipe.pipeline.graph import Graph, Ref
from fogpipe.pipeline.spec import spec_from_data
from fogpipe.registry import Registry
from fogpipe.runtime.cache import Cache
from fogpipe.runtime.events import Observer, StageReport
from fogpipe.runtime.inputs import Inputs, Request, inputs_from_request
from fogpipe.runtime.outputs import (
    RECORD_NAME,
    SHEET_NAME,
    Options,
    check_formats,
    check_opacity,
    file_digest,
    output_folder,
    publish,
    staging,
    write_output,
)
from fogpipe.runtime.pipeline import Pipeline, Result, run_plan
from fogpipe.runtime.record import (
    changed_inputs,
    changed_outputs,
    changed_versions,
    describe_inputs,
    make_record,
    read_record,
    strict_json,
)


def run_job(
    pipeline: Pipeline,
    request: Request,
    options: Options,
    folder: Path,
    *,
    workers: int | None = None,
    cache: Cache | None = None,
    observer: Observer | None = None,
    expected_inputs: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Run a pipeline on files and write everything into ``folder``; returns the record.

    Everything is written to a folder of its own first and then moved, the record last: a folder with a ``run.json`` is
    complete, and a run that fails leaves what was there before. The files of an older run go when the new ones come.

    Parameters
    ----------
    expected_inputs : a record whose inputs these must be (for a replay).

    Raises
    ------
    RequestError
        If the inputs cannot be used; nothing was run.
    RunError
        If a stage or the writing of an output fails.
    """
    started = time.perf_counter()
    plan = pipeline.plan(options.to)
    check_formats(plan, options)
    inputs = inputs_from_request(plan, request)
    described = describe_inputs(pipeline.graph, inputs)
    if expected_inputs and (changed := changed_inputs(expected_inputs, described)):
        raise InputError(f"the content of {', '.join(changed)} is not what it was in the recorded run.")
    check_opacity(inputs, options)
    with output_folder(folder):
        sheet = _SheetObserver(pipeline.graph, observer or Observer()) if options.sheet else None
        if sheet:
            sheet.inputs(inputs)
        result = run_plan(plan, inputs, workers=workers, cache=cache, observer=sheet or observer)
        with staging(folder) as draft:
            files = _write_outputs(pipeline.graph, plan.outputs, result, inputs, options, draft)
            if sheet:
                sheet.write(draft / SHEET_NAME)
            record = make_record(
                plan, request, options, described, inputs.notes, result, files, time.perf_counter() - started
            )
            (draft / RECORD_NAME).write_text(strict_json(record), encoding="utf-8")
            removed = publish(draft, folder)
    if removed:  # told, not recorded: it says nothing about the outputs
        text = f"{folder} held an earlier run, of which {', '.join(removed)} are gone; -o gives each run a folder."
        record["notes"] = [*record["notes"], text]
    return record


def replay_job(
    path: Path, folder: Path, *, workers: int | None = None, observer: Observer | None = None
) -> dict[str, Any]:
    """Run again what a record says and compare the outputs byte by byte; returns the new record.

    Raises
    ------
    InputError
        If the record or an input cannot be read, or an input has changed.
    ReplayError
        If an output came out differently; names the libraries that have changed since.
    """
    before = read_record(path)
    try:
        options, request = Options(**before["options"]), Request(**before["request"])
    except TypeError as error:
        raise InputError(f"{path} is damaged: {error}.") from error
    registry = Registry(options.plugins)
    pipeline = Pipeline(check(spec_from_data(before["pipeline"], before["source"]), registry), registry)
    after = run_job(pipeline, request, options, folder, workers=workers, observer=observer, expected_inputs=before)
    if changed := changed_outputs(before, after):
        others = ", ".join(changed_versions(before, after)) or "no library or stage has changed since"
        raise ReplayError(f"{', '.join(changed)} came out differently than in {path} ({others}).")
    return after


def _write_outputs(
    graph: Graph, refs: Mapping[str, Ref], result: Result, inputs: Inputs, options: Options, folder: Path
) -> dict[str, dict[str, str]]:
    files = {}
    for name, array in result.items():
        path = write_output(
            folder,
            name,
            graph.kind(refs[name]),
            array,
            color=graph.color,
            alpha=None if options.opaque else inputs.alpha,
            image_format=options.image_format,
            map_format=options.map_format,
        )
        if path:
            files[name] = {"file": path.name, "sha256": file_digest(path)}
    return files


class _SheetObserver(Observer):
    """Makes a thumbnail of every value as it passes, so that the value itself can be freed."""

    def __init__(self, graph: Graph, inner: Observer) -> None:
        from fogpipe.io.sheet import Tile

        self.graph = graph
        self.inner = inner
        self.tiles: list[Tile] = []

    def inputs(self, inputs: Inputs) -> None:
        for name, array in inputs.values.items():
            self._add(Ref(name), array)

    def started(self, name: str) -> None:
        self.inner.started(name)

    def finished(self, report: StageReport) -> None:
        self.inner.finished(report)

    def value(self, ref: Ref, array: np.ndarray) -> None:
        self.inner.value(ref, array)
        self._add(ref, array)

    def write(self, path: Path) -> None:
        from fogpipe.io.sheet import write_sheet

        write_sheet(path, self.graph.title or self.graph.source, self.tiles)

    def _add(self, ref: Ref, array: np.ndarray) -> None:
        from fogpipe.io.sheet import tile

        self.tiles.append(tile(str(ref), self.graph.kind(ref), array, self.graph.color))
