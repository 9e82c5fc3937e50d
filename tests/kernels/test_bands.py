"""Rows are shared out among threads: each is done once, errors arrive, and nobody waits for a thread that is busy."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from fogpipe.kernels import bands


@pytest.fixture(params=[1, 2, 3])
def count(request):
    before = bands.threads()
    bands.set_threads(request.param)
    yield request.param
    bands.set_threads(before)


def add_one(first, last, rows):
    rows[first:last] += 1


@pytest.mark.parametrize("rows", [0, 1, 2, 7, 1000])
def test_each_row_is_done_once(count, rows):
    done = np.zeros(rows, int)
    bands.in_bands(add_one, rows, 100_000, done)
    assert (done == 1).all()


def test_what_is_little_is_done_by_the_caller(count):
    callers = []
    bands.in_bands(lambda first, last: callers.append((threading.get_ident(), first, last)), 10, 10)
    assert callers == [(threading.get_ident(), 0, 10)]


def test_an_error_in_any_band_is_raised(count):
    def fail(first, last):
        if first <= 900 < last:
            raise ArithmeticError("row 900")

    with pytest.raises(ArithmeticError, match="row 900"):
        bands.in_bands(fail, 1000, 100_000)


def test_meanwhile_is_done_once_it_is_waited_for(count):
    done = np.zeros(10, int)
    wait = bands.meanwhile(add_one, 0, 10, done)
    wait()
    wait()  # as often as one likes
    assert (done == 1).all()


def test_an_error_meanwhile_is_raised_where_it_is_waited_for():
    before = bands.threads()
    bands.set_threads(2)
    try:
        wait = bands.meanwhile(lambda: np.zeros(-1))
        with pytest.raises(ValueError, match="negative"):
            wait()
    finally:
        bands.set_threads(before)


def test_rows_do_not_wait_for_threads_that_are_busy():
    before = bands.threads()
    bands.set_threads(2)
    go_on = threading.Event()
    try:
        wait = bands.meanwhile(lambda: None if go_on.wait(60) else pytest.fail("the rows waited"))
        done = np.zeros(1000, int)
        bands.in_bands(add_one, 1000, 100_000, done)
        assert (done == 1).all()
        go_on.set()
        wait()
    finally:
        go_on.set()
        bands.set_threads(before)


def test_who_waits_for_what_nobody_has_begun_does_it_himself():
    before = bands.threads()
    bands.set_threads(2)
    go_on, callers = threading.Event(), []
    try:
        busy = bands.meanwhile(go_on.wait, 60)
        wait = bands.meanwhile(lambda: callers.append(threading.get_ident()) or "done")
        assert wait() == wait() == "done"
        assert callers == [threading.get_ident()]
        go_on.set()
        assert busy()
    finally:
        go_on.set()
        bands.set_threads(before)
