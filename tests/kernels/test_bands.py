"""Rows are shared out among threads: each is done once, errors arrive, and nobody waits for a thread that is busy."""

from __future__ import annotations

import threading
import time
import weakref

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


def test_bands_begin_with_the_last_one_if_told_so():
    before = bands.threads()
    bands.set_threads(2)
    try:
        order = []
        bands.in_bands(lambda first, last: order.append(first), 1000, 100_000, last_first=True)
        assert max(order) in order[:2]  # two begin at once
        assert 0 in order[-2:]
    finally:
        bands.set_threads(before)


def test_all_threads_are_waited_for_though_one_fails():
    before = bands.threads()
    bands.set_threads(3)
    begun, go_on, done = threading.Semaphore(0), threading.Event(), []

    def fail_or_wait(first, last):
        if not begun.acquire(timeout=0):
            begun.release(10)
            go_on.wait(60)
            raise ArithmeticError("the first")
        go_on.set()
        time.sleep(0.05)
        done.append((first, last))

    try:
        with pytest.raises(ArithmeticError, match="the first"):
            bands.in_bands(fail_or_wait, 12, 1_000_000)
        count = len(done)
        assert count
        time.sleep(0.2)
        assert len(done) == count, "a band was still at it"
    finally:
        bands.set_threads(before)


def test_a_thread_lets_go_of_what_it_has_worked_on():
    before = bands.threads()
    bands.set_threads(2)
    try:
        held = np.zeros(10)
        seen = weakref.ref(held)
        began = threading.Event()
        wait = bands.meanwhile(lambda array: began.set(), held)
        assert began.wait(60)  # by the other thread, as nobody waits yet
        wait()
        del wait, held
        for _ in range(100):
            if seen() is None:
                break
            time.sleep(0.01)
        assert seen() is None
    finally:
        bands.set_threads(before)


def test_threads_end_when_another_number_of_them_is_wanted():
    def alive() -> int:
        return sum(thread.name == "fogpipe-band" for thread in threading.enumerate())

    before = bands.threads()
    try:
        for count in (3, 2, 1):
            bands.set_threads(count)
            bands.in_bands(add_one, 1000, 100_000, np.zeros(1000))
            for _ in range(200):
                if alive() == count - 1:
                    break
                time.sleep(0.01)
            assert alive() == count - 1
    finally:
        bands.set_threads(before)
