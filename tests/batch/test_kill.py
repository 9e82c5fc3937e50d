"""A run that is killed at any moment and started again gives what a run gives that was left alone."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from .conftest import contents

KILLS = 20
ITEMS = 200


def start(mist: Path, data: Path, out: Path) -> subprocess.Popen[bytes]:
    """A batch in a process group of its own, as a terminal or a scheduler starts it."""
    options = ["image=images/{id}.png", "depth=depth/{id}.png", "encoding=kitti", "labels=labels/{id}.txt"]
    arguments = ["batch", mist, "--data", f"folder:{data}", "-o", out, "--plugins", mist.parent / "stages"]
    arguments += [word for option in options for word in ("--option", option)]
    arguments += ["--sweep", "extinction.visibility=20,40", "--also", "transmission", "--also", "record"]
    arguments += ["--set", "waited.seconds=0.01", "--set", "veil.grain=0.1", "--workers", "2"]
    program = [sys.executable, "-c", "from fogpipe.cli.main import main; main()", *map(str, arguments)]
    return subprocess.Popen(program, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def journal_lines(out: Path) -> int:
    path = out / ".fogpipe" / "journal" / "1-of-1.jsonl"
    return len(path.read_bytes().splitlines()) if path.exists() else 0


@pytest.mark.slow
def test_twenty_kills_lose_nothing_and_leave_nothing(photos: Callable[..., Path], mist: Path, tmp_path: Path):
    data = photos(ITEMS)
    assert start(mist, data, tmp_path / "whole").wait(240) == 0
    chance = random.Random(7)
    killed_at_work = 0
    for _ in range(KILLS):
        before = journal_lines(tmp_path / "killed")
        process = start(mist, data, tmp_path / "killed")
        deadline = time.monotonic() + 60
        # Wait for work, so that most kills hit a run and not the start of an interpreter.
        while journal_lines(tmp_path / "killed") <= before + 1 and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        time.sleep(chance.uniform(0, 0.1))
        killed_at_work += process.poll() is None
        if chance.random() < 0.5:
            process.kill()  # the parent alone: its workers must notice
        else:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait(10)
    assert start(mist, data, tmp_path / "killed").wait(240) == 0
    assert killed_at_work >= KILLS // 2
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    files = {path.relative_to(tmp_path / "killed").as_posix() for path in (tmp_path / "killed/.fogpipe").rglob("*")}
    assert files == {".fogpipe/journal", ".fogpipe/journal/1-of-1.jsonl"}


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
