"""What differs between the outputs of a batch."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.batch.variation import Variation, parse_sample, parse_sweep
from fogpipe.datasets.item import Item
from fogpipe.errors import InputError, RequestError

ITEM = Item("street/7", {})


def test_a_sweep_lists_values_as_a_pipeline_file_writes_them():
    assert parse_sweep("fog.visibility=50,100").values == (50, 100)
    assert parse_sweep("blurred.solver=auto, euler").values == ("auto", "euler")
    assert parse_sweep("airlight.colour=[0.7,0.7,0.7],[0.8,0.8,0.9]").values == ([0.7, 0.7, 0.7], [0.8, 0.8, 0.9])


def test_sweeps_combine():
    variation = Variation.parse(["a.x=1,2", "b.y=3,4"])
    variants = variation.variants(ITEM, seed=0)
    assert [dict(v.settings) for v in variants] == [{"a.x": x, "b.y": y} for x, y in [(1, 3), (1, 4), (2, 3), (2, 4)]]
    assert len({v.key for v in variants}) == 4
    assert len({v.seed for v in variants}) == 1  # the same clouds in thin fog and in thick


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("fog.visibility=uniform(50,100)", 50, 100),
        ("fog.visibility=loguniform(50, 100)", 50, 100),
        ("fog.visibility=choice(50, 70, 100)", 50, 100),
        ("fog.visibility=lognormal(150, 0.5)", 150 * np.exp(-4), 150 * np.exp(4)),  # 8 deviations
        ("fog.visibility=normal(150, 5)", 110, 190),  # 8 deviations
    ],
)
def test_a_draw_is_of_its_distribution(text: str, low: float, high: float):
    sample = parse_sample(text)
    rng = np.random.default_rng(1)
    drawn = [sample.draw(rng) for _ in range(200)]
    assert low <= min(drawn) < max(drawn) <= high


def test_the_median_of_a_lognormal_is_its_first_number():
    sample, rng = parse_sample("fog.visibility=lognormal(150, 0.5)"), np.random.default_rng(1)
    # The standard error of the median of n draws is 1.25 σ/√n of the logarithm: 0.02 for n = 1000. Five of them.
    assert np.log(np.median([sample.draw(rng) for _ in range(1000)]) / 150) == pytest.approx(0, abs=0.1)


def test_a_draw_depends_on_seed_image_parameter_and_number_only():
    both = Variation.parse(samples=["a.x=uniform(0,1)", "b.y=uniform(0,1)"], draws=2)
    alone = Variation.parse(samples=["b.y=uniform(0,1)"], draws=2)
    first, second = both.variants(ITEM, seed=3)
    assert first.settings["b.y"] == alone.variants(ITEM, seed=3)[0].settings["b.y"]
    others = {
        second.settings["b.y"],
        first.settings["a.x"],
        alone.variants(ITEM, seed=4)[0].settings["b.y"],
        alone.variants(Item("street/8", {}), seed=3)[0].settings["b.y"],
    }
    assert len(others | {first.settings["b.y"]}) == 5
    assert first.seed != second.seed


def test_frames_of_a_video_share_draws_and_seed():
    sampled = Variation.parse(samples=["a.x=uniform(0,1)"], binds=["density.time=time"])
    frames = [Item(f"clip/{n}", {}, sequence="clip", values={"time": n / 10}) for n in range(3)]
    variants = [sampled.variants(frame, seed=0)[0] for frame in frames]
    assert len({v.settings["a.x"] for v in variants}) == len({v.seed for v in variants}) == 1
    assert [v.settings["density.time"] for v in variants] == [0.0, 0.1, 0.2]


def test_an_item_sets_parameters():
    item = Item("1", {}, settings={"fog.visibility": "120", "blurred.solver": "euler"})
    (variant,) = Variation.parse().variants(item, seed=0)
    assert variant.settings == {"fog.visibility": 120, "blurred.solver": "euler"}


def test_a_value_that_an_item_lacks_cannot_be_bound():
    with pytest.raises(InputError, match=r'street/7 has no value "time" to bind'):
        Variation.parse(binds=["density.time=time"]).variants(ITEM, seed=0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sweeps": ["fog.visibility"]}, "write it as STAGE.PARAMETER=VALUE"),
        ({"sweeps": ["fog.visibility=1,1"]}, "a value is there twice"),
        ({"sweeps": ["fog.visibility=[1"]}, "cannot be read"),
        ({"sweeps": ["a.x=1"], "samples": ["a.x=uniform(0,1)"]}, "a.x is swept, sampled or bound twice"),
        ({"samples": ["a.x=__import__('os').getpid()"]}, "is not a distribution"),
        ({"samples": ["a.x=gamma(1,2)"]}, r"There is: uniform\(low, high\)"),
        ({"samples": ["a.x=uniform(1)"]}, "takes two numbers, low and high"),
        ({"samples": ["a.x=uniform(2,1)"]}, "low must be below high"),
        ({"samples": ["a.x=uniform(1,.inf)"]}, "takes two numbers"),
        ({"samples": ["a.x=lognormal(0,1)"]}, "median must be above 0"),
        ({"samples": ["a.x=normal(0,-1)"]}, "deviation must be 0 or more"),
        ({"samples": ["a.x=choice()"]}, "names no value"),
        ({"draws": 3}, "needs something to draw"),
    ],
)
def test_what_cannot_be_read_is_one_clear_error(options: dict, message: str):
    with pytest.raises(RequestError, match=message):
        Variation.parse(**options)
