"""Processes of which each dies alone."""

from __future__ import annotations

import os
import signal
import time
from concurrent.futures import BrokenExecutor, wait

import pytest

from fogpipe.batch.engines import Here, Processes, open_engine, worker_died
from fogpipe.errors import RequestError


def slow(value: int) -> int:
    time.sleep(0.3)
    return value


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def fail() -> None:
    raise ValueError("on purpose")


def environment(name: str) -> str | None:
    return os.environ.get(name)


def test_a_process_that_dies_takes_its_own_call_only():
    with Processes(2, threads=1) as pool:
        pool.submit(slow, 0).result(60)
        dying, living = pool.submit(die), pool.submit(slow, 1)
        wait([dying, living], 60)
        assert isinstance(dying.exception(), BrokenExecutor)
        assert worker_died(dying.exception())
        assert living.result() == 1
        assert [pool.submit(slow, n).result(60) for n in (2, 3)] == [2, 3]


def test_an_error_is_no_death_and_threads_are_few():
    with Processes(1, threads=3) as pool:
        error = pool.submit(fail).exception(60)
        assert isinstance(error, ValueError)
        assert not worker_died(error)
        assert pool.submit(environment, "OMP_NUM_THREADS").result(60) == "3"


def test_here_is_this_process():
    with Here() as engine:
        assert engine.submit(os.getpid).result() == os.getpid()
        assert isinstance(engine.submit(fail).exception(), ValueError)


def test_an_unknown_engine_is_one_clear_error():
    with pytest.raises(RequestError, match="choose processes, here or dask"), open_engine("threads", 1, 1):
        pass
