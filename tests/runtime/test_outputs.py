"""A folder holds the files of one run, all of them or none."""

from __future__ import annotations

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from fogpipe.errors import OutputError
from fogpipe.runtime.outputs import RECORD_NAME, file_digest, publish, staging


def write_run(folder: Path, files: dict[str, str]) -> list[str]:
    """Publish text files and a record of them; what went is returned."""
    with staging(folder) as draft:
        for name, text in files.items():
            (draft / name).write_text(text)
        outputs = {name: {"file": name, "sha256": file_digest(draft / name)} for name in files}
        (draft / RECORD_NAME).write_text(json.dumps({"outputs": outputs, "options": {"sheet": False}}))
        return publish(draft, folder)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_files_of_an_older_run_go_when_the_new_ones_come(tmp_path: Path):
    assert write_run(tmp_path, {"a.png": "old", "b.npy": "old"}) == []
    assert write_run(tmp_path, {"a.png": "new"}) == ["b.npy"]
    assert names(tmp_path) == {"a.png", RECORD_NAME}
    assert (tmp_path / "a.png").read_text() == "new"


def test_files_of_others_and_files_that_were_changed_stay(tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    write_run(tmp_path, {"a.png": "old", "b.npy": "old"})
    (tmp_path / "b.npy").write_text("changed by hand")
    write_run(tmp_path, {"c.png": "new"})
    assert names(tmp_path) == {"mine.txt", "b.npy", "c.png", RECORD_NAME}


def fail_while_writing(folder: Path) -> None:
    with staging(folder) as draft:
        (draft / "a.png").write_text("half")
        raise OSError(28, "No space left on device")


def test_a_failure_while_writing_leaves_what_was_there(tmp_path: Path):
    write_run(tmp_path, {"a.png": "old"})
    with pytest.raises(OutputError, match="No space left"):
        fail_while_writing(tmp_path)
    assert (tmp_path / "a.png").read_text() == "old"
    assert names(tmp_path) == {"a.png", RECORD_NAME}


def test_a_record_that_names_files_elsewhere_removes_nothing_there(tmp_path: Path):
    outside = tmp_path / "outside.txt"
    outside.write_text("keep")
    folder = tmp_path / "out"
    folder.mkdir()
    listed = {"x": {"file": "../outside.txt", "sha256": file_digest(outside)}}
    (folder / RECORD_NAME).write_text(json.dumps({"outputs": listed, "options": {"sheet": False}}))
    write_run(folder, {"a.png": "new"})
    assert outside.read_text() == "keep"


@pytest.mark.parametrize("content", ["", "[]", "{", '{"outputs": 3}'])
def test_a_damaged_record_is_replaced(tmp_path: Path, content: str):
    (tmp_path / RECORD_NAME).write_text(content)
    write_run(tmp_path, {"a.png": "new"})
    assert names(tmp_path) == {"a.png", RECORD_NAME}


def test_a_folder_where_the_record_should_be_is_an_error(tmp_path: Path):
    (tmp_path / RECORD_NAME).mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        write_run(tmp_path, {"a.png": "new"})


def test_a_few_numbers_of_any_kind_stand_in_the_record(tmp_path: Path):
    from fogpipe.ports import known_kinds

    kinds = known_kinds()
    assert not kinds["Camera"].is_per_pixel(np.eye(3))
    assert not kinds["Airlight"].is_per_pixel(np.ones(3))
    assert not kinds["Length"].is_per_pixel(np.array(1.0))
    assert kinds["Airlight"].is_per_pixel(np.ones((1, 1, 3)))
    assert kinds["Range"].is_per_pixel(np.ones((1, 1)))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot lock a folder")
def test_runs_that_end_at_the_same_moment_do_not_mix(tmp_path: Path):
    def publish_own(run: int) -> None:
        write_run(tmp_path, {f"{index}.txt": f"run {run}" for index in range(20)} | {f"only-{run}.txt": f"run {run}"})

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(publish_own, range(40)))
    recorded = json.loads((tmp_path / RECORD_NAME).read_text())["outputs"]
    assert names(tmp_path) == {*recorded, RECORD_NAME}
    assert len({(tmp_path / name).read_text() for name in recorded}) == 1
