"""A run that is killed at any moment and started again gives what a run gives that was left alone."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from .conftest import contents

KILLS = 20
ITEMS = 200


def start(mist: Path, data: Path, out: Path, *more: str) -> subprocess.Popen[bytes]:
    """A batch in a process group of its own, as a terminal or a scheduler starts it."""
    options = ["image=images/{id}.png", "depth=depth/{id}.png", "encoding=kitti", "labels=labels/{id}.txt"]
    arguments = ["batch", mist, "--data", f"folder:{data}", "-o", out, "--plugins", mist.parent / "stages"]
    arguments += [word for option in options for word in ("--option", option)]
    arguments += ["--sweep", "extinction.visibility=20,40", "--also", "transmission", "--also", "record"]
    arguments += ["--set", "waited.seconds=0.01", "--set", "veil.grain=0.1", "--workers", "2", *more]
    program = [sys.executable, "-c", "from fogpipe.cli.main import main; main()", *map(str, arguments)]
    return subprocess.Popen(program, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def journal_lines(out: Path, shard: str = "1-of-1") -> int:
    path = out / ".fogpipe" / "journal" / f"{shard}.jsonl"
    return len(path.read_bytes().splitlines()) if path.exists() else 0


@pytest.mark.slow
def test_twenty_kills_lose_nothing_and_leave_nothing(photos: Callable[..., Path], mist: Path, tmp_path: Path):
    """Two shards at work on one folder are killed in turn, so that one loads its modules while the other works."""
    data, out = photos(ITEMS), tmp_path / "killed"
    whole = start(mist, data, tmp_path / "whole")
    shards = [Shard(mist, data, out, number) for number in (1, 2)]
    chance = random.Random(7)
    killed_at_work = sum(shards[kill % 2].kill(chance) for kill in range(KILLS))
    for shard in shards:
        shard.process.kill()
        shard.process.wait(10)
    assert start(mist, data, out).wait(240) == whole.wait(240) == 0
    assert killed_at_work >= KILLS // 2
    assert contents(out) == contents(tmp_path / "whole")
    left = {path.relative_to(out / ".fogpipe").as_posix() for path in (out / ".fogpipe").rglob("*")}
    assert left == {"journal", "journal/1-of-1.jsonl", "journal/1-of-2.jsonl", "journal/2-of-2.jsonl"}


class Shard:
    """A batch over one half of the set, that is begun anew whenever it is killed."""

    def __init__(self, mist: Path, data: Path, out: Path, number: int) -> None:
        self.start = partial(start, mist, data, out, "--shard", f"{number}/2", "--workers", "1")
        self.lines = partial(journal_lines, out, f"{number}-of-2")
        self.begin()

    def begin(self) -> None:
        self.before = self.lines()
        self.process = self.start()

    def kill(self, chance: random.Random) -> bool:
        """Kill it at a random moment and begin anew; whether it was at work still."""
        deadline = time.monotonic() + 60
        # Wait for work, so that most kills hit a run and not the start of an interpreter.
        while self.lines() <= self.before + 1 and self.process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(chance.uniform(0, 0.1))
        at_work = self.process.poll() is None
        if chance.random() < 0.5:
            self.process.kill()  # the parent alone: its workers must notice
        else:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(10)
        self.begin()
        return at_work


def test_workers_end_when_their_parent_is_killed(photos: Callable[..., Path], mist: Path, tmp_path: Path):
    process = start(mist, photos(ITEMS), tmp_path / "out")
    try:
        deadline = time.monotonic() + 60
        while journal_lines(tmp_path / "out") < 4:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        workers = children(process.pid)
        assert len(workers) >= 2
        process.kill()
        process.wait(10)
        deadline = time.monotonic() + 20
        while any(Path(f"/proc/{worker}").exists() and not is_zombie(worker) for worker in workers):
            assert time.monotonic() < deadline, "a worker goes on without its parent"
            time.sleep(0.05)
    finally:
        process.kill()


def children(parent: int) -> list[int]:
    if not Path("/proc/self/stat").exists():
        pytest.skip("this system has no /proc to find the workers in")
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent:
            found.append(int(path.parent.name))
    return found


def is_zombie(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True
