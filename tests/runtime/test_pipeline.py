"""The same from Python: load, run, arrays back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fogpipe
from fogpipe.errors import ExpectationError, InputError, PipelineError
from tests.conftest import TOY_STAGES

TEXT = """\
fogpipe: 1
inputs: {image: Image, range_map: Range}
stages:
  t: {use: toy.transmission, in: {range_map: range_map}}
  foggy: {use: toy.paint, in: {image: image, transmission: t}}
  score: {use: toy.mean, in: {image: foggy}}
outputs: {foggy: foggy, score: score}
expect: {score: "> 0.1"}
"""
IMAGE = np.full((2, 3, 3), 0.5, np.float32)
RANGE = np.ones((2, 3), np.float32)


@pytest.fixture
def pipeline(tmp_path: Path) -> fogpipe.Pipeline:
    path = tmp_path / "toy.yaml"
    path.write_text(TEXT)
    return fogpipe.load(path, plugins=[TOY_STAGES])


def test_run_returns_the_outputs_by_name(pipeline):
    result = pipeline.run(image=IMAGE, range_map=RANGE)
    assert list(result) == ["foggy", "score"]
    # One float32 product and one exponential: a few units in the last place.
    np.testing.assert_allclose(result["foggy"], 0.5 * np.exp(-0.1), rtol=1e-6)
    assert [report.status for report in result.reports] == ["ran", "ran", "ran"]


def test_only_what_is_asked_for_is_computed_and_needed(pipeline):
    assert list(pipeline.run(to=["t"], range_map=RANGE)) == ["t"]


def test_pictures_of_integers_are_display_values(pipeline):
    bytes_in = np.full((2, 3, 3), 188, np.uint8)
    result = pipeline.run(image=bytes_in, range_map=np.zeros((2, 3)))
    # sRGB 188 is 0.5029 in linear light (IEC 61966-2-1).
    np.testing.assert_allclose(result["foggy"], 0.5029, atol=1e-4)


def test_a_missed_expectation_fails_but_keeps_the_result(pipeline):
    with pytest.raises(ExpectationError, match=r"expected score > 0\.1, but it is 0") as caught:
        pipeline.run(image=IMAGE * 0, range_map=RANGE)
    assert isinstance(caught.value.result, fogpipe.Result)
    assert caught.value.result["score"] == 0


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"image": IMAGE}, r"needs range_map \(Range \[m\]\)"),
        ({"image": IMAGE, "range_map": RANGE, "extra": 1}, 'no input "extra"'),
        ({"image": IMAGE, "range_map": -RANGE}, "below 0"),
        ({"image": IMAGE, "range_map": RANGE.astype(int)}, "Convert codes to metres"),
        ({"image": IMAGE, "range_map": np.ones((2, 3, 3))}, "picture of depth"),
        ({"image": IMAGE, "range_map": np.ones((3, 3))}, "same height and width"),
        ({"image": IMAGE, "range_map": np.ones((0, 3))}, "shape"),
        ({"image": IMAGE * np.nan, "range_map": RANGE}, "NaN"),
        ({"image": "photo.png", "range_map": RANGE}, "image"),
        ({"image": IMAGE, "range_map": None}, "range_map"),
    ],
)
def test_bad_inputs_are_refused_before_anything_runs(pipeline, inputs, message: str):
    with pytest.raises(InputError, match=message):
        pipeline.run(**inputs)


def test_half_floats_are_widened(pipeline):
    result = pipeline.run(image=IMAGE.astype(np.float16), range_map=RANGE.astype(np.float16))
    assert result["foggy"].dtype == np.float32


def test_an_unknown_pipeline_gets_a_suggestion():
    with pytest.raises(InputError, match='Did you mean "hansard2019"'):
        fogpipe.load("hansard2091")


def test_settings_are_checked_like_the_file():
    with pytest.raises(PipelineError, match="--set fog"):
        fogpipe.load("hansard2019", set={"fog.visibility": -1})
    loaded = fogpipe.load("hansard2019", set={"fog.visibility": 200}, seed=3, tolerance=0.01)
    assert loaded.graph.nodes["fog"].parameters["visibility"] == 200
    assert (loaded.graph.seed, loaded.graph.tolerance) == (3, 0.01)


def test_a_cache_may_be_a_folder_name(pipeline, tmp_path: Path):
    for status in ("ran", "cached"):
        result = pipeline.run(image=IMAGE, range_map=RANGE, cache=tmp_path / "cache")
        assert {report.status for report in result.reports} == {status}
