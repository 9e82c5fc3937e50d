"""A batch: what it makes, that nothing but seed and image decides a pixel, and that it goes on where it stopped."""

from __future__ import annotations

import csv
import json
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fogpipe.batch.files import Row
from fogpipe.batch.journal import open_journal, read_state
from fogpipe.batch.places import place_at
from fogpipe.batch.run import Batch, Watcher, run_batch
from fogpipe.errors import RequestError
from fogpipe.io.images import read_image

from .conftest import OPTIONS, contents

Make = Callable[..., Batch]
Photos = Callable[..., Path]
SWEEP = {"sweeps": ["extinction.visibility=20,40"]}


def manifest(folder: Path) -> list[dict[str, str]]:
    with (folder / "manifest.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_outputs_mirror_the_input_with_labels_and_manifest(photos: Photos, make_batch: Make, tmp_path: Path):
    summary = run_batch(make_batch(photos(3), tmp_path / "out", **SWEEP, also=["transmission", "record"]))
    assert (summary.items, summary.made, summary.failed) == (3, 6, {})
    names = {f"images/{n:04}_visibility{v}{end}" for n in range(3) for v in (20, 40) for end in
             (".png", "_transmission.npy", "_record.json")}  # fmt: skip
    labels = {f"labels/{n:04}_visibility{v}.txt" for n in range(3) for v in (20, 40)}
    assert contents(tmp_path / "out").keys() == names | labels | {"manifest.csv", "manifest.parquet"}
    rows = manifest(tmp_path / "out")
    assert [row["hazy"] for row in rows] == sorted(name for name in names if name.endswith("0.png"))
    assert {float(row["extinction"]) for row in rows} == {3 / 20, 3 / 40}


def test_the_manifest_is_also_a_table_of_parquet(photos: Photos, make_batch: Make, tmp_path: Path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    run_batch(make_batch(photos(2), tmp_path / "out", **SWEEP))
    table = parquet.read_table(tmp_path / "out" / "manifest.parquet").to_pydict()
    assert table["extinction.visibility"] == [20, 40, 20, 40]
    assert table["id"] == ["0000", "0000", "0001", "0001"]


def test_a_record_says_how_a_picture_was_made(photos: Photos, make_batch: Make, tmp_path: Path):
    also = ["record", "extinction"]  # a number has no file of its own
    run_batch(make_batch(photos(1), tmp_path / "out", seed=9, also=also, settings=["extinction.visibility=30"]))
    record = json.loads((tmp_path / "out" / "images/0000_record.json").read_text())
    assert record["numbers"] == {"extinction": 0.1}
    assert record["parameters"]["extinction"] == {"visibility": 30}
    assert record["stages"]["veil"] == "mist.veil 1"
    assert {"fogpipe", "python", "numpy"} <= record["versions"].keys()
    assert str(tmp_path) not in json.dumps(record)
    assert record["depth_encoding"] == "kitti"
    assert "Z = v/256 m" in record["notes"][1]
    assert record["seed"] > 0
    assert len(record["pipeline"]["digest"]) == 40
    rows = manifest(tmp_path / "out")
    assert record["sha256"] == rows[0]["sha256"] == contents(tmp_path / "out")["images/0000.png"]


def test_a_batch_gives_what_single_runs_give(photos: Photos, make_batch: Make, mist: Path, tmp_path: Path):
    import fogpipe
    from fogpipe.io.depth import read_depth

    data = photos(1)
    run_batch(make_batch(data, tmp_path / "out", **SWEEP, image_format="npy"))
    pipeline = fogpipe.load(mist, set={"extinction.visibility": 40}, plugins=[mist.parent / "stages"])
    depth = read_depth(data / "depth/0000.png", encoding="kitti").values
    alone = pipeline.run(image=read_image(data / "images/0000.png").pixels, range_map=depth)["hazy"]
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "images/0000_visibility40.npy"), alone)


def test_order_shards_and_processes_change_no_byte(photos: Photos, make_batch: Make, tmp_path: Path):
    data = photos(7)
    options = {"settings": ["veil.grain=0.3"], "seed": 4, "samples": ["extinction.visibility=uniform(20,90)"]}
    run_batch(make_batch(data, tmp_path / "whole", **options))
    for part in (3, 1, 2):
        run_batch(make_batch(data, tmp_path / "parts", **options, shard=(part, 3)))
    run_batch(make_batch(data, tmp_path / "processes", **options, engine="processes", workers=2))
    whole = contents(tmp_path / "whole")
    assert len(whole) == 7 * 2 + 2
    assert contents(tmp_path / "parts") == whole
    assert contents(tmp_path / "processes") == whole


