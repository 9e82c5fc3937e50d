"""Tasks on their way through an engine: so many at once, begun anew where a worker died, and ended well by Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager

from fogpipe.batch.engines import worker_died
from fogpipe.batch.job import Task
from fogpipe.batch.work import Done

ATTEMPTS = 2
"""Workers that one item may cost: the first may have been killed for what another program did."""


class Flow:
    """Results of tasks as they come in, while never more than ``slots`` are under way.

    Parameters
    ----------
    submit : begins a task.
    ahead : begin the next tasks before results are handed out, so that no worker waits while those are written down.

    Attributes
    ----------
    pending : what is under way, with the number of the attempt.
    stopped : set it to begin nothing any more.
    """

    def __init__(
        self, submit: Callable[[Task], Future[Done]], slots: int, tasks: Sequence[Task], ahead: bool = False
    ) -> None:
        self.submit = submit
        self.slots = slots
        self.tasks = iter(tasks)
        self.ahead = ahead
        self.pending: dict[Future[Done], tuple[Task, int]] = {}
        self.results: deque[Done] = deque()
        self.stopped = False
        self._waiting = False
        self._interrupted = False

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Let the first Ctrl-C come through only while nothing is being written down; a second one comes at once."""

        def on_interrupt(*_: object) -> None:
            if self._waiting or self._interrupted:
                raise KeyboardInterrupt
            self._interrupted = True

        if threading.current_thread() is not threading.main_thread():  # which alone hears signals
            yield
            return
        usual = signal.signal(signal.SIGINT, on_interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, usual)

    def __iter__(self) -> Iterator[Done]:
        while True:
            if self.ahead or not self.results:
                self._begin()
            if self.results:
                yield self.results.popleft()
            elif self.pending:
                self.results.extend(filter(None, map(self._taken, self._completed())))
            else:
                return

    def _begin(self) -> None:
        while not self.stopped and len(self.pending) < self.slots and (task := next(self.tasks, None)):
            self.pending[self.submit(task)] = task, 1

    def _completed(self) -> Collection[Future[Done]]:
        self._waiting = True
        try:
            if self._interrupted:
                self._interrupted = False
                raise KeyboardInterrupt
            return wait(self.pending, return_when=FIRST_COMPLETED).done
        finally:
            self._waiting = False

    def _taken(self, future: Future[Done]) -> Done | None:
        """The result of a call; None where its worker died and it begins anew."""
        task, attempt = self.pending.pop(future)
        error = future.exception()
        if error is None:
            return future.result()
        if worker_died(error) and attempt < ATTEMPTS:
            self.pending[self.submit(task)] = task, attempt + 1
            return None
        died = "its worker died twice: killed, or out of memory. Use fewer --workers."
        return Done(task.item.id, error=died if worker_died(error) else str(error))
