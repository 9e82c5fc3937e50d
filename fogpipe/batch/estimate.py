"""What a batch would take: some items are made in a folder of their own, and the rest is reckoned from them."""

from __future__ import annotations

import shutil
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

from fogpipe.batch.run import Batch, Todo
from fogpipe.batch.work import work
from fogpipe.io.files import is_url

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
    free : disk space that is left where the outputs go, in bytes; None for a URL.
    """

    trials: int
    seconds: float
    bytes: float
    errors: tuple[str, ...] = ()
    free: int | None = None


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
    seconds = sum(took) / len(took) * todo.outputs / batch.workers
    return Estimate(len(took), seconds, size / len(took) * todo.outputs, tuple(errors), _free(batch.job.root))


def _free(root: str) -> int | None:
    if is_url(root):
        return None
    folder = Path(root).resolve()
    return shutil.disk_usage(next(part for part in (folder, *folder.parents) if part.exists())).free
