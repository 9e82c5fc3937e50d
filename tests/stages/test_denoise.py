"""Denoising: less noise, the same picture, and more trust in near pixels than in far ones."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels.bands import set_threads, threads
from fogpipe.kernels.dehazing.total_variation import total_variation as solve
from fogpipe.stages import denoise

RNG = np.random.default_rng(3)
SIGMA = 0.05
CLEAN = np.where(np.arange(64)[None, :, None] < 32, 0.3, 0.7) * np.ones((48, 1, 3))
NOISY = (CLEAN + RNG.normal(0, SIGMA, CLEAN.shape)).astype(np.float32)
STAGES = (denoise.nonlocal_means, denoise.wavelet, denoise.total_variation)
every_stage = pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.__name__)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@every_stage
@pytest.mark.parametrize("sigma", [SIGMA, None], ids=["given", "estimated"])
def test_noise_is_halved_and_the_edge_stays(stage, sigma):
    quiet = stage(NOISY, sigma=sigma)
    assert rms(quiet - CLEAN) < 0.5 * SIGMA
    assert np.diff(quiet.mean(axis=(0, 2)))[31] > 0.5 * 0.4


@every_stage
def test_a_picture_without_noise_stays_as_it_is(stage):
    flat = np.full((20, 20, 3), 0.4, np.float32)
    np.testing.assert_array_equal(stage(flat), flat)
    np.testing.assert_array_equal(stage(NOISY, sigma=0), NOISY)


@every_stage
@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 5)])
def test_small_pictures(stage, shape):
    for sigma in (None, 0.1):
        assert np.isfinite(stage(NOISY[: shape[0], : shape[1]], sigma=sigma)).all()


@every_stage
def test_values_above_1_and_below_0_survive(stage):
    assert stage(NOISY * 4 - 1, sigma=0.01).max() > 1.5
    assert stage(NOISY * 4 - 1, sigma=0.01).min() < 0


@every_stage
def test_nan_is_refused(stage):
    with pytest.raises(ValueError, match="NaN or infinite"):
        stage(np.where(NOISY > 0.5, np.nan, NOISY))


def test_total_variation_smooths_more_where_less_light_arrives():
    t = np.broadcast_to(np.where(np.arange(48)[:, None] < 24, 1.0, 0.3), (48, 64)).astype(np.float32)
    left = np.s_[:, 4:28]
    flat = (0.5 + RNG.normal(0, SIGMA, (48, 64, 3)) / t[..., None]).astype(np.float32)
    quiet = denoise.total_variation(flat, t, sigma=SIGMA)[left]
    rough = flat[left]
    near, far = np.s_[2:22], np.s_[26:46]
    assert rms(quiet[far] - 0.5) / rms(rough[far] - 0.5) < rms(quiet[near] - 0.5) / rms(rough[near] - 0.5) < 0.5


def test_total_variation_of_a_step_is_its_closed_form():
    """Of a step of halves n wide, with weight w and edge weight g, each side moves by g / (w n) towards the other."""
    step = np.where(np.arange(20) < 10, 0.0, 1.0)[None, :, None] * np.ones((1, 1, 1))
    ones = np.ones((1, 20))
    solved = solve(step, 2 * ones, 0.4 * ones, None, 3000)[0, :, 0]
    np.testing.assert_allclose(solved, np.where(np.arange(20) < 10, 0.02, 0.98), atol=1e-6)  # what 3000 steps leave


def test_a_bound_holds_and_pulls_its_surroundings_up():
    values = np.zeros((1, 9, 1))
    bound = np.full_like(values, -1)
    bound[0, 4] = 1
    solved = solve(values, np.ones((1, 9)), np.full((1, 9), 0.5), bound, 2000)[0, :, 0]
    assert solved[4] == 1
    assert solved.min() > 0


def test_one_and_two_threads_give_the_same_bytes():
    before = threads()
    tall = np.tile(NOISY, (12, 2, 1))  # enough pixels for two bands
    try:
        results = []
        for count in (1, 2):
            set_threads(count)
            results.append(denoise.total_variation(tall, sigma=SIGMA, iterations=9).tobytes())
    finally:
        set_threads(before)
    assert results[0] == results[1]
