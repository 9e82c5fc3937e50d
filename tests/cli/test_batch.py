"""``fogpipe batch`` and ``fogpipe datasets`` as a person calls them."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.batch.conftest import contents, mist, photos

__all__ = ["mist", "photos"]


@pytest.fixture
def words(mist: Path, photos: Callable[..., Path], tmp_path: Path) -> list[Any]:
    """A command line over four photos in this process."""
    reader = ["--option", "image=images/{id}.png", "--option", "depth=depth/{id}.png", "--option", "encoding=kitti"]
    plugins = ["--plugins", mist.parent / "stages"]
    return [
        "batch",
        mist,
        "--data",
        f"folder:{photos(4)}",
        *reader,
        *plugins,
        "-o",
        tmp_path / "out",
        "--engine",
        "here",
    ]


def test_a_batch_tells_what_it_did_and_where_the_time_went(fogpipe_cli, words: list[Any], tmp_path: Path):
    ended = fogpipe_cli(*words, "--sweep", "extinction.visibility=20,40")
    assert ended.code == 0, ended.err
    assert "4 items; 4 to do, 8 outputs" in ended.err
    assert "8 made" in ended.err
    shares = [line.split() for line in ended.err.splitlines() if line.endswith("%")]
    assert {"reading", "writing", "veil", "(the"} <= {share[0] for share in shares}
    assert sum(float(share[-1].rstrip("%")) for share in shares) == pytest.approx(100, abs=0.1 * len(shares))
    assert len(contents(tmp_path / "out")) == 8 + 2
    assert "4 done already; 0 to do" in fogpipe_cli(*words, "--sweep", "extinction.visibility=20,40").err


def test_events_are_lines_of_json(fogpipe_cli, words: list[Any], tmp_path: Path):
    (tmp_path / "photos" / "images" / "0001.png").write_bytes(b"")
    ended = fogpipe_cli(*words, "--json")
    events = [json.loads(line) for line in ended.out.splitlines()]
    assert ended.code == 1
    assert [event["event"] for event in events] == ["started", "done", "failed", "done", "done", "finished"]
    assert "is empty" in events[2]["error"]
    assert events[-1]["made"] == 3
    assert "1 of 4 items failed" in ended.err


def test_a_long_error_is_shortened_and_whole_in_the_journal(fogpipe_cli, words: list[Any], tmp_path: Path):
    table = tmp_path / "photos" / "set.csv"
    table.write_text("id,image,range_map,encoding\n1,images/0000.png,depth/0000.png,kity\n")
    words = [*words[:2], "--data", f"csv:{table}", "--plugins", tmp_path / "mist/stages", "-o", tmp_path / "out"]
    ended = fogpipe_cli(*words, "--engine", "here")
    assert 'failed: 1: no depth encoding "kity". Did you mean "kitti"?' in ended.err
    assert re.search(r"… \d+ more lines in the journal", ended.err)
    assert "virtual-kitti-2" not in ended.err
    assert "virtual-kitti-2" in (tmp_path / "out/.fogpipe/journal/1-of-1.jsonl").read_text()


def test_a_dry_run_reckons_and_keeps_nothing(fogpipe_cli, words: list[Any], tmp_path: Path):
    ended = fogpipe_cli(*words, "--dry-run", "--json")
    told = json.loads(ended.out)
    assert told["to_do"] == 4
    assert told["estimate"]["trials"] > 0
    assert told["estimate"]["seconds"] > 0
    assert told["estimate"]["free"] > 0
    assert not (tmp_path / "out").exists()
    assert fogpipe_cli(*words).code == 0
    size = sum(path.stat().st_size for path in (tmp_path / "out/images").glob("*.png"))
    # The pictures are noise, which compresses alike.
    assert told["estimate"]["bytes"] == pytest.approx(size, rel=0.1)
    assert "0 to do" in fogpipe_cli(*words, "--dry-run").err
    again = fogpipe_cli(*words, "--dry-run", "-o", tmp_path / "elsewhere").err
    assert re.search(r"about [\d.]+ s with \d+ workers, and [\d.]+ KiB of [\d.e+]+ .iB that are free", again)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--also", "density"], "--to or --also density: there is no such output. There is: hazy"),
        (["--to", "transmission"], "the result of a batch is a picture"),
        (["--labels", "move"], "choose link, copy or none"),
        (["--shard", "3/2"], "write it as I/N"),
        (["--engine", "threads"], "choose processes, here or dask://HOST:PORT"),
        (["--option", "image"], "write it as NAME=VALUE"),
        (["--sweep", "fog.visibility=1,2"], '--sweep fog.visibility\n  there is no stage "fog"'),
        (["--sample", "extinction.visibilty=uniform(1,2)"], "--sample extinction.visibilty\n  is not a parameter"),
        (["--set", "extinction.visibility=9", "--sweep", "extinction.visibility=1,2"], "--set sets it too"),
        (["--sweep", "extinction.visibility=1,-2"], "should be greater than 0, not -2"),
        (["--image-format", "jpg", "--names", "{id}.png"], 'the names end in ".png"'),
        (["--names", "../{path}.png"], "not a path below the folder of the outputs"),
        (["--names", "{id}.gif"], "--image-format gif: choose one of"),
        (["--keep", "annotations/*.json"], "no file of"),
        (["--map-format", "png", "--also", "range"], "a PNG holds values in [0, 1] only"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_runs(
    fogpipe_cli, words: list[Any], tmp_path: Path, more: list[str], message: str
):
    ended = fogpipe_cli(*words, *more)
    assert ended.code == 2
    assert message in ended.err
    assert not list(tmp_path.glob("out/images/*.png"))


def test_a_parameter_is_not_sampled_over_a_column_of_a_table(fogpipe_cli, words: list[Any], tmp_path: Path):
    table = tmp_path / "photos" / "set.csv"
    row = "images/0000.png,depth/0000.png,kitti"
    table.write_text(f"id,image,range_map,encoding,extinction.visibility\n1,{row},\n2,{row},40\n")
    words = [*words[:2], "--data", f"csv:{table}", "--plugins", tmp_path / "mist/stages", "-o", tmp_path / "out"]
    words += ["--engine", "here"]
    ended = fogpipe_cli(*words, "--sample", "extinction.visibility=uniform(20, 30)")
    assert ended.code == 2
    assert f"--sample extinction.visibility: {table} sets it too, to 40 for 2; leave one of them out." in ended.err
    assert not (tmp_path / "out").exists()
    assert fogpipe_cli(*words, "--set", "extinction.visibility=20").code == 0  # for the rows that say nothing
    rows = (tmp_path / "out" / "manifest.csv").read_text().splitlines()
    assert len(rows) == 3


def test_a_problem_of_a_column_names_the_item(fogpipe_cli, words: list[Any], tmp_path: Path):
    table = tmp_path / "photos" / "set.csv"
    table.write_text("id,image,range_map,encoding,extinction.visibilty\n1,images/0000.png,depth/0000.png,kitti,4\n")
    words = [*words[:2], "--data", f"csv:{table}", "--plugins", tmp_path / "mist/stages", "-o", tmp_path / "out"]
    ended = fogpipe_cli(*words, "--engine", "here")
    assert ended.code == 1
    assert "1: extinction.visibilty" in ended.err


def test_a_dry_run_in_which_items_fail_ends_with_1(fogpipe_cli, words: list[Any], tmp_path: Path):
    (tmp_path / "photos" / "images" / "0000.png").write_bytes(b"")
    ended = fogpipe_cli(*words, "--dry-run")
    assert ended.code == 1
    assert "1 of 3 items that were tried failed; nothing was kept." in ended.err
    assert not (tmp_path / "out").exists()


def test_ctrl_c_ends_a_batch_well(words: list[Any], tmp_path: Path):
    words[words.index("here")] = "processes"
    program = [sys.executable, "-c", "from fogpipe.cli.main import main; main()", *map(str, words)]
    program += ["--workers", "1", "--set", "waited.seconds=1.5"]
    process = subprocess.Popen(program, start_new_session=True, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("out/images/*.png")):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"interrupted: 1 items under way are finished" in said
    assert b"Traceback" not in said
    made = len(list(tmp_path.glob("out/images/*.png")))
    assert 1 <= made < 4
    assert len((tmp_path / "out" / "manifest.csv").read_text().splitlines()) == 1 + made
    assert not (tmp_path / "out" / ".fogpipe" / "drafts").exists()


def test_readers_are_listed_and_shown(fogpipe_cli):
    listed = fogpipe_cli("datasets")
    assert listed.code == 0
    assert {"kitti", "cityscapes", "csv"} <= {line.split()[0] for line in listed.out.splitlines()}
    card = fogpipe_cli("datasets", "kitti").out
    assert "    2011_09_26/calib_cam_to_cam.txt" in card
    assert "| `--option depth=…` | depth_2 | the folder of the object detection set that holds depth. |" in card
    assert "::" not in card
    assert "-----\n" not in card
    rows = json.loads(fogpipe_cli("datasets", "--json").out)["datasets"]
    assert next(row for row in rows if row["name"] == "cityscapes")["options"] == ["split", "labels"]
    assert fogpipe_cli("datasets", "kiti").code == 2