def test_frames_of_a_video_share_their_noise_and_move_with_time(photos: Photos, make_batch: Make, tmp_path: Path):
    reader_options = {"image": "images/{id}.png", "depth": "depth/{id}.png", "encoding": "kitti", "rate": "10"}
    data = photos(3)
    for number in range(3):  # a still camera
        (data / f"images/{number:04}.png").write_bytes((data / "images/0000.png").read_bytes())
        (data / f"depth/{number:04}.png").write_bytes((data / "depth/0000.png").read_bytes())
    options = {"reader_options": reader_options, "settings": ["veil.grain=0.2"], "image_format": "npy"}
    run_batch(make_batch(data, tmp_path / "still", **options))
    still = [np.load(tmp_path / "still" / f"images/000{n}.npy") for n in range(3)]
    np.testing.assert_array_equal(still[0], still[2])
    run_batch(make_batch(data, tmp_path / "moving", **options, binds=["veil.time=time"]))
    moving = [np.load(tmp_path / "moving" / f"images/000{n}.npy") for n in range(3)]
    inner = (moving[2] < 1) & (still[0] > 0)
    # 0.2 s / 100, rounded in float32 sums of values below 1.
    np.testing.assert_allclose((moving[2] - moving[0])[inner], 0.002, atol=2e-7)


def test_a_second_run_makes_what_is_missing_and_nothing_else(photos: Photos, make_batch: Make, tmp_path: Path):
    data, out = photos(4), tmp_path / "out"
    run_batch(make_batch(data, out, **SWEEP))
    before = {path: path.stat().st_mtime_ns for path in out.glob("images/*.png")}
    (out / "images/0002_visibility40.png").unlink()
    summary = run_batch(make_batch(data, out, sweeps=["extinction.visibility=20,40,60"]))
    assert summary.made == 4 + 1
    after = {path: path.stat().st_mtime_ns for path in out.glob("images/*.png")}
    untouched = before.keys() - {out / "images/0002_visibility40.png"}
    assert {path: after[path] for path in untouched} == {path: before[path] for path in untouched}
    assert run_batch(make_batch(data, out, **SWEEP)).made == 0


def test_another_batch_is_not_mixed_into_a_folder(photos: Photos, make_batch: Make, tmp_path: Path):
    data, out = photos(1), tmp_path / "out"
    run_batch(make_batch(data, out, **SWEEP))
    with pytest.raises(RequestError, match="holds the outputs of a batch that differs in seed"):
        run_batch(make_batch(data, out, **SWEEP, seed=5))


def test_two_runs_at_once_do_not_share_a_shard(photos: Photos, make_batch: Make, tmp_path: Path):
    batch = make_batch(photos(1), tmp_path / "out")
    with open_journal(place_at(str(tmp_path / "out")), "1-of-1"):  # noqa: SIM117 - the first is the other run
        with pytest.raises(RequestError, match="another fogpipe batch is at work"):
            run_batch(batch)
    assert run_batch(replace(batch, shard=(1, 1))).made == 1


def test_a_torn_journal_loses_the_torn_line_only(photos: Photos, make_batch: Make, tmp_path: Path):
    data, out = photos(3), tmp_path / "out"
    run_batch(make_batch(data, out))
    journal = out / ".fogpipe" / "journal" / "1-of-1.jsonl"
    journal.write_bytes(journal.read_bytes()[:-40])
    assert run_batch(make_batch(data, out)).made == 1
    assert len(read_state(place_at(str(out))).done) == 3
    assert run_batch(make_batch(data, out)).made == 0


def test_a_journal_of_garbage_is_no_reason_to_stop(photos: Photos, make_batch: Make, tmp_path: Path):
    data, out = photos(1), tmp_path / "out"
    run_batch(make_batch(data, out))
    with (out / ".fogpipe" / "journal" / "1-of-1.jsonl").open("ab") as file:
        file.write(b'\0\0\0\n[]\n{"item": "0000"}\n{"item": 3, "error": "", "rows": [{"no": "row"}]}\n7\n\xff\xfe{')
    assert run_batch(make_batch(data, out)).made == 0


