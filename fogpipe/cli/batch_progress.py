"""What a person, or a program, sees of a batch while it goes on."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Any

from fogpipe.batch.estimate import Estimate, estimate
from fogpipe.batch.journal import read_state
from fogpipe.batch.places import place_at
from fogpipe.batch.run import Batch, Summary, Todo, Watcher, find_todo
from fogpipe.batch.work import Done


class BatchProgress(Watcher):
    """A bar with rate, time left and failures on a terminal; lines otherwise. All on standard error."""

    def __init__(self) -> None:
        self.bar: Any = None
        self.failures = 0

    def __enter__(self) -> BatchProgress:
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    def started(self, todo: Todo) -> None:
        self._say(_in_words(todo))
        if sys.stderr.isatty() and todo.tasks:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            rate = TextColumn("{task.fields[rate]}")
            left = TimeRemainingColumn(elapsed_when_finished=True)
            failures = TextColumn("{task.fields[failures]}", style="red")
            columns = (BarColumn(), MofNCompleteColumn(), rate, left, failures)
            self.bar = Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=60)
            self.bar.start()
            self.task = self.bar.add_task("", total=len(todo.tasks), rate="", failures="")

    def done(self, done: Done) -> None:
        if done.error:
            self.failures += 1
            self._say(f"failed: {done.item}: {_shortened(done.error)}")
        if self.bar:
            speed = self.bar.tasks[0].speed
            failures = f"{self.failures} failed" if self.failures else ""
            self.bar.update(self.task, advance=1, failures=failures, rate=f"{speed:.3g}/s" if speed else "")

    def interrupted(self, left: int) -> None:
        self._say(f"interrupted: {left} items under way are finished; the rest is for the next run")

    def finished(self, summary: Summary) -> None:
        if self.bar:
            self.bar.stop()
        memory = f"; a worker held at most {summary.memory / 2**20:.0f} MiB" if summary.memory else ""
        self._say(f"{summary.made} made in {summary.elapsed:.1f} s, {len(summary.failed)} items failed{memory}")
        for line in time_shares(summary):
            self._say(line)

    def _say(self, text: str) -> None:
        if self.bar:
            self.bar.console.print(text, highlight=False, markup=False)
        else:
            print(text, file=sys.stderr)


class JsonLines(Watcher):
    """A line of JSON on standard output for each event."""

    def __enter__(self) -> JsonLines:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def started(self, todo: Todo) -> None:
        self._event("started", **_as_data(todo))

    def done(self, done: Done) -> None:
        if done.error:
            self._event("failed", item=done.item, error=done.error)
        else:
            self._event(
                "done", item=done.item, files=[dict(row.files) for row in done.rows], seconds=dict(done.seconds)
            )

    def interrupted(self, left: int) -> None:
        self._event("interrupted", under_way=left)

    def finished(self, summary: Summary) -> None:
        self._event("finished", **asdict(summary))

    @staticmethod
    def _event(event: str, **facts: Any) -> None:
        print(json.dumps({"event": event, **facts}), flush=True)


def show_estimate(batch: Batch, as_json: bool) -> Estimate | None:
    """Tell what a batch would do; makes some items in a folder of their own and removes them.

    Returns what they took, and None where nothing is left to do.
    """
    place = place_at(batch.job.root)
    state = read_state(place)
    state.drop_missing(place)
    todo = find_todo(batch, place, state)
    taken = estimate(batch, todo) if todo.tasks else None
    if as_json:
        print(json.dumps(_as_data(todo) | {"estimate": asdict(taken) if taken else None}))
        return taken
    print(_in_words(todo), file=sys.stderr)
    for error in taken.errors if taken else ():
        print(f"failed: {_shortened(error)}", file=sys.stderr)
    if taken and taken.trials:
        free = "" if taken.free is None else f" of {_size(taken.free)} that are free"
        print(
            f"about {_duration(taken.seconds)} with {batch.workers} workers, and {_size(taken.bytes)}{free}"
            f" ({taken.trials} items were tried; nothing was kept)",
            file=sys.stderr,
        )
    return taken


def time_shares(summary: Summary) -> list[str]:
    """The share of each stage in the time of the workers, the largest first."""
    whole = summary.seconds.get("whole", 0.0)
    if not whole:
        return []
    inside = {name: seconds for name, seconds in summary.seconds.items() if name != "whole"}
    inside["(the rest)"] = max(0.0, whole - sum(inside.values()))
    whole = sum(inside.values())  # stages that run side by side take more than the wall clock
    return [
        f"  {name:<16} {seconds / whole:6.1%}" for name, seconds in sorted(inside.items(), key=lambda pair: -pair[1])
    ]


def _as_data(todo: Todo) -> dict[str, Any]:
    return {
        "items": todo.items,
        "finished": todo.finished,
        "failed_before": len(todo.failed),
        "to_do": len(todo.tasks),
        "outputs": todo.outputs,
    }


def _in_words(todo: Todo) -> str:
    before = f", {todo.finished} done already" if todo.finished else ""
    failed = f", {len(todo.failed)} failed earlier (--retry-failed tries them again)" if todo.failed else ""
    return f"{todo.items} items{before}{failed}; {len(todo.tasks)} to do, {todo.outputs} outputs"


def _shortened(error: str, most: int = 3) -> str:
    """An error without the lists that some end with: thousands of items may say the same. The journal has all of it."""
    lines = error.splitlines()
    return (
        error
        if len(lines) <= most
        else "\n".join([*lines[:most], f"  … {len(lines) - most} more lines in the journal"])
    )


def _size(amount: float) -> str:
    power = next((power for power in (1, 2) if amount < 1024 ** (power + 1)), 3)
    return f"{amount / 1024**power:.3g} {'KMG'[power - 1]}iB"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {rest:02} s" if minutes else f"{seconds:.1f} s"
