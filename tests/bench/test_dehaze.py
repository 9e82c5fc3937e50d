"""The dehazing bench: what a scene is, what a row says, and that the rivals are fairly built."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from fogpipe import bench
from fogpipe.bench import dehaze, table
from fogpipe.bench.dehaze import METHODS, compare, means, score
from fogpipe.bench.hazy_scenes import REPORTED, TUNING, clear_scene, hazy_scenes
from fogpipe.bench.table import Row
from fogpipe.stages import prior, restore

SIZE = (96, 72)


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return list(compare(hazy_scenes(["outdoor:1"], (2.0,), (10.0,), SIZE)))


def test_no_scene_is_both_tuned_on_and_reported():
    assert not {*TUNING} & {*REPORTED}
    assert len(REPORTED) >= 6


def test_distance_goes_from_the_nearest_point_to_the_sky():
    clear, distance = clear_scene("outdoor:1", *SIZE)
    assert clear.shape == (72, 96, 3)
    assert distance.min() == 0
    assert distance.max() == distance[0, 0] == 1


def test_a_hazy_scene_is_its_formula_in_8_bit():
    (scene,) = hazy_scenes(["outdoor:1"], (2.0,), (0.0,), SIZE)
    t = scene.transmission[..., None].astype(np.float64)
    exact = t * scene.clear + (1 - t) * scene.airlight
    assert np.abs(scene.hazy - exact).max() <= 0.5 / 255 + 1e-6  # half a level, float32
    levels = scene.hazy * 255
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-4)  # float32
    assert scene.transmission.min() == pytest.approx(np.exp(-2))


def test_every_method_has_a_row_with_time_and_scores(rows):
    assert [row.way for row in rows] == [*METHODS]
    for row in rows:
        assert {"PSNR", "SSIM", "CIEDE2000"} <= row.scores.keys()
        assert (row.ratio is None) == (row.way == "hazy input")


def test_the_truth_is_only_given_to_the_row_that_says_so(rows):
    errors = {row.way: row.scores.get("t error") for row in rows}
    assert [way for way, error in errors.items() if error == 0] == ["true transmission"]


def test_the_mean_is_that_of_the_scenes(rows):
    other = [
        Row(row.case.replace("outdoor:1", "x"), row.way, 1.0, scores=dict.fromkeys(row.scores, 1.0)) for row in rows
    ]
    (mean, *_) = means([*rows, *other])
    assert mean.case == "mean of 2, η 2, σ 10"
    assert mean.scores["PSNR"] == pytest.approx((rows[0].scores["PSNR"] + 1) / 2)


def test_scores_are_columns(rows):
    first = next(csv.DictReader(io.StringIO(table.as_csv(rows))))
    assert float(first["PSNR"]) == rows[0].scores["PSNR"]
    assert "CIEDE2000" in table.as_text(rows).splitlines()[0]
    assert "largest" not in table.as_text(rows).splitlines()[0]  # a column without a figure


def test_the_dark_channel_is_as_good_as_known():
    """On Motorcycle at 640×480 a well-made one has 16.2 / 15.2 / 13.5 dB, and 17.1 / 14.1 / 11.7 dB with σ = 10."""
    known = {(1, 0): 16.2, (2, 0): 15.2, (3, 0): 13.5, (1, 10): 17.1, (2, 10): 14.1, (3, 10): 11.7}
    for scene in hazy_scenes(["motorcycle"], noises=(0.0, 10.0)):
        t = prior.dark_channel(scene.hazy, scene.airlight, radius=20, smoothness=1e-3)
        found = score(scene, restore.invert(scene.hazy, scene.airlight, t), t)["PSNR"]
        # Those figures name neither radius nor ε nor how holes of the range are filled.
        assert found == pytest.approx(known[scene.thickness, scene.noise], abs=0.3)


def test_a_sheet_for_each_scene(tmp_path, monkeypatch):
    monkeypatch.setattr(dehaze, "METHODS", {"hazy input": METHODS["hazy input"]})
    draw = bench.pictures("dehaze")
    assert draw is not None
    draw(tmp_path, True, [])
    assert {path.name for path in tmp_path.iterdir()} == {"dehaze-motorcycle.png", "dehaze-outdoor-1.png"}
    assert bench.pictures("overhead") is None
