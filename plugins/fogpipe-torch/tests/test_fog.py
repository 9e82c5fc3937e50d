"""A fog that is drawn from random numbers, on the values that training libraries have."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from fogpipe.errors import InputError, PipelineError, RequestError
from fogpipe.pipeline.shipped import read_pipeline

from fogpipe_torch import Draw, Fog

CLEAR = Draw({"fog.visibility": np.inf}, seed=1)


def test_the_same_random_numbers_give_the_same_fog(image: np.ndarray, range_map: np.ndarray):
    one, same, other = (Fog()(image, rng=np.random.default_rng(seed), range_map=range_map) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


def test_parameters_are_drawn_from_their_distributions():
    fog = Fog(sample=("fog.visibility=uniform(100, 200)", "airlight.saturation=choice(0, 1)"))
    draws = [fog.draw(np.random.default_rng(seed)) for seed in range(100)]
    visibilities = [draw.settings["fog.visibility"] for draw in draws]
    assert 100 <= min(visibilities) < 120 < 180 < max(visibilities) <= 200  # 100 draws miss a fifth once in 10⁹ seeds
    assert {draw.settings["airlight.saturation"] for draw in draws} == {0, 1}
    assert len({draw.seed for draw in draws}) == 100


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("color", ["linear", "srgb"])
def test_clear_air_gives_the_picture_back_in_its_own_values(
    image: np.ndarray, range_map: np.ndarray, dtype: type, color: str, tmp_path: Path
):
    text = read_pipeline("hansard2019")[0]
    (tmp_path / "fog.yaml").write_text(re.sub("^color: .*$", f"color: {color}", text, flags=re.MULTILINE))
    picture = image.astype(dtype) * {np.uint16: 257}.get(dtype, 1)
    picture = picture / dtype(255) if np.issubdtype(dtype, np.floating) else picture
    back = Fog(tmp_path / "fog.yaml", sample=()).apply(picture, CLEAR, range_map=range_map)
    assert back.dtype == dtype
    # The pipeline computes in float32, with relative errors of some 1e-7; one level of 16 bits may round the other way.
    np.testing.assert_allclose(back.astype(float), picture.astype(float), rtol=2e-6, atol=float(dtype is np.uint16))


def test_less_visibility_is_more_fog(image: np.ndarray, range_map: np.ndarray):
    fog = Fog(settings={"airlight.colour": [0.8, 0.8, 0.8], "scale.strength": 0})
    foggy = [fog.apply(image, Draw({"fog.visibility": v}, 1), range_map=range_map) for v in (400, 100, 50)]
    contrast = [picture.astype(float).std(axis=0).mean() for picture in foggy]  # along columns, of one range each
    assert contrast[0] > contrast[1] > contrast[2]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"sample": ["fog.visibility=often"]}, RequestError),
        ({"sample": ["fog.visiblity=uniform(1, 2)"]}, PipelineError),
        ({"settings": {"nobody.knows": 1}}, PipelineError),
        ({"output": "fogy"}, RequestError),
        ({"pipeline": "no-such-pipeline"}, InputError),
    ],
)
def test_a_mistake_is_found_before_the_training_starts(arguments: dict, error: type[Exception]):
    with pytest.raises(error):
        Fog(**arguments)


def test_what_the_pipeline_takes_and_does_not_get_is_named(image: np.ndarray):
    with pytest.raises(InputError, match="range_map"):
        Fog().apply(image, CLEAR)
