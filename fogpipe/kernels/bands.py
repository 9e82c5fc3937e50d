"""Runs a compiled loop over bands of rows, in threads.

A kernel that takes part is compiled with ``nogil=True``, has the form ``kernel(first, last, ...)``, and
writes only rows ``first:last`` of its outputs while it reads whatever it likes of its inputs. Each
row is then computed by the same instructions whatever the number of threads, so the result is the
same to the last bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from threading import Lock
from typing import Any

MIN_PIXELS_PER_BAND = 16_384
"""Below this a thread costs more than it saves (a hand-over takes about 30 µs)."""

_threads = max(1, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
_pool: ThreadPoolExecutor | None = None


def threads() -> int:
    """How many threads a kernel may use."""
    return _threads


def set_threads(count: int) -> None:
    """Let kernels use ``count`` threads (at least 1). Results do not depend on it."""
    global _threads
    if count < 1:
        raise ValueError(f"threads must be at least 1, not {count}")
    _threads = count
    _forget_pool()


PER_THREAD = 4
"""Bands for each thread. Where some rows take longer than others, a thread that is done early takes the next."""


def in_bands(kernel: Callable[..., None], rows: int, columns: int, *arguments: Any) -> None:
    """Call ``kernel(first, last, *arguments)`` on bands that cover ``rows`` rows of ``columns`` pixels."""
    workers = max(1, min(_threads, rows, rows * columns // MIN_PIXELS_PER_BAND))
    if workers == 1:
        kernel(0, rows, *arguments)
        return
    count = max(workers, min(PER_THREAD * workers, rows, rows * columns // MIN_PIXELS_PER_BAND))
    bands = iter([(rows * band // count, rows * (band + 1) // count) for band in range(count)])

    def work() -> None:
        for first, last in bands:
            kernel(first, last, *arguments)

    with ExitStack() as others:  # all of which are waited for, whoever fails; not those that are busy elsewhere
        for _ in range(1, workers):
            others.callback(meanwhile(work))
        work()


def meanwhile(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """Call a function while the caller goes on; what is returned gives its result.

    It waits for that if another thread is at it, and calls the function itself if none has come to it yet.
    """
    begun, result = Lock(), Future[Any]()

    def run() -> None:
        if begun.acquire(blocking=False):
            try:
                result.set_result(function(*arguments))
            except BaseException as error:
                result.set_exception(error)

    def wait() -> Any:
        run()
        return result.result()

    if _threads > 1:
        _submit(run)
    return wait


def _submit(function: Callable[[], None]) -> None:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(1, _threads - 1), thread_name_prefix="fogpipe-band")
    _pool.submit(function)


def _forget_pool() -> None:
    global _pool
    _pool = None


# A forked child inherits the pool object but none of its threads, and would wait for ever.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)
