"""Local stages on their way to machines that do not have their folder."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from fogpipe.batch.job import Job, Task
from fogpipe.batch.work import Done, work

Luggage = tuple[tuple[tuple[str, str], ...], ...]
"""For each folder of plugins, name and text of every module."""


def packed(folders: Sequence[str]) -> Luggage:
    """The modules in folders of plugins."""
    return tuple(
        tuple((path.name, path.read_text(encoding="utf-8")) for path in sorted(Path(folder).glob("*.py")))
        for folder in folders
    )


def work_with(luggage: Luggage, job: Job, task: Task) -> Done:
    """Work on a task with the plugins that came along."""
    return work(replace(job, plugins=_unpacked(luggage)), task)


@lru_cache(maxsize=4)
def _unpacked(luggage: Luggage) -> tuple[str, ...]:
    folders = []
    for modules in luggage:
        folder = Path(tempfile.mkdtemp(prefix="fogpipe-plugins-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        for name, text in modules:
            (folder / name).write_text(text, encoding="utf-8")
        folders.append(str(folder))
    return tuple(folders)
