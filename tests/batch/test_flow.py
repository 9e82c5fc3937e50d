"""Tasks on their way through an engine: never more at once than there is room for, and none after a stop."""

from __future__ import annotations

from concurrent.futures import BrokenExecutor, Future

import pytest

from fogpipe.batch.flow import Flow
from fogpipe.batch.job import Task
from fogpipe.batch.work import Done
from fogpipe.datasets.item import Item

TASKS = [Task(Item(str(number), {}), ()) for number in range(6)]


class Engine:
    """Ends each call at once, and remembers how many were begun."""

    def __init__(self, dying: str = "", times: int = 0) -> None:
        self.begun: list[str] = []
        self.dying = [dying] * times

    def submit(self, task: Task) -> Future[Done]:
        self.begun.append(task.item.id)
        future: Future[Done] = Future()
        if task.item.id in self.dying:
            self.dying.remove(task.item.id)
            future.set_exception(BrokenExecutor("killed"))
        else:
            future.set_result(Done(task.item.id))
        return future


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("slots", [1, 2, 4])
def test_no_more_are_under_way_than_there_is_room_for(slots: int, ahead: bool):
    engine = Engine()
    flow = Flow(engine.submit, slots, TASKS, ahead)
    ended = []
    for done in flow:
        assert len(flow.pending) <= slots
        ended.append(done.item)
    assert sorted(ended) == [task.item.id for task in TASKS] == engine.begun


def test_with_ahead_the_next_is_begun_before_a_result_is_written_down():
    for ahead in (False, True):
        engine = Engine()
        next(iter(Flow(engine.submit, 1, TASKS, ahead)))
        assert engine.begun == (["0", "1"] if ahead else ["0"])


def test_after_a_stop_nothing_is_begun_and_what_is_under_way_comes_in():
    engine = Engine()
    flow = Flow(engine.submit, 2, TASKS, ahead=True)
    ended = []
    for done in flow:
        ended.append(done.item)
        flow.stopped = True
    assert sorted(ended) == sorted(engine.begun)
    assert len(ended) < len(TASKS)


def test_what_is_left_when_the_reader_breaks_off_is_handed_out_to_the_next():
    flow = Flow(Engine().submit, 3, TASKS[:3])
    first = next(iter(flow)).item
    assert sorted([first, *(done.item for done in flow)]) == ["0", "1", "2"]


@pytest.mark.parametrize(("times", "error"), [(1, False), (2, True)])
def test_a_task_whose_worker_died_begins_anew_once(times: int, error: bool):
    engine = Engine("3", times)
    ended = {done.item: done.error for done in Flow(engine.submit, 2, TASKS)}
    assert engine.begun.count("3") == 2
    assert ("died twice" in ended["3"]) == error
    assert [item for item, message in ended.items() if message] == (["3"] if error else [])
