"""Photographs that break naive code, through the stages and pipelines for one photograph."""

from __future__ import annotations

import numpy as np
import pytest

import fogpipe
from fogpipe.errors import StageError
from fogpipe.stages.depth import from_photo
from fogpipe.stages.segments import mean_shift

RNG = np.random.default_rng(0)
PHOTOS = {
    "constant": np.full((40, 60, 3), 0.5),
    "white": np.ones((40, 60, 3)),
    "black": np.zeros((40, 60, 3)),
    "two levels": np.repeat([0.0, 1.0], 20)[:, None, None] * np.ones((1, 60, 3)),
    "noise": RNG.random((40, 60, 3)),
    "one row": RNG.random((1, 60, 3)),
    "one column": RNG.random((60, 1, 3)),
    "one pixel": RNG.random((1, 1, 3)),
    "four pixels": RNG.random((2, 2, 3)),
    "a ribbon": RNG.random((3, 3000, 3)),
    "a mast": RNG.random((3000, 3, 3)),
    "brighter than white": RNG.random((40, 60, 3)) * 50,
}


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("name", PHOTOS)
def test_depth_and_segments(name: str, dtype: type):
    image = PHOTOS[name].astype(dtype)
    depth, sky = from_photo(image)
    assert depth.dtype == np.result_type(dtype, np.float32)
    assert depth.shape == sky.shape == image.shape[:2]
    assert 0 <= depth.min() <= depth.max() <= 1
    segments = mean_shift(image)
    assert 0 <= segments.min() <= segments.max() <= 1


@pytest.mark.parametrize("pipeline", ["guo2014-paper", "guo2014", "photo-fog"])
@pytest.mark.parametrize("name", PHOTOS)
def test_pipelines(name: str, pipeline: str):
    result = fogpipe.load(pipeline).run(image=PHOTOS[name].astype(np.float32))
    for output, value in result.items():
        assert output == "gap" or np.isfinite(value).all(), output


def test_a_constant_photo_has_the_depth_of_its_rows():
    depth = from_photo(PHOTOS["black"]).depth
    assert (np.diff(depth, axis=0) <= 1e-6).all()  # float32 rounding of a filter
    np.testing.assert_allclose(depth, depth[:, :1] * np.ones((1, 60)), atol=0.02)  # a step of a path costs a little


@pytest.mark.parametrize(("factor", "floor"), [(0, 0), (0, 1), (100, 0), (100, 1)])
def test_extremes_of_the_published_parameters(factor: float, floor: float):
    settings = {"t.factor": factor, "t.floor": floor}
    result = fogpipe.load("guo2014-paper", set=settings).run(image=PHOTOS["noise"].astype(np.float32))
    if factor == 0 or floor == 1:
        np.testing.assert_array_equal(result["homogeneous"], PHOTOS["noise"].astype(np.float32))
    assert np.isfinite(result["homogeneous"]).all()


@pytest.mark.parametrize("stage", [from_photo, mean_shift])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(stage, value: float):
    image = PHOTOS["noise"].copy()
    image[3, 4, 1] = value
    with pytest.raises(ValueError, match="NaN or infinite"):
        stage(image)


def test_a_pipeline_refuses_it_too():
    image = np.full((4, 4, 3), np.nan, np.float32)
    with pytest.raises((StageError, fogpipe.errors.InputError), match="NaN"):
        fogpipe.load("photo-fog").run(image=image)
