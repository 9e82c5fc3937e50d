"""What a person sees of a run, on standard error: a bar on a terminal, plain lines otherwise."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fogpipe.runtime.events import Observer, StageReport


class Progress(Observer):
    """Shows the stages of a run as they go.

    Parameters
    ----------
    total : number of stages.
    """

    def __init__(self, total: int) -> None:
        self.total = total
        self.bar: Any = None

    def __enter__(self) -> Progress:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
            from rich.progress import Progress as Bar

            columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
            self.bar = Bar(*columns, console=Console(stderr=True), transient=True)
            self.bar.start()
            self.task = self.bar.add_task("reading", total=self.total)
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    def started(self, name: str) -> None:
        if self.bar:
            self.bar.update(self.task, description=name)

    def finished(self, report: StageReport) -> None:
        line = f"{report.name:<16} {report.use:<24} {_how(report)}"
        if self.bar:
            self.bar.console.print(line, highlight=False, markup=False)
            self.bar.advance(self.task)
        else:
            print(line, file=sys.stderr)


def _how(report: StageReport) -> str:
    if report.status == "skipped":
        return f"skipped: {report.reason}"
    return f"{report.seconds * 1000:8.1f} ms{'  (cache)' if report.status == 'cached' else ''}"


def summarise(record: Mapping[str, Any], folder: Path) -> None:
    """Notes on the inputs, and what was written where."""
    for note in record["notes"]:
        print(f"note: {note}", file=sys.stderr)
    for name, output in record["outputs"].items():
        value = ", ".join(f"{item:.5g}" for item in _flat(output["value"])) if "value" in output else ""
        print(f"{name}: {value or folder / output['file']}", file=sys.stderr)
    print(f"{record['seconds']:.2f} s; the record is {folder / 'run.json'}", file=sys.stderr)


def _flat(value: Any) -> list[float]:
    return [number for item in value for number in _flat(item)] if isinstance(value, list) else [value]
