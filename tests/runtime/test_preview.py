"""What `plan` tells is what `run` does."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fogpipe.pipeline.plan import make_plan
from fogpipe.runtime.cache import Cache
from fogpipe.runtime.preview import preview
from fogpipe.runtime.runner import execute

TEXT = """
inputs: {image: Image, range_map: Range}
stages:
  moved: {use: toy.farther, in: {range_map: range_map}, with: {distance: 0}}
  filled: {use: toy.fill, in: {range_map: moved}}
  parts: {use: toy.split, in: {range_map: filled}}
  t: {use: toy.transmission, in: {range_map: filled}}
  foggy: {use: toy.paint, in: {image: image, transmission: t}}
outputs: {foggy: foggy, far: parts.far}
"""
KNOWN = {"image": np.ones((2, 2, 3), np.float32), "range_map": np.ones((2, 2), np.float32)}
HOLES = KNOWN | {"range_map": np.array([[1, np.nan], [2, 3]], np.float32)}


def fates(found) -> dict[str, str]:
    return {row.name: row.fate for row in found.rows}


def test_without_a_scene_it_says_what_the_scene_decides(build):
    found = preview(make_plan(build(TEXT)))
    assert fates(found) == {"moved": "depends", "filled": "depends", "parts": "runs", "t": "runs", "foggy": "runs"}
    assert {row.name: row.reason for row in found.rows}["filled"] == "skipped when every range is known"


def test_with_a_scene_it_gives_the_reasons(build):
    found = preview(make_plan(build(TEXT)), KNOWN)
    assert [(row.fate, row.reason) for row in found.rows[:2]] == [
        ("skipped", "the distance is 0"),
        ("skipped", "every range is known"),
    ]


def test_it_runs_only_what_decides(build, toy):
    preview(make_plan(build(TEXT, set={"moved.distance": 1})), HOLES)
    assert toy.calls == ["farther"]


def test_pruned_stages_are_named_with_the_reason(build):
    found = preview(make_plan(build(TEXT), ["far"]), HOLES)
    assert {row.name: (row.fate, row.reason) for row in found.rows}["t"] == ("pruned", "far does not need it")


def test_what_it_tells_is_what_a_run_does(build, tmp_path: Path):
    graph = build(TEXT)
    for inputs in (KNOWN, HOLES):
        cache = Cache(tmp_path)
        for _ in range(2):
            told = fates(preview(make_plan(graph), inputs, cache))
            did = {r.name: r.status for r in execute(make_plan(graph), inputs, cache=cache).reports}
            assert told == {name: "runs" if status == "ran" else status for name, status in did.items()}


def test_it_leaves_a_cache_as_it_is(build, tmp_path: Path):
    preview(make_plan(build(TEXT)), HOLES, Cache(tmp_path, read_only=True))
    assert not list(tmp_path.iterdir())


def test_a_graph_without_stages_has_no_rows(build):
    assert preview(make_plan(build("inputs: {image: Image}\nstages: {}\noutputs: {image: image}"))).rows == ()
