"""Runs a batch: finds what is missing, hands it to an engine, keeps the journal, and writes the manifest."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from fogpipe.batch.engines import LOCAL, open_engine
from fogpipe.batch.flow import Flow
from fogpipe.batch.job import Job, Task
from fogpipe.batch.journal import DRAFTS, Journal, State, open_journal, read_state
from fogpipe.batch.luggage import packed, work_with
from fogpipe.batch.manifest import write_manifest
from fogpipe.batch.places import LocalPlace, Place, place_at
from fogpipe.batch.variation import Variation
from fogpipe.batch.work import Done, work
from fogpipe.datasets.catalogue import Dataset
from fogpipe.errors import RequestError
from fogpipe.runtime.outputs import make_folder


@dataclass(frozen=True)
class Batch:
    """A job, the items it is done to, and how.

    Attributes
    ----------
    keep : files of the whole set that are copied, as paths relative to the root of the data.
    shard : which of how many parts of the set, counted from 1.
    max_failures : stop when so many items have failed; None for never.
    retry_failed : try items again that failed in an earlier run.
    """

    job: Job
    data: Dataset
    variation: Variation = Variation()  # noqa: RUF009 (it is frozen)
    keep: Mapping[str, str] = field(default_factory=dict)
    engine: str = "processes"
    workers: int = 1
    shard: tuple[int, int] = (1, 1)
    max_failures: int | None = None
    retry_failed: bool = False

    def settled(self) -> dict[str, Any]:
        """What a folder of outputs is tied to; sweeps may grow."""
        varied = {name: repr(getattr(self.variation, name)) for name in ("samples", "binds", "draws")}
        data = {"reader": self.data.name, "options": dict(self.data.options)}
        return json.loads(json.dumps({**self.job.settled(), **varied, **data}))


@dataclass(frozen=True)
class Todo:
    """What is to be done.

    Attributes
    ----------
    tasks : items with the variants that are missing.
    items : items of this shard.
    finished : those that are done already.
    failed : those that failed earlier and are not tried again, with the error.
    """

    tasks: Sequence[Task]
    items: int
    finished: int
    failed: Mapping[str, str]

    @property
    def outputs(self) -> int:
        """Pictures that are to be made."""
        return sum(len(task.variants) for task in self.tasks)


@dataclass
class Summary:
    """How a run went.

    Attributes
    ----------
    failed : error by item, those of earlier runs included.
    seconds : time inside workers, by stage.
    elapsed : wall time.
    memory : the most that a worker has held, in bytes; 0 where the system does not tell.
    stopped : why it ended before all was done; empty if it did not.
    """

    items: int = 0
    made: int = 0
    finished_before: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    elapsed: float = 0.0
    memory: int = 0
    stopped: str = ""


class Watcher:
    """Hears how a batch goes on; every method may be left as it is."""

    def started(self, todo: Todo) -> None:
        """Work begins."""

    def done(self, done: Done) -> None:
        """An item is done, or failed."""

    def interrupted(self, left: int) -> None:
        """No further items are begun; those under way are waited for."""

    def finished(self, summary: Summary) -> None:
        """All is written."""


def find_todo(batch: Batch, place: Place, state: State) -> Todo:
    """What a run would do, given what the journals say.

    Raises
    ------
    RequestError
        If the folder holds the outputs of another batch.
    """
    _expect_same_batch(batch, place, state)
    index, count = batch.shard
    mine = list(islice(batch.data.items.values(), index - 1, None, count))
    tasks, failed = [], {}
    for item in mine:
        done = state.done.get(item.id, {})
        missing = tuple(v for v in batch.variation.variants(item, batch.job.seed) if v.key not in done)
        if missing and item.id in state.failed and not batch.retry_failed:
            failed[item.id] = state.failed[item.id]
        elif missing:
            tasks.append(Task(item, missing))
    return Todo(tasks, len(mine), len(mine) - len(tasks) - len(failed), failed)


def run_batch(batch: Batch, watcher: Watcher | None = None) -> Summary:
    """Make what is missing.

    The journal is written after each item and the manifest at the end, also after Ctrl-C or too many failures.

    Raises
    ------
    RequestError
        If the folder holds another batch, or the engine cannot be used; nothing was run.
    OutputError
        If the folder or the journal cannot be written to.
    KeyboardInterrupt
        After Ctrl-C, when the items under way are done and the manifest is written.
    """
    watcher = watcher or Watcher()
    started = time.perf_counter()
    place = place_at(batch.job.root)
    if isinstance(place, LocalPlace):
        make_folder(Path(place.root))
    shard = f"{batch.shard[0]}-of-{batch.shard[1]}"
    with open_journal(place, shard) as journal:
        todo = _what_is_missing(batch, place)
        journal.job(batch.settled())
        journal.flush()  # a place that cannot be written to is known before anything runs
        job = replace(batch.job, drafts=f"{place.root}/{DRAFTS}/{shard}" if isinstance(place, LocalPlace) else "")
        summary = Summary(todo.items, finished_before=todo.finished, failed=dict(todo.failed))
        watcher.started(todo)
        try:
            _make_all(replace(batch, job=job), todo.tasks, journal, summary, watcher)
            for relative, source in batch.keep.items():
                place.copy(source, relative)
        finally:
            journal.flush()
            write_manifest(place, read_state(place).rows)
            summary.elapsed = time.perf_counter() - started
            watcher.finished(summary)
    return summary


def _what_is_missing(batch: Batch, place: Place) -> Todo:
    state = read_state(place)
    state.drop_missing(place)
    return find_todo(batch, place, state)


def _make_all(batch: Batch, tasks: Sequence[Task], journal: Journal, summary: Summary, watcher: Watcher) -> None:
    """Work on all tasks; after Ctrl-C or too many failures, on none that is not under way already."""
    if not tasks:
        return
    luggage = () if batch.engine in LOCAL else packed(batch.job.plugins)
    call = partial(work_with, luggage) if luggage else work
    earlier = set(summary.failed)

    def take(done: Done) -> None:
        if done.refused:  # the item is made by the next run, when there is room
            summary.stopped, flow.stopped = done.error, True
            return
        journal.done(done)
        summary.memory = max(summary.memory, done.memory or 0)
        summary.made += len(done.rows)
        for name, seconds in done.seconds.items():
            summary.seconds[name] = summary.seconds.get(name, 0.0) + seconds
        if done.error:
            summary.failed[done.item] = done.error
            failures = len(summary.failed.keys() - earlier)
            if failures == batch.max_failures:
                summary.stopped, flow.stopped = f"{failures} items failed (--max-failures)", True
        watcher.done(done)

    with open_engine(batch.engine, min(batch.workers, len(tasks)), batch.job.threads) as (executor, slots):
        ahead = batch.engine != "here"
        flow = Flow(lambda task: executor.submit(call, batch.job, task), slots, tasks, ahead)
        try:
            with flow.interruptible():
                for done in flow:
                    take(done)
        except KeyboardInterrupt:
            flow.stopped, summary.stopped = True, "interrupted"
            watcher.interrupted(len(flow.pending))
            for done in flow:
                take(done)
            raise


def _expect_same_batch(batch: Batch, place: Place, state: State) -> None:
    settled = batch.settled()
    for other in state.jobs:
        if differing := [name for name in settled if settled[name] != other.get(name)]:
            raise RequestError(
                f"{place.root} holds the outputs of a batch that differs in {', '.join(differing)}. Choose another"
                f" folder with -o, or repeat the batch as it was; sweeps may get more values."
            )
