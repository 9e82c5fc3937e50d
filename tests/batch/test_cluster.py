"""A real Dask scheduler with two real workers on loopback: the same bytes as here, and a worker may die."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fogpipe.batch import engines
from fogpipe.batch.run import Batch, Watcher, run_batch
from fogpipe.errors import RequestError

from .conftest import contents

distributed = pytest.importorskip("distributed", reason="fogpipe[cluster] is not installed")
# What Dask and its own dependencies remark on themselves is not ours to fix.
pytestmark = pytest.mark.filterwarnings("ignore")

Make = Callable[..., Batch]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address of a scheduler, and its two workers, which do not see the folder of the plugins' parent as their own."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    address_file = tmp_path / "scheduler.json"
    python = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(address_file)]
    scheduler = subprocess.Popen([*python, *options], **quiet)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(address_file)]
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path / "dask")]
    workers: list[subprocess.Popen[bytes]] = []
    try:
        wait_for(address_file.exists)
        workers += [subprocess.Popen([*worker, *options], **quiet) for _ in range(2)]
        with distributed.Client(scheduler_file=str(address_file), set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
            address = client.scheduler.address
        yield address.replace("tcp://", "dask://"), workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait(10)


def wait_for(condition: Callable[[], bool], seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_cluster_gives_the_same_bytes_and_may_lose_a_worker(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
    photos: Callable[..., Path],
    make_batch: Make,
    mist: Path,
    tmp_path: Path,
):
    address, workers = cluster
    data = photos(40)
    options = {"sweeps": ["extinction.visibility=20,40"], "settings": ["veil.grain=0.2", "waited.seconds=0.02"]}
    run_batch(make_batch(data, tmp_path / "here", **options))

    batch = make_batch(data, tmp_path / "cluster", **options, engine=address)
    (mist.parent / "stages").rename(mist.parent / "unseen")  # a worker elsewhere does not have this folder
    (mist.parent / "stages").mkdir()
    (mist.parent / "stages" / "mist.py").write_text((mist.parent / "unseen" / "mist.py").read_text())

    class Killer(Watcher):
        count = 0

        def done(self, done):
            self.count += 1
            if self.count == 10:
                os.kill(workers[0].pid, signal.SIGKILL)

    killer = Killer()
    summary = run_batch(batch, killer)
    assert killer.count == 40
    assert workers[0].poll() is not None or workers[0].wait(10) < 0
    assert (summary.made, summary.failed) == (80, {})
    assert contents(tmp_path / "cluster") == contents(tmp_path / "here")


def test_a_scheduler_that_is_not_there_is_one_clear_error(
    photos: Callable[..., Path], make_batch: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(engines, "PATIENCE", 0.5)
    with pytest.raises(RequestError, match=r"there is no Dask scheduler at tcp://127\.0\.0\.1:9"):
        run_batch(make_batch(photos(1), tmp_path / "out", engine="dask://127.0.0.1:9"))
