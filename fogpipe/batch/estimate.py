"""What a batch would take: some items are made in a folder of their own, and the rest is reckoned from them."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

from fogpipe.batch.run import Batch, Todo
from fogpipe.batch.work import work

TRIALS = 3


@dataclass(frozen=True)
class Estimate:
    """What the remaining work takes.

    Attributes
    ----------
    trials : items that it was reckoned from; 0 where none could be made.
    seconds : wall time with all workers.
    bytes : disk space.
    errors : what went wrong with items that were tried.
    """

    trials: int
    seconds: float
    bytes: float
    errors: tuple[str, ...] = ()


def estimate(batch: Batch, todo: Todo) -> Estimate:
    """Make up to three items, spread over the set, and remove them again."""
    picked = todo.tasks[:: max(1, len(todo.tasks) // TRIALS)][:TRIALS]
    took, size, errors = [], 0, []
    for number, task in enumerate([*picked[:1], *picked]):
        with tempfile.TemporaryDirectory(prefix="fogpipe-estimate-") as folder:
            started = time.perf_counter()
            done = work(replace(batch.job, root=folder, drafts="", labels="none"), task)
            if done.error:
                errors += [f"{done.item}: {done.error}"] if number else []
            elif number:  # the first of all compiles and loads
                took.append((time.perf_counter() - started) / len(task.variants))
                size += sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file()) / len(
                    task.variants
                )
    if not took:
        return Estimate(0, 0.0, 0.0, tuple(errors))
    each = sum(took) / len(took)
    return Estimate(len(took), each * todo.outputs / batch.workers, size / len(took) * todo.outputs, tuple(errors))
