"""The noise has the mean, the variance and the distribution of the model."""

from __future__ import annotations

import numpy as np
import pytest
from fogpipe.testing import check_stage

from fogpipe_sensor.sensor import noise

VALUES = 300_000
"""Pixel values per level of light."""


def flat(level: float, seed: int = 1, **parameters: float) -> np.ndarray:
    """A noisy picture of one level of light, in float64."""
    image = np.full((100, VALUES // 300, 3), level)
    return noise(image, rng=np.random.default_rng(seed), **parameters)


def test_it_keeps_the_promises_of_a_stage():
    check_stage(noise)


def test_without_noise_the_image_is_left_alone():
    check_stage(noise, parameters={"full_well": np.inf})


@pytest.mark.parametrize("level", [0.0, 0.01, 0.18, 1.0, 4.0])
def test_the_mean_is_the_light_and_the_variance_follows_the_model(level: float):
    full_well, read_noise = 2000.0, 5.0
    noisy = flat(level, full_well=full_well, read_noise=read_noise)
    variance = level / full_well + (read_noise / full_well) ** 2
    # The mean of n values has the standard error √(v/n); five of them are missed once in two million seeds.
    assert noisy.mean() == pytest.approx(level, abs=5 * np.sqrt(variance / VALUES))
    # The variance of n values has the relative standard error √((2 + κ)/n); the excess kurtosis κ = λ/(λ + σr²)² of
    # λ electrons with read noise is at most 0.01 here, which 5.1 instead of 5 allows for.
    assert noisy.var() == pytest.approx(variance, rel=5.1 * np.sqrt(2 / VALUES))


def test_few_electrons_are_counted_one_by_one():
    electrons = 100 * flat(0.02, full_well=100, read_noise=0)
    # Whole numbers, up to the rounding of a division and a multiplication in float64.
    np.testing.assert_allclose(electrons, np.round(electrons), atol=1e-12)
    # A Poisson number of mean 2 is 0 with the probability e⁻² = 0.135; its share has the standard error √(p(1−p)/n).
    dark = np.exp(-2)
    assert np.mean(electrons < 0.5) == pytest.approx(dark, abs=5 * np.sqrt(dark * (1 - dark) / VALUES))


def test_neighbours_and_channels_are_independent():
    noisy = flat(0.18) - 0.18
    for shifted in (noisy[1:] * noisy[:-1], noisy[:, 1:] * noisy[:, :-1], noisy[..., 1:] * noisy[..., :-1]):
        # The mean of products of independent values is 0 with the standard error v/√n.
        assert shifted.mean() == pytest.approx(0, abs=5 * noisy.var() / np.sqrt(shifted.size))


def test_a_negative_value_gets_read_noise_only():
    noisy = flat(-0.5, full_well=100, read_noise=2)
    # As above: the relative standard error of a variance is √(2/n).
    assert noisy.var() == pytest.approx(0.02**2, rel=5 * np.sqrt(2 / VALUES))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_light_that_cannot_be_counted_is_refused(value: float):
    with pytest.raises(ValueError, match="not finite, or too bright"):
        flat(value)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_it_computes_in_single_precision_or_better(dtype: type):
    noisy = noise(np.full((2, 2, 3), 0.5, dtype), rng=np.random.default_rng(1))
    assert noisy.dtype == np.result_type(dtype, np.float32)
