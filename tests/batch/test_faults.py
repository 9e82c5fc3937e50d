"""What goes wrong costs the item that it happens to, is named, and nothing else."""

from __future__ import annotations

import csv
import errno
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from fogpipe.batch.places import LocalPlace
from fogpipe.batch.run import Batch, run_batch
from fogpipe.errors import OutputError, RequestError

from .conftest import contents

Make = Callable[..., Batch]
Photos = Callable[..., Path]
CAMERA = {"fx": 16, "fy": 16, "cx": 7.5, "cy": 5.5}


@pytest.fixture
def table(photos: Photos) -> Path:
    """A table of 50 good items and one of each kind of bad ones."""
    root = photos(50)
    (root / "camera.json").write_text(json.dumps(CAMERA))
    good = (root / "images/0000.png").read_bytes()
    (root / "empty.png").write_bytes(b"")
    (root / "truncated.png").write_bytes(good[: len(good) // 2])
    cv2.imwrite(str(root / "other-size.png"), np.full((5, 5, 3), 90, np.uint8))
    np.save(root / "nan.npy", np.full((12, 16), np.nan, np.float32))
    (root / "wrong-camera.json").write_text('{"fx": "sixteen", "fy": 16, "cx": 7.5, "cy": 5.5}')
    rows = [{"id": f"good/{n:04}", "image": f"images/{n:04}.png", "range_map": f"depth/{n:04}.png"} for n in range(50)]
    fine = {"image": "images/0000.png", "range_map": "depth/0000.png"}
    rows[7:7] = [
        {**fine, "id": "bad/empty", "image": "empty.png"},
        {**fine, "id": "bad/truncated", "image": "truncated.png"},
        {**fine, "id": "bad/other-size", "image": "other-size.png"},
        {**fine, "id": "bad/nan", "range_map": "nan.npy", "encoding": "metres"},
        {**fine, "id": "bad/missing", "range_map": "depth/none.png"},
        {**fine, "id": "bad/camera", "camera": "wrong-camera.json"},
        {**fine, "id": "../outside"},
        {**fine, "id": "linked/outside"},
        {**fine, "id": "bad/parameter", "extinction.visibility": "-5"},
    ]
    columns = ("id", "image", "range_map", "encoding", "camera", "extinction.visibility")
    with (root / "set.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows({"encoding": "kitti", "camera": "camera.json", **row} for row in rows)
    return root / "set.csv"


def test_bad_items_among_fifty_good_ones(table: Path, make_batch: Make, tmp_path: Path):
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (out / "linked").symlink_to(elsewhere)
    summary = run_batch(make_batch(f"csv:{table}", out))
    assert summary.made == 50
    assert len(list((out / "good").iterdir())) == 50
    reasons = {
        "bad/empty": "empty.png: is empty",
        "bad/truncated": "truncated.png: cannot be decoded",
        "bad/other-size": "all inputs of a run must have the same height and width",
        "bad/nan": "no pixel holds a depth",
        "bad/missing": "depth/none.png: there is no such file",
        "bad/camera": "wrong-camera.json: fx is 'sixteen'",
        "../outside": "not a path below the folder of the outputs",
        "linked/outside": "a link on the way leads out of",
        "bad/parameter": "should be greater than 0, not -5",
    }
    assert summary.failed.keys() == reasons.keys()
    for item, reason in reasons.items():
        assert reason in summary.failed[item], item
    assert not list(elsewhere.iterdir())
    assert not (tmp_path / "outside.png").exists()
    assert not (out / "bad").exists()


def test_what_failed_is_tried_again_when_asked(table: Path, make_batch: Make, tmp_path: Path):
    out = tmp_path / "out"
    run_batch(make_batch(f"csv:{table}", out))
    again = run_batch(make_batch(f"csv:{table}", out))
    assert (again.made, len(again.failed)) == (0, 8)
    (table.parent / "empty.png").write_bytes((table.parent / "images/0001.png").read_bytes())
    retried = run_batch(make_batch(f"csv:{table}", out, retry_failed=True))
    assert (retried.made, len(retried.failed)) == (1, 7)
    assert "bad/empty" not in run_batch(make_batch(f"csv:{table}", out)).failed


def test_too_many_failures_stop_the_run(table: Path, make_batch: Make, tmp_path: Path):
    summary = run_batch(make_batch(f"csv:{table}", tmp_path / "out", max_failures=3))
    assert len(summary.failed) == 3
    assert "--max-failures" in summary.stopped
    assert summary.made < 50


def test_nothing_of_the_set_is_written_over(photos: Photos, make_batch: Make, tmp_path: Path):
    data = photos(2)
    before = contents(data)
    with pytest.raises(RequestError, match="is the folder of the data set itself"):
        make_batch(data, tmp_path / "out" / ".." / "photos")
    (data / "set.csv").write_text("id,image,range_map,encoding\nimages/0000,images/0000.png,depth/0000.png,kitti\n")
    summary = run_batch(make_batch(f"csv:{data / 'set.csv'}", data))
    assert "images/0000.png: is part of the data set" in summary.failed["images/0000"]
    assert {name: digest for name, digest in contents(data).items() if name in before} == before


def killing(photos: Photos, count: int, white: int) -> Path:
    """Photos of which one is white, which the stage ``mist.accident`` kills its process for."""
    data = photos(count)
    cv2.imwrite(str(data / f"images/{white:04}.png"), np.full((12, 16, 3), 255, np.uint8))
    return data


def test_a_worker_that_is_killed_once_costs_nothing(photos: Photos, make_batch: Make, tmp_path: Path):
    data = killing(photos, 5, white=1)
    settings = [f"whole.flag={tmp_path / 'killed-1'}"]
    summary = run_batch(make_batch(data, tmp_path / "out", settings=settings, engine="processes", workers=2))
    assert (tmp_path / "killed-1").read_text() == "xx"
    assert (summary.made, summary.failed) == (5, {})


def test_an_item_that_kills_every_worker_costs_itself(photos: Photos, make_batch: Make, tmp_path: Path):
    data = killing(photos, 5, white=1)
    settings = [f"whole.flag={tmp_path / 'killed-99'}"]
    summary = run_batch(make_batch(data, tmp_path / "out", settings=settings, engine="processes", workers=2))
    assert summary.made == 4
    assert "its worker died twice" in summary.failed["0001"]
    assert not [name for name in contents(tmp_path / "out") if ".fogpipe" in name]


def test_a_full_disk_stops_the_run_and_blames_no_item(
    photos: Photos, make_batch: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    published = LocalPlace.publish
    room = [2]

    def publish(place: LocalPlace, file: Path, relative: str) -> None:
        if relative.endswith(".png") and not room[0]:
            raise OutputError("no space") from OSError(errno.ENOSPC, "No space left on device")
        room[0] -= relative.endswith(".png")
        published(place, file, relative)

    monkeypatch.setattr(LocalPlace, "publish", publish)
    data = photos(4)
    summary = run_batch(make_batch(data, tmp_path / "out"))
    assert (summary.made, summary.failed, summary.stopped) == (2, {}, "no space")
    room[0] = 99
    assert run_batch(make_batch(data, tmp_path / "out")).made == 2
