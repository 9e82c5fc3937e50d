"""Where items are worked on: processes of this machine, this process, or a Dask cluster.

Each is an ordinary :class:`concurrent.futures.Executor`. The heavy libraries are imported by the work itself, after
:func:`_prepare` has told them how many threads to use.
"""

from __future__ import annotations

import os
import queue
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from typing import Any, TypeVar

from fogpipe.errors import RequestError

T = TypeVar("T")
LOCAL = ("processes", "here")
PATIENCE = 10.0
"""Seconds to wait for the scheduler of a cluster."""


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Processes(Executor):
    """Processes of which each dies alone.

    The process pool of the standard library gives up all that is under way when one of its processes dies. Here each
    process is a pool of its own, which is replaced: only the call that it was at fails, with ``BrokenExecutor``.

    Parameters
    ----------
    workers : number of processes; ``submit`` waits while all of them are busy.
    threads : that each of them may use.
    """

    def __init__(self, workers: int, threads: int) -> None:
        self._threads = threads
        self._idle: queue.SimpleQueue[ProcessPoolExecutor] = queue.SimpleQueue()
        self._all = [self._pool() for _ in range(workers)]
        for pool in self._all:
            self._idle.put(pool)

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Run a call in the next process that is idle."""
        pool = self._idle.get()
        try:
            future = pool.submit(fn, *args, **kwargs)
        except BrokenExecutor:  # it died while it was idle
            pool = self._replaced(pool)
            future = pool.submit(fn, *args, **kwargs)
        future.add_done_callback(lambda done: self._idle.put(self._replaced(pool) if _died(done) else pool))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes."""
        for pool in self._all:
            pool.shutdown(wait, cancel_futures=cancel_futures)

    def _pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, get_context("spawn"), _prepare, (self._threads,))

    def _replaced(self, pool: ProcessPoolExecutor) -> ProcessPoolExecutor:
        pool.shutdown(wait=False)
        self._all[self._all.index(pool)] = fresh = self._pool()
        return fresh


class Here(Executor):
    """This process, one call after the other: for debugging, and for a few small images."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Run a call at once."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def require_engine(name: str) -> None:
    """Refuse an engine that there is none of; whether a scheduler answers is known when it is opened.

    Raises
    ------
    RequestError
        If there is no such engine.
    """
    if name not in LOCAL and not name.startswith("dask://"):
        raise RequestError(f"--engine {name}: choose {', '.join(LOCAL)} or dask://HOST:PORT.")


@contextmanager
def open_engine(name: str, workers: int, threads: int) -> Iterator[tuple[Executor, int]]:
    """An executor, and how many items may be under way in it.

    Parameters
    ----------
    name : ``processes``, ``here``, or ``dask://host:port`` of a scheduler.

    Raises
    ------
    RequestError
        If there is no such engine, or it cannot be reached.
    """
    require_engine(name)
    if name == "processes":
        with Processes(workers, threads) as pool:
            yield pool, workers
    elif name == "here":
        yield Here(), 1
    else:
        with _dask("tcp://" + name.removeprefix("dask://")) as client:
            # Two items for each thread: one at work and one that waits, so that no worker waits for the network.
            slots = 2 * sum(client.nthreads().values())
            if not slots:
                raise RequestError(f"--engine {name}: the scheduler has no workers.")
            with client.get_executor(pure=False) as executor:
                yield executor, slots


def worker_died(error: BaseException | None) -> bool:
    """Whether a call failed because the process that ran it is gone."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ in ("KilledWorker", "CancelledError")


def _dask(address: str) -> Any:
    """A client of the scheduler at an address."""
    try:
        from distributed import Client
    except ImportError as error:
        raise RequestError("--engine dask://…: install fogpipe[cluster].") from error
    try:
        return Client(address, timeout=PATIENCE)
    except (OSError, TimeoutError) as error:
        raise RequestError(f"--engine: there is no Dask scheduler at {address}: {error}.") from error


def _died(future: Future[Any]) -> bool:
    return not future.cancelled() and isinstance(future.exception(), BrokenExecutor)


def _prepare(threads: int) -> None:
    """Set up a new process: few threads, deaf to Ctrl-C (its parent decides), and gone when its parent is."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"):
        os.environ[name] = str(threads)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="fogpipe-parent", daemon=True).start()
    with suppress(ImportError):
        import cv2

        cv2.setNumThreads(threads)


def _end_with_parent() -> None:
    """A parent that was killed tells nobody; its workers must not go on alone."""
    if parent := parent_process():
        wait([parent.sentinel])
        os._exit(1)
