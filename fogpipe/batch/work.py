"""What a worker does with one item: read, run every variant, write."""

from __future__ import annotations

import contextlib
import errno
import gc
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from multiprocessing import parent_process

import numpy as np

import fogpipe
from fogpipe.batch.files import Made, Row, write_labels, write_variant
from fogpipe.batch.job import Job, Task, graph_of, outputs_of
from fogpipe.batch.places import place_at
from fogpipe.datasets.item import Item
from fogpipe.errors import ExpectationError, FogpipeError, OutputError, RequestError, RunError
from fogpipe.io.given import DISTANCES
from fogpipe.kernels.bands import set_threads, threads
from fogpipe.pipeline.graph import Ref
from fogpipe.pipeline.plan import Plan, plan_for
from fogpipe.pipeline.sharing import shared_values
from fogpipe.runtime.inputs import Inputs, Request, inputs_from_request
from fogpipe.runtime.record import peak_memory
from fogpipe.runtime.runner import execute

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
"""What a disk says that is full, or broken."""


@dataclass(frozen=True)
class Done:
    """What became of a task.

    Attributes
    ----------
    item : its id.
    rows : what was made, per variant; empty where the task failed.
    error : why it failed, for people; empty where it did not.
    seconds : time by stage, for ``reading`` and ``writing``, and the ``whole``.
    memory : the most that the process has held so far, in bytes; None where the system does not tell.
    refused : whether the place of the outputs refused (a full disk), which is no fault of the item.
    """

    item: str
    rows: tuple[Row, ...] = ()
    error: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)
    memory: int | None = None
    refused: bool = False


def work(job: Job, task: Task) -> Done:
    """Make all variants of an item. Whatever goes wrong with it is told, and nothing is raised.

    A stage that no variant changes anything about runs once for all of them.
    """
    clock = _Clock()
    try:
        with clock("whole"):
            rows = _rows(job, task, clock)
        _settle()
        return Done(task.item.id, tuple(rows), seconds=dict(clock.seconds), memory=peak_memory())
    except FogpipeError as error:
        cause = error.__cause__
        full = isinstance(error, OutputError) and isinstance(cause, OSError) and cause.errno in _NO_ROOM
        return Done(task.item.id, error=str(error), refused=full)
    except Exception as error:  # a fault of a stage or a library costs this item and no other
        return Done(task.item.id, error=f"{type(error).__name__}: {error}")


def _rows(job: Job, task: Task, clock: _Clock) -> list[Row]:
    if job.version != fogpipe.__version__:
        raise RunError(f"this worker has fogpipe {fogpipe.__version__}, but the batch was started by {job.version}.")
    if threads() != job.threads:
        set_threads(job.threads)
    graphs = [graph_of(job, variant) for variant in task.variants]
    outputs = outputs_of(job, graphs[0])
    whole = plan_for(graphs[0], outputs)
    with clock("reading"):
        inputs = inputs_from_request(whole, request_for(whole, task.item))
    same = shared_values(graphs, outputs) if len(graphs) > 1 else frozenset()
    known = _run(plan_for(graphs[0], {str(ref): ref for ref in same}), inputs, {}, clock)
    place = place_at(job.root, job.drafts)
    rows = []
    for variant, graph in zip(task.variants, graphs, strict=True):
        values = _run(plan_for(graph, outputs, known=known), inputs, known, clock)
        made = Made(task.item, variant, graph, outputs, values, inputs)
        with clock("writing"):
            rows.append(write_variant(job, place, made))
    _refuse_same_names(rows)
    with clock("writing"):
        write_labels(job, place, task.item, rows)
    return rows


def request_for(plan: Plan, item: Item) -> Request:
    """The files of an item that a plan needs; a distance that has no file of its own is read from the range's."""
    kinds = {name: plan.graph.inputs[name] for name in plan.inputs}
    files = {name: item.files[name] for name in kinds if name in item.files}
    if "range_map" in item.files:
        files |= {name: item.files["range_map"] for name, kind in kinds.items() if kind.name in ("Range", "Depth")}
    reads_distance = any(kinds[name].name in DISTANCES for name in files)
    reads_camera = reads_distance or any(kind.name == "Camera" for kind in kinds.values())
    return Request(
        files=files, depth=item.encoding if reads_distance else None, camera=item.camera if reads_camera else None
    )


def _run(plan: Plan, inputs: Inputs, known: Mapping[Ref, np.ndarray], clock: _Clock) -> dict[Ref, np.ndarray]:
    """The values that a plan gives, and those that were known."""
    outcome = execute(plan, inputs.values, known=known)
    for report in outcome.reports:
        clock.seconds[report.name] += report.seconds
    for expectation in plan.expectations:
        value = float(outcome.values[expectation.ref])
        if not expectation.holds(value):
            raise ExpectationError(f"{plan.graph.source}: expected {expectation}, but it is {value:g}.")
    return {**known, **outcome.values}


@cache
def _settle() -> None:
    """Spare the garbage collector of a worker what it has loaded by now: to go through it takes as long as a blur."""
    if parent_process():
        gc.collect()
        gc.freeze()


def _refuse_same_names(rows: Sequence[Row]) -> None:
    paths = [path for row in rows for path in row.files.values()]
    if twice := [path for path in paths if paths.count(path) > 1]:
        raise RequestError(
            f"two outputs are called {twice[0]}; put what differs between them into --names, as {{stage.parameter}}."
        )


class _Clock:
    """Adds up wall time by name."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)

    @contextlib.contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] += time.perf_counter() - started
