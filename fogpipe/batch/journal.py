"""What was done, one line of JSON for each item, so that a run that was killed goes on where it stopped.

A line is on the disk before the next item is reported, after the files that it tells of. A line that was torn by a
crash is not read; its item is made again, to the same bytes. Each shard has a file of its own, and what was done is
the union of all files.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

from fogpipe.batch.files import Row
from fogpipe.batch.places import STATE, LocalPlace, Place
from fogpipe.batch.work import Done
from fogpipe.errors import OutputError, RequestError

FOLDER = f"{STATE}/journal"
DRAFTS = f"{STATE}/drafts"


@dataclass
class State:
    """What the journals of a folder say.

    Attributes
    ----------
    done : rows by item and variant.
    failed : the last error of each item that has not been done since.
    jobs : what shaped the outputs, one for each run.
    """

    done: dict[str, dict[str, Row]] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    jobs: list[dict[str, Any]] = field(default_factory=list)

    def add(self, entry: Mapping[str, Any]) -> None:
        """Take in one line."""
        if "job" in entry:
            self.jobs.append(entry["job"])
        elif entry["error"]:
            self.failed[entry["item"]] = entry["error"]
        else:
            self.failed.pop(entry["item"], None)
            rows = [Row(**row) for row in entry["rows"]]
            self.done.setdefault(entry["item"], {}).update({row.variant: row for row in rows})

    @property
    def rows(self) -> list[Row]:
        """Every row, in the order of items and variants."""
        return [rows[variant] for _, rows in sorted(self.done.items()) for variant in sorted(rows)]

    def drop_missing(self, place: Place) -> None:
        """Forget variants whose files are not all there, so that they are made again."""
        missing = place.missing({path for row in self.rows for path in row.files.values()})
        for item, rows in list(self.done.items()):
            self.done[item] = {key: row for key, row in rows.items() if not missing.intersection(row.files.values())}


def read_state(place: Place) -> State:
    """What all journals of a place say together."""
    state = State()
    for file in place.listed(FOLDER):
        for line in place.read(file).splitlines() if file.endswith(".jsonl") else ():
            with suppress(ValueError, TypeError, KeyError):  # torn, or written over by a failing disk
                state.add(json.loads(line))
    return state


class Journal:
    """The journal of one shard, open for writing."""

    def write(self, entry: Mapping[str, Any]) -> None:
        """Add a line."""
        raise NotImplementedError

    def flush(self) -> None:
        """Bring all lines to their place, where they are gathered."""

    def job(self, settled: Mapping[str, Any]) -> None:
        """Say what shapes the outputs from here on."""
        self.write({"job": settled})

    def done(self, done: Done) -> None:
        """Say what became of an item."""
        self.write({"item": done.item, "error": done.error, "rows": [asdict(row) for row in done.rows]})


@contextmanager
def open_journal(place: Place, shard: str) -> Iterator[Journal]:
    """The journal of a shard; nobody else writes to it meanwhile.

    Raises
    ------
    RequestError
        If another process is at work on the same shard of the same folder.
    """
    if not isinstance(place, LocalPlace):
        journal = _RemoteJournal(place, shard)
        try:
            yield journal
        finally:
            journal.flush()
        return
    path = Path(place.root, FOLDER, f"{shard}.jsonl")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("ab+")
    except OSError as error:
        raise OutputError(f"cannot write to {place.root}: {error.strerror}. Choose another folder with -o.") from error
    with file:
        if not _locked(file):
            raise RequestError(f"another fogpipe batch is at work in {place.root}; wait for it, or use another folder.")
        _remove_drafts(Path(place.root, DRAFTS), path)
        try:
            yield _LocalJournal(file)
        finally:
            shutil.rmtree(Path(place.root, DRAFTS, shard), ignore_errors=True)
            with suppress(OSError):
                Path(place.root, DRAFTS).rmdir()


class _LocalJournal(Journal):
    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        if file.tell():
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.write(b"\n")  # ends a line that a crash has torn

    def write(self, entry: Mapping[str, Any]) -> None:
        try:
            self._file.write(json.dumps(entry).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise OutputError(
                f"the journal cannot be written: {error.strerror}. Free some space, and resume."
            ) from error


class _RemoteJournal(Journal):
    """An object store cannot append: lines are gathered for some seconds, and each batch of them is a file."""

    LONGEST = 10.0

    def __init__(self, place: Place, shard: str) -> None:
        self._place = place
        self._name = f"{FOLDER}/{shard}-{time.time_ns()}"
        self._lines: list[str] = []
        self._parts = 0
        self._last = time.monotonic()

    def write(self, entry: Mapping[str, Any]) -> None:
        self._lines.append(json.dumps(entry) + "\n")
        if time.monotonic() - self._last > self.LONGEST:
            self.flush()

    def flush(self) -> None:
        if self._lines:
            self._place.write_text(f"{self._name}-{self._parts:06}.jsonl", "".join(self._lines))
            self._lines, self._parts = [], self._parts + 1
        self._last = time.monotonic()


def _locked(file: IO[bytes]) -> bool:
    """Take the lock of a journal for as long as it is open; True where the system has no locks."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _remove_drafts(drafts: Path, own: Path) -> None:
    """Remove what killed runs left: the drafts of this shard, and of every other that nobody is at work on."""
    for folder in _folders(drafts):
        journal = own.with_name(f"{folder.name}.jsonl")
        if journal == own:
            shutil.rmtree(folder, ignore_errors=True)
            continue
        with suppress(OSError), journal.open("ab") as file:
            if _locked(file):
                shutil.rmtree(folder, ignore_errors=True)


def _folders(parent: Path) -> Iterable[Path]:
    return [folder for folder in parent.iterdir() if folder.is_dir()] if parent.is_dir() else ()
