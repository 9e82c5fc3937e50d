"""The commands about data sets that the pages print do what the pages say: each is run, on tiny sets."""

from __future__ import annotations

import os
import shlex
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cli.conftest import fogpipe_cli
from tests.test_docs import ROOT, blocks, commands, pipelines, stage_modules

__all__ = ["fogpipe_cli"]

HOW_TO = ROOT / "docs" / "how-to"
SIZE = (20, 32)
CAMERA = '{"fx": 30, "fy": 30, "cx": 15.5, "cy": 9.5}'
TABLE = "set.csv"


def picture(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.random.default_rng(1).integers(30, 200, (*SIZE, 3), np.uint8))


def depth(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.tile(np.linspace(9000, 2560, SIZE[0]).astype(np.uint16)[:, None], SIZE[1]))


def text(path: Path, content: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the data sets that the pages speak of."""
    for number in range(3):
        picture(tmp_path / f"kitti/training/image_2/{number:06}.png")
        depth(tmp_path / f"kitti/training/depth_2/{number:06}.png")
        text(tmp_path / f"kitti/training/calib/{number:06}.txt", "P2: 30 0 15.5 0 0 30 9.5 0 0 0 1 0\n")
        text(tmp_path / f"kitti/training/label_2/{number:06}.txt", "Car 0.00 0\n")
    for number in (1, 2):
        picture(tmp_path / f"mine/rgb/street/{number:04}.jpg")
        depth(tmp_path / f"mine/depth/street/{number:04}.png")
        text(tmp_path / f"mine/yolo/street/{number:04}.txt", "0 0.5 0.5 1 1\n")
    text(tmp_path / "mine/camera.json", CAMERA)
    picture(tmp_path / "logs/drive7/left/000012.jpg")
    depth(tmp_path / "logs/drive7/left/000012.depth.png")
    text(tmp_path / "logs/drive7/camera.json", CAMERA)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_files_of(page: Path) -> None:
    """The stages, pipelines and tables that a page shows."""
    Path("stages").mkdir()
    for subject, module in modules(page).items():
        Path("stages", f"{subject}.py").write_text(module, encoding="utf-8")
    for pipeline in pipelines(page):
        Path(pipeline.partition("\n")[0].removeprefix("# ")).write_text(pipeline, encoding="utf-8")
    for block in blocks(page, "text"):
        if block.startswith("id,"):
            Path("mine", TABLE).write_text(block, encoding="utf-8")


def modules(page: Path) -> dict[str, str]:
    readers = [block for block in blocks(page, "python") if "@reader(" in block]
    return stage_modules(page) | {block.partition('@reader("')[2].partition('"')[0]: block for block in readers}


def run_all(page: Path, fogpipe_cli: Callable, *more: str) -> list[list[str]]:
    found = list(commands(page))
    assert found
    for words in found:
        ended = fogpipe_cli(*words, *(more if words[0] == "batch" else ()))
        assert ended.code == 0, f"{shlex.join(words)}\n{ended.err}"
    return found


def test_foggy_kitti(here: Path, fogpipe_cli: Callable):
    page = HOW_TO / "foggy-kitti.md"
    run_all(page, fogpipe_cli, "--engine", "here")  # one page in this process, for the sake of time
    assert (here / "foggy/training/image_2/000000_visibility50.png").is_file()
    assert (here / "foggy/training/image_2/000000_visibility50_transmission.npy").is_file()
    assert (here / "foggy/training/label_2/000000_visibility50.txt").read_text() == "Car 0.00 0\n"
    assert len((here / "foggy/manifest.csv").read_text().splitlines()) == 1 + 9
    assert (here / "named/training/image_2/000002_foggy_vis100.jpg").is_file()
    name = "000001_leftImg8bit_transmittance_beta_0.02.png"
    assert (here / "cityscapes-like/leftImg8bit_transmittance/training/image_2" / name).is_file()
    assert len(list((here / "drawn/training/image_2").iterdir())) == 3


def test_your_own_data_set(here: Path, fogpipe_cli: Callable):
    page = HOW_TO / "your-own-data-set.md"
    write_files_of(page)
    shown, moving, table = commands(page)
    assert fogpipe_cli(*shown).code == 0
    assert (here / "foggy/rgb/street/0001.png").is_file()
    assert (here / "foggy/yolo/street/0001.txt").is_file()
    assert fogpipe_cli(*moving, "--engine", "here").code == 0
    first, second = (cv2.imread(str(here / f"moving/rgb/street/000{n}.png")).astype(float) for n in (1, 2))
    # A tenth of a second later the fog has moved by 0.2 m of its 30 m: no pixel changes by more than a few levels.
    assert 0 < np.abs(second - first).max() < 8
    assert fogpipe_cli(*table[:-1], "from-table", "--engine", "here").code == 0
    assert (here / "from-table/street/2.png").is_file()


def test_write_a_reader(here: Path, fogpipe_cli: Callable):
    page = HOW_TO / "write-a-reader.md"
    write_files_of(page)
    run_all(page, fogpipe_cli)
    assert (here / "foggy/drive7/left/000012.png").is_file()


@pytest.mark.filterwarnings("ignore")  # of Dask about itself
def test_a_dask_cluster(here: Path, fogpipe_cli: Callable):
    distributed = pytest.importorskip("distributed", reason="fogpipe[cluster] is not installed")
    page = HOW_TO / "run-on-a-dask-cluster.md"
    printed = [line.split() for text in blocks(page, "console") for line in text.splitlines()]
    (batch,) = commands(page)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    started = []
    try:
        for words in (words for words in printed if words[0] == "dask"):
            command = [sys.executable, "-m", *[word.replace("8786", port) for word in words]]
            started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        with distributed.Client(f"tcp://127.0.0.1:{port}", timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        ended = fogpipe_cli(*[word.replace("8786", port) for word in batch])
    finally:
        for process in reversed(started):
            process.terminate()
        for process in reversed(started):
            process.wait(30)
    assert len(started) == 2
    assert ended.code == 0, ended.err
    assert len(list((here / "foggy/training/image_2").iterdir())) == 6


def test_the_python_interface(here: Path):
    (program,) = [block for block in blocks(ROOT / "docs/reference/python.md", "python") if "run_batch" in block]
    (here / "program.py").write_text(program)
    ended = subprocess.run([sys.executable, "program.py"], capture_output=True, text=True, timeout=120)
    assert ended.stdout == "6 {}\n", ended.stderr


def test_slurm(here: Path):
    script, afterwards = blocks(HOW_TO / "run-on-slurm.md", "bash")
    binaries = here / "bin"
    binaries.mkdir()
    (binaries / "fogpipe").write_text(
        f'#!/bin/sh\nexec {sys.executable} -c "from fogpipe.cli.main import main; main()" "$@"\n'
    )
    (binaries / "fogpipe").chmod(0o755)
    environment = os.environ | {"PATH": f"{binaries}:{os.environ['PATH']}", "SLURM_ARRAY_TASK_COUNT": "2"}

    def run(lines: str, **more: str) -> str:
        command = ["bash", "-e", "-c", lines]
        ended = subprocess.run(command, env=environment | more, capture_output=True, text=True, timeout=120)
        assert ended.returncode == 0, ended.stderr
        return ended.stderr

    assert "2 items; 2 to do, 4 outputs" in run(script, SLURM_ARRAY_TASK_ID="1")
    assert "1 items; 1 to do, 2 outputs" in run(script, SLURM_ARRAY_TASK_ID="2")
    assert "3 items, 3 done already; 0 to do" in run(afterwards)
    assert len((here / "foggy/manifest.csv").read_text().splitlines()) == 1 + 6
