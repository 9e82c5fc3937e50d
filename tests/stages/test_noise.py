"""Noise of a known strength, and rounding to the levels of a format."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.noise import gaussian, quantise

IMAGE = np.full((100, 100, 3), 0.5, np.float32)


def test_noise_has_the_strength_asked_for_and_no_bias():
    added = gaussian(IMAGE, rng=np.random.default_rng(1), sigma=0.1) - IMAGE
    # 30 000 draws: three standard errors are 1.2 % of σ for the deviation and 0.0017 for the mean.
    assert added.std() == pytest.approx(0.1, rel=0.013)
    assert added.mean() == pytest.approx(0, abs=0.002)


def test_the_same_generator_gives_the_same_noise_at_every_strength():
    weak, strong = (gaussian(IMAGE, rng=np.random.default_rng(1), sigma=s) - IMAGE for s in (0.01, 0.1))
    np.testing.assert_allclose(10 * weak, strong, atol=1e-5)  # float32 sums near 0.5


def test_rounding_errs_by_half_a_level_at_most():
    values = np.random.default_rng(2).random((50, 50, 3))
    error = quantise(values) - values
    assert np.abs(error).max() <= 0.5 / 255 + 1e-12
    assert error.std() == pytest.approx(1 / 255 / np.sqrt(12), rel=0.03)  # 7 500 draws
    np.testing.assert_array_equal(quantise(quantise(values)), quantise(values))


def test_what_a_format_cannot_hold_is_clipped():
    np.testing.assert_array_equal(quantise(np.array([[[-0.1, 0.5, 7.0]]])), [[[0, 128 / 255, 1]]])


@pytest.mark.parametrize("call", [quantise, lambda image: gaussian(image, rng=np.random.default_rng(0))])
def test_nan_is_refused(call):
    with pytest.raises(ValueError, match="NaN or infinite"):
        call(np.full((3, 3, 3), np.nan))
