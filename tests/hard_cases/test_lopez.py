"""Pictures that break methods for one picture: black, overexposed, flat, tiny, damaged."""

from __future__ import annotations

import numpy as np
import pytest

import fogpipe
from fogpipe.errors import FogpipeError

CASES = {
    "black": np.zeros((40, 60, 3)),
    "all highlights": np.ones((40, 60, 3)),
    "values of 1e4": 1e4 * np.random.default_rng(0).random((40, 60, 3)),
    "one pixel of 1e4": np.where(np.arange(2400).reshape(40, 60, 1) == 1234, 1e4, 0.2) * np.ones(3),
    "one row": np.random.default_rng(1).random((1, 60, 3)),
    "one column": np.random.default_rng(2).random((40, 1, 3)),
    "one pixel": np.full((1, 1, 3), 0.5),
    "negative light": np.random.default_rng(3).normal(0.1, 0.1, (40, 60, 3)),
}
OUTSIDE = [[2, 2], [3, 2], [3, 3]]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(
    ("pipeline", "output"), [("lopez2008", "foggy"), ("layers-fog", "hazy"), ("layers-fog", "scattered")]
)
def test_fog_is_finite_and_somewhere(case, pipeline, output):
    image = CASES[case].astype(np.float32)
    foggy = fogpipe.load(pipeline).run(to=[output], image=image)[output]
    assert foggy.shape == image.shape
    assert np.isfinite(foggy).all()
    assert not np.array_equal(foggy, image)


@pytest.mark.parametrize(
    "changed",
    [{"medium.octaves": 0}, {"medium.period": 1e6}, {"density.contrast": 0.0}, {"medium.preset": "statue-centre"}],
)
def test_media_without_structure_are_smooth(changed):
    flat = np.full((60, 80, 3), 0.4, np.float32)
    density = fogpipe.load("lopez2008", set=changed).run(to=["density"], image=flat)["density"]
    # Cells of 1500 px: 80 px are a twentieth of one, over which the noise of variance 1 changes by about a tenth,
    # and its finer octaves by less, times the contrast.
    assert np.ptp(density) < 0.2


@pytest.mark.parametrize("pipeline", ["lopez2008", "layers-fog"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_refused_with_the_place(pipeline, value):
    image = np.full((40, 60, 3), 0.5, np.float32)
    image[3, 5] = value
    with pytest.raises(FogpipeError, match=r"3 (NaN|inf\w*) of 7200 values, the first at row 3, column 5"):
        fogpipe.load(pipeline).run(image=image)


def test_a_single_layer_is_fogged_evenly():
    image = np.full((40, 60, 3), 0.3, np.float32)
    result = fogpipe.load("lopez2008", set={"medium.octaves": 0, "low.corners": OUTSIDE}).run(to=["fog"], image=image)
    # All polygons but that of the ground are of things before the sky; beside them there is one layer.
    assert np.ptp(result["fog"][:4, 14:26], axis=(0, 1)).max() < 1e-6


def test_empty_masks_are_skipped_and_say_so():
    image = np.full((40, 60, 3), 0.3, np.float32)
    result = fogpipe.load("lopez2008", set={"beside.corners": OUTSIDE}).run(to=["depth"], image=image)
    skipped = {report.name: report.reason for report in result.reports if report.status == "skipped"}
    assert skipped["depth"] == "the mask is empty"