def test_what_is_shared_between_variants_runs_once(photos: Photos, make_batch: Make, tmp_path: Path):
    batch = make_batch(photos(1), tmp_path / "out", sweeps=["extinction.visibility=20,40,60,80"])
    run_batch(batch)
    from fogpipe.batch.job import pipeline_of

    calls = pipeline_of(batch.job).graph.nodes["filled"].contract.function.__globals__["calls"]
    assert calls.count("filled") == 1
    assert calls.count("transmission") == 4


def test_names_that_do_not_tell_variants_apart_are_refused_before_anything_runs(
    photos: Photos, make_batch: Make, tmp_path: Path
):
    with pytest.raises(RequestError, match=r"does not tell the 2 outputs of an item apart.*\{extinction.visibility\}"):
        make_batch(photos(1), tmp_path / "out", **SWEEP, names="{id}.png")
    with pytest.raises(RequestError, match=r"must hold \{path\}, \{id\} or \{name\}"):
        make_batch(photos(1), tmp_path / "out", names="fog.png")


def test_labels_are_linked_copied_or_left_out(photos: Photos, make_batch: Make, tmp_path: Path):
    data = photos(2)
    (data / "labels/0001.txt").write_text("")  # a picture without objects
    for labels in ("link", "copy", "none"):
        run_batch(make_batch(data, tmp_path / labels, labels=labels))
    assert (tmp_path / "link" / "labels/0000.txt").resolve() == data / "labels/0000.txt"
    assert not (tmp_path / "copy" / "labels/0000.txt").is_symlink()
    assert (tmp_path / "copy" / "labels/0000.txt").read_text() == "0 0\n"
    assert (tmp_path / "copy" / "labels/0001.txt").read_text() == ""
    assert not (tmp_path / "none" / "labels").exists()


def test_pictures_may_keep_name_and_format(photos: Photos, make_batch: Make, tmp_path: Path):
    data = photos(2)
    cv2.imwrite(str(data / "images/0001.jpg"), cv2.imread(str(data / "images/0001.png")))
    (data / "images/0001.png").unlink()
    options = {**OPTIONS, "image": "images/{id}.*"}
    run_batch(make_batch(data, tmp_path / "out", names="{path}{suffix}", reader_options=options))
    assert read_image(tmp_path / "out/images/0000.png").description.startswith("8-bit colour PNG")
    assert read_image(tmp_path / "out/images/0001.jpg").description.startswith("8-bit colour JPEG")


def test_files_of_the_whole_set_are_kept(photos: Photos, make_batch: Make, tmp_path: Path):
    data = photos(1)
    (data / "annotations").mkdir()
    (data / "annotations" / "coco.json").write_text("{}")
    batch = make_batch(data, tmp_path / "out", keep={"annotations/coco.json": str(data / "annotations/coco.json")})
    run_batch(batch)
    assert (tmp_path / "out" / "annotations" / "coco.json").read_text() == "{}"


def test_ctrl_c_finishes_what_is_under_way_and_the_next_run_the_rest(photos: Photos, make_batch: Make, tmp_path: Path):
    class Impatient(Watcher):
        def done(self, done):
            raise KeyboardInterrupt

    data, out = photos(4), tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run_batch(make_batch(data, out), Impatient())
    rows = [row for row in read_state(place_at(str(out))).rows if isinstance(row, Row)]
    assert 1 <= len(rows) < 4
    assert len(manifest(out)) == len(rows)
    assert run_batch(make_batch(data, out)).made == 4 - len(rows)


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
def test_ctrl_c_while_a_row_is_written_loses_nothing(photos: Photos, make_batch: Make, tmp_path: Path):
    class Interrupting(Watcher):
        def done(self, done):
            if not done_items:
                os.kill(os.getpid(), signal.SIGINT)
            done_items.append(done.item)

    done_items: list[str] = []
    data, out = photos(6), tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run_batch(make_batch(data, out, engine="processes", workers=2), Interrupting())
    made = {f"images/{path.name}" for path in out.glob("images/*.png")}
    assert {row["hazy"] for row in manifest(out)} == made  # also of what was under way
    assert 1 <= len(made) <= 4  # two workers: what came in first, and what was under way by then
