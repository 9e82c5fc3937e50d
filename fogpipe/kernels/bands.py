"""Runs a compiled loop over bands of rows, in threads.

A kernel that takes part is compiled with ``nogil=True``, has the form ``kernel(first, last, ...)``, and
writes only rows ``first:last`` of its outputs while it reads whatever it likes of its inputs. Each
row is then computed by the same instructions whatever the number of threads, so the result is the
same to the last bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any

MIN_PIXELS_PER_BAND = 16_384
"""Below this a thread costs more than it saves (a hand-over takes about 30 µs)."""

_threads = max(1, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
_jobs: SimpleQueue[Callable[[], None] | None] | None = None


def threads() -> int:
    """How many threads a kernel may use."""
    return _threads


def set_threads(count: int) -> None:
    """Let kernels use ``count`` threads (at least 1). Results do not depend on it."""
    global _threads
    if count < 1:
        raise ValueError(f"threads must be at least 1, not {count}")
    _dismiss()
    _threads = count


PER_THREAD = 4
"""Bands for each thread. Where some rows take longer than others, a thread that is done early takes the next."""


def in_bands(kernel: Callable[..., None], rows: int, columns: int, *arguments: Any, last_first: bool = False) -> None:
    """Call ``kernel(first, last, *arguments)`` on bands that cover ``rows`` rows of ``columns`` pixels.

    The first rows are begun first, or the last ones: for where these take longest, and had better not be left over
    to the end.
    """
    workers = max(1, min(_threads, rows, rows * columns // MIN_PIXELS_PER_BAND))
    if workers == 1:
        kernel(0, rows, *arguments)
        return
    count = max(workers, min(PER_THREAD * workers, rows, rows * columns // MIN_PIXELS_PER_BAND))
    bands = iter(range(count - 1, -1, -1) if last_first else range(count))

    def work() -> None:
        for band in bands:
            kernel(rows * band // count, rows * (band + 1) // count, *arguments)

    others = [meanwhile(work) for _ in range(1, workers)]
    try:
        work()
    finally:
        _wait_for(others)  # who are all waited for, whoever fails; not those that are busy elsewhere


def _wait_for(others: list[Callable[[], Any]]) -> None:
    if others:
        try:
            others.pop()()
        finally:
            _wait_for(others)


def meanwhile(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """Call a function while the caller goes on; what is returned gives its result.

    It waits for that if another thread is at it, and calls the function itself if none has come to it yet.
    """
    begun, ended = Lock(), Lock()
    ended.acquire()
    results: list[Any] = []

    def run() -> None:
        if begun.acquire(blocking=False):
            try:
                results.append(function(*arguments))
            except BaseException as error:
                results.extend((None, error))
            ended.release()

    def wait() -> Any:
        run()
        with ended:
            result, *errors = results
        if errors:
            raise errors[0]
        return result

    if _threads > 1:
        _submit(run)
    return wait


def _submit(job: Callable[[], None]) -> None:
    # The pool of the standard library takes thirty microseconds more to hand a job over; some bands take a hundred.
    global _jobs
    jobs = _jobs
    if jobs is None:
        jobs = _jobs = SimpleQueue()
        for _ in range(_threads - 1):
            Thread(target=_work, args=(jobs,), name="fogpipe-band", daemon=True).start()
    jobs.put(job)


def _work(jobs: SimpleQueue[Callable[[], None] | None]) -> None:
    while (job := jobs.get()) is not None:
        job()
        del job  # and with it the arrays that it held


def _dismiss() -> None:
    global _jobs
    if _jobs is not None:
        for _ in range(_threads - 1):
            _jobs.put(None)
    _jobs = None


def _forget() -> None:
    global _jobs
    _jobs = None


# A forked child inherits the queue but no thread that looks at it, and would wait for ever.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
