"""The cache: what is in a key, damage, size limit, several processes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from fogpipe.errors import InputError
from fogpipe.pipeline.check import check
from fogpipe.pipeline.graph import Ref
from fogpipe.pipeline.plan import make_plan
from fogpipe.pipeline.spec import read_spec
from fogpipe.registry import Registry
from fogpipe.runtime.cache import Cache, digest
from fogpipe.runtime.runner import execute

RANGE = np.array([[1.0, 2.0], [4.0, np.nan]], dtype=np.float32)
TEXT = """
inputs: {range_map: Range}
stages:
  filled: {use: toy.fill, in: {range_map: range_map}, with: {value: 7}}
  parts: {use: toy.split, in: {range_map: filled}}
outputs: {far: parts.far}
"""


def run(graph, folder: Path, array=RANGE, **options) -> list[str]:
    """The fate of each stage."""
    return [r.status for r in execute(make_plan(graph), {"range_map": array}, cache=Cache(folder, **options)).reports]


def test_a_second_run_takes_everything_from_the_cache(build, tmp_path: Path, toy):
    first = execute(make_plan(build(TEXT)), {"range_map": RANGE}, cache=Cache(tmp_path))
    toy.calls.clear()
    second = execute(make_plan(build(TEXT)), {"range_map": RANGE}, cache=Cache(tmp_path))
    assert toy.calls == []
    assert [r.status for r in second.reports] == ["cached", "cached"]
    ref = Ref("parts", "far")
    assert first.values[ref].tobytes() == second.values[ref].tobytes()
    assert not second.values[ref].flags.writeable


def test_a_changed_parameter_runs_that_stage_and_what_follows(build, tmp_path: Path):
    run(build(TEXT), tmp_path)
    assert run(build(TEXT, set={"parts.at": 2}), tmp_path) == ["cached", "ran"]
    assert run(build(TEXT, set={"filled.value": 8}), tmp_path) == ["ran", "ran"]


def test_content_dtype_and_shape_of_inputs_are_in_the_key(build, tmp_path: Path):
    run(build(TEXT), tmp_path)
    assert run(build(TEXT), tmp_path, RANGE.astype(np.float64))[0] == "ran"
    assert run(build(TEXT), tmp_path, RANGE.reshape(1, 4))[0] == "ran"
    assert run(build(TEXT), tmp_path, RANGE + 1)[0] == "ran"
    assert run(build(TEXT), tmp_path, RANGE.copy())[0] == "cached"


def test_equal_content_downstream_is_found_though_the_way_there_differs(build, tmp_path: Path):
    known = np.nan_to_num(RANGE, nan=7)
    assert run(build(TEXT), tmp_path, known) == ["skipped", "ran"]
    assert run(build(TEXT), tmp_path, RANGE) == ["ran", "cached"]


def test_the_seed_is_in_the_key_only_where_something_is_random(build, tmp_path: Path):
    text = """
    seed: 1
    inputs: {image: Image}
    stages:
      a: {use: toy.noise, in: {image: image}}
      b: {use: toy.mean, in: {image: image}}
    outputs: {a: a, b: b}
    """
    image = {"image": np.zeros((2, 2, 3), np.float32)}
    execute(make_plan(build(text)), image, cache=Cache(tmp_path))
    again = execute(make_plan(build(text.replace("seed: 1", "seed: 2"))), image, cache=Cache(tmp_path))
    assert {r.name: r.status for r in again.reports} == {"a": "ran", "b": "cached"}


def test_the_code_of_a_stage_is_in_the_key(tmp_path: Path):
    source = dedent("""
        from fogpipe.ports import Range
        from fogpipe.stage import stage
        @stage("mine.twice")
        def twice(range_map: Range) -> Range:
            return range_map * FACTOR
    """)
    text = "fogpipe: 1\ninputs: {r: Range}\nstages: {m: {use: mine.twice, in: {range_map: r}}}\noutputs: {m: m}\n"
    for factor, fate in ((2, "ran"), (2, "cached"), (3, "ran")):
        folder = tmp_path / f"code{factor}"
        folder.mkdir(exist_ok=True)
        (folder / "mine.py").write_text(source.replace("FACTOR", str(factor)))
        graph = check(read_spec(text, "t"), Registry([folder]))
        object.__setattr__(graph.nodes["m"], "origin", "the same file")
        outcome = execute(make_plan(graph), {"r": RANGE}, cache=Cache(tmp_path / "cache"))
        assert outcome.reports[0].status == fate


@pytest.mark.parametrize("damage", ["truncate", "flip", "empty", "index", "missing"])
def test_a_damaged_entry_is_computed_again(build, tmp_path: Path, damage: str):
    run(build(TEXT), tmp_path)
    for path in tmp_path.glob("??/*/*"):
        content = path.read_bytes()
        if damage == "index" and path.suffix == ".json":
            path.write_text("[1, 2")
        elif path.suffix == ".npy" and damage != "index":
            flipped = content[:-1] + bytes([content[-1] ^ 1])
            new = {"truncate": content[:-3], "flip": flipped, "empty": b"", "missing": None}[damage]
            if new is None:
                path.unlink()
            else:
                path.write_bytes(new)
    assert run(build(TEXT), tmp_path) == ["ran", "ran"]
    assert run(build(TEXT), tmp_path) == ["cached", "cached"]


def test_a_pickle_in_the_cache_is_never_loaded(build, tmp_path: Path):
    run(build(TEXT), tmp_path)
    for path in tmp_path.glob("??/*/*.npy"):
        np.save(path, np.array([{"any": "object"}], dtype=object), allow_pickle=True)
    assert run(build(TEXT), tmp_path) == ["ran", "ran"]


def test_the_entries_used_longest_ago_are_dropped_at_the_limit(build, tmp_path: Path):
    big = np.ones((100, 100), np.float32)
    big[0, 0] = np.nan
    run(build(TEXT), tmp_path, big, limit=10**6)
    for folder in tmp_path.glob("??/*"):
        os.utime(folder, (time.time() - 1000,) * 2)
    for value in (1, 2, 3, 4):
        run(build(TEXT, set={"filled.value": value}), tmp_path, big, limit=130_000)
    held = sum(path.stat().st_size for path in tmp_path.glob("??/*/*"))
    assert held <= 130_000
    assert run(build(TEXT), tmp_path, big)[0] == "ran"
    assert run(build(TEXT, set={"filled.value": 4}), tmp_path, big)[0] == "cached"


def test_an_unusable_folder_is_one_clear_error(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be used"):
        Cache(tmp_path / "file" / "below")


def test_a_disk_that_is_full_does_not_fail_the_run(build, tmp_path: Path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "save", full)
    assert run(build(TEXT), tmp_path) == ["ran", "ran"]
    assert not list(tmp_path.glob("??/*"))
    assert not list(tmp_path.glob(".new-*"))


def test_what_a_killed_process_left_behind_is_cleared_away(build, tmp_path: Path):
    left = tmp_path / ".new-left"
    left.mkdir()
    os.utime(left, (0, 0))
    run(build(TEXT), tmp_path)
    assert not left.exists()


def test_two_processes_may_share_a_cache(tmp_path: Path):
    program = dedent(f"""
        import sys
        sys.path.insert(0, {str(Path(__file__).parents[2])!r})
        import numpy as np
        from fogpipe.pipeline.check import check
        from fogpipe.pipeline.plan import make_plan
        from fogpipe.pipeline.spec import read_spec
        from fogpipe.registry import Registry
        from fogpipe.runtime.cache import Cache
        from fogpipe.runtime.runner import execute
        registry = Registry([{str(Path(__file__).parents[1] / "toy_stages")!r}])
        graph = check(read_spec({"fogpipe: 1" + TEXT!r}, "t"), registry)
        for step in range(60):
            array = np.full((40, 40), step % 6, np.float32)
            array[0, 0] = np.nan
            execute(make_plan(graph), {{"range_map": array}}, cache=Cache({str(tmp_path)!r}, limit=60_000))
    """)
    processes = [subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE) for _ in range(2)]
    errors = [process.communicate()[1].decode() for process in processes]
    assert errors == ["", ""]
    assert [process.returncode for process in processes] == [0, 0]
    assert not list(tmp_path.glob(".new-*"))


def test_a_digest_tells_dtype_and_shape_apart():
    zeros = np.zeros((2, 3), np.float32)
    assert digest(zeros) != digest(zeros.reshape(3, 2))
    assert digest(zeros) != digest(zeros.view(np.int32))
    assert digest(np.asfortranarray(zeros)) == digest(zeros)
    assert digest(np.float64(3)) == digest(np.array(3.0))  # type: ignore[arg-type]


def test_a_read_only_cache_finds_but_keeps_nothing(build, tmp_path: Path):
    assert run(build(TEXT), tmp_path, read_only=True) == ["ran", "ran"]
    assert not list(tmp_path.iterdir())
    run(build(TEXT), tmp_path)
    assert run(build(TEXT), tmp_path, read_only=True) == ["cached", "cached"]


def test_looking_for_an_entry_that_is_being_stored_does_not_remove_it(build, tmp_path: Path):
    run(build(TEXT), tmp_path)
    folder = next(tmp_path.glob("??/*"))
    (folder / "entry.json").rename(tmp_path / "aside")
    assert Cache(tmp_path).look_up(folder.name) is None
    assert folder.is_dir()


def test_code_that_was_edited_after_it_was_imported_is_not_stored_as_the_new_code(tmp_path: Path):
    source = "from fogpipe.ports import Range\nfrom fogpipe.stage import stage\n"
    source += "@stage('edited.scale')\ndef scale(range_map: Range) -> Range:\n    return range_map * FACTOR\n"
    text = "fogpipe: 1\ninputs: {r: Range}\nstages: {m: {use: edited.scale, in: {range_map: r}}}\noutputs: {m: m}\n"
    path = tmp_path / "edited.py"
    path.write_text(source.replace("FACTOR", "2"))
    graph = check(read_spec(text, "t"), Registry([tmp_path]))
    path.write_text(source.replace("FACTOR", "5"))
    given = {"r": np.ones((1, 1), np.float32)}
    stale = execute(make_plan(graph), given, cache=Cache(tmp_path / "cache"))
    fresh = execute(
        make_plan(check(read_spec(text, "t"), Registry([tmp_path]))), given, cache=Cache(tmp_path / "cache")
    )
    assert (stale.values[Ref("m")].item(), fresh.values[Ref("m")].item()) == (2, 5)
