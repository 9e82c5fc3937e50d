"""The scene behind haze: plain inversion, and the inversion that knows how noise grows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fogpipe.kernels.bands import set_threads, threads
from fogpipe.stages.composite import naive
from fogpipe.stages.restore import invert, non_local, tempered_colour

GREY = np.array([0.9, 0.9, 0.9], np.float32)
SIGMA = 10 / 255


def noisy_steps(height: int = 64, width: int = 96) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A scene of coloured squares behind haze that thickens to the right: scene, transmission, noisy image."""
    y, x = np.mgrid[:height, :width] // 16
    scene = np.random.default_rng(3).random((height // 16, width // 16, 3))[y, x].astype(np.float32)
    t = np.linspace(0.9, 0.15, width, dtype=np.float32) * np.ones((height, 1), np.float32)
    image = naive(scene, t, GREY)
    return scene, t, image + np.random.default_rng(4).normal(0, SIGMA, image.shape).astype(np.float32)


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


@given(
    scene=arrays(np.float32, (3, 4, 3), elements=st.floats(0, 1, width=32)),
    t=arrays(np.float32, (3, 4), elements=st.floats(0.0625, 1, width=32)),
    airlight=arrays(np.float32, (3,), elements=st.floats(0.25, 1, width=32)),
)
def test_inversion_undoes_the_haze(scene, t, airlight):
    back = invert(naive(scene, t, airlight), airlight, t, floor=0.05)
    np.testing.assert_allclose(back, scene, atol=1e-5)  # float32 rounding of I, times 16


def test_values_above_one_survive_unclipped():
    bright = np.full((2, 3, 3), 7.0, np.float32)
    t = np.full((2, 3), 0.5, np.float32)
    image = naive(bright, t, GREY)
    np.testing.assert_allclose(invert(image, GREY, t, clip=False), 7, rtol=1e-6)  # float32
    np.testing.assert_array_equal(invert(image, GREY, t), 1)


def test_no_transmission_leaves_the_haze_and_no_infinity():
    image = np.full((2, 3, 3), 0.8, np.float32)
    got = invert(image, GREY, np.zeros((2, 3), np.float32), floor=0.1, clip=False)
    np.testing.assert_allclose(got, 0.9 - 0.1 / 0.1, atol=1e-6)  # float32


@pytest.mark.parametrize("function", [invert, non_local])
def test_what_is_unknown_is_refused(function):
    image, t = np.full((3, 4, 3), 0.5, np.float32), np.full((3, 4), 0.5, np.float32)
    holed = t.copy()
    holed[1, 1] = np.nan
    with pytest.raises(ValueError, match="transmission is NaN or infinite at 1 of 12"):
        function(image, GREY, holed)
    with pytest.raises(ValueError, match="transmission has 4 × 2 pixels but image has 4 × 3"):
        function(image, GREY, t[:2])


def test_without_noise_it_is_plain_inversion():
    _, t, image = noisy_steps()
    quiet = non_local(image, GREY, t, noise_sigma=0.0, floor=0.05)
    np.testing.assert_array_equal(quiet, invert(image, GREY, t, floor=0.05))


def test_the_mean_takes_most_of_the_noise_and_the_median_some():
    scene, t, image = noisy_steps()
    plain = rms(invert(image, GREY, t, clip=False) - scene)
    mean = rms(non_local(image, GREY, t, noise_sigma=SIGMA, clip=False) - scene)
    median = rms(non_local(image, GREY, t, noise_sigma=SIGMA, solver="median", window=9, clip=False) - scene)
    # 441 neighbours, of which a corner of a square has a quarter, would leave a tenth.
    assert mean < 0.35 * plain
    assert median < 0.75 * plain


def test_edges_of_the_scene_stay():
    scene, t, image = noisy_steps()
    got = non_local(image, GREY, t, noise_sigma=SIGMA, clip=False)
    near = np.s_[:, :48]  # where the haze is thin
    step = np.abs(scene[near][:, 15] - scene[near][:, 16]).mean()
    assert np.abs(got[near][:, 15] - got[near][:, 16]).mean() > 0.9 * step


def test_noise_that_is_not_given_is_estimated():
    _, t, image = noisy_steps()
    given_, found = (non_local(image, GREY, t, noise_sigma=sigma) for sigma in (SIGMA, None))
    assert rms(found - given_) < 0.2 * rms(given_ - np.clip(invert(image, GREY, t), 0, 1))


@pytest.mark.parametrize("options", [{}, {"solver": "median", "window": 5}])
def test_one_and_two_threads_give_the_same_bytes(options):
    image = np.random.default_rng(0).random((190, 180, 3)).astype(np.float32)
    t = np.random.default_rng(1).uniform(0.1, 1, (190, 180)).astype(np.float32)
    window = {"window": 7} | options
    before = threads()
    try:
        runs = []
        for count in (1, 2):
            set_threads(count)
            runs.append(non_local(image, GREY, t, noise_sigma=SIGMA, **window))
    finally:
        set_threads(before)
    assert runs[0].tobytes() == runs[1].tobytes()


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 3), (2, 40)])
@pytest.mark.parametrize("solver", ["mean", "median"])
@pytest.mark.parametrize("sigma", [None, SIGMA])
def test_images_smaller_than_a_window(shape, solver, sigma):
    image = np.full((*shape, 3), 0.6, np.float32)
    got = non_local(image, GREY, np.full(shape, 0.5, np.float32), noise_sigma=sigma, solver=solver, window=9)
    np.testing.assert_allclose(got, 0.3, atol=1e-6)  # 0.9 − 0.3 / 0.5, float32


def test_double_precision_stays():
    _, t, image = noisy_steps()
    got = non_local(image.astype(np.float64), GREY, t.astype(np.float64), noise_sigma=SIGMA, window=9)
    assert got.dtype == np.float64
    # The inversion in double precision, rounded, against that in single precision.
    np.testing.assert_allclose(got, non_local(image, GREY, t, noise_sigma=SIGMA, window=9), atol=1e-4)


def test_a_wrong_airlight_gives_clouds_no_colour_and_near_things_keep_theirs():
    rng = np.random.default_rng(6)
    scene = np.repeat(rng.uniform(0.5, 0.9, (40, 60, 1)), 3, axis=2).astype(np.float32)  # grey clouds
    scene[:, :20] = [0.6, 0.2, 0.1]
    t = np.full((40, 60), 0.12, np.float32)
    t[:, :20] = 0.9
    wrong = GREY + np.array([0.01, 0.0, -0.01], np.float32)
    found = invert(naive(scene, t, GREY), wrong, t, clip=False)
    tempered = tempered_colour(found, t, airlight_error=0.02)
    chroma = np.ptp(found, axis=2), np.ptp(tempered, axis=2)
    assert chroma[0][:, 20:].min() > 0.1  # 0.02 (1 − t) / t
    assert chroma[1][:, 20:].max() < 0.5 * chroma[0][:, 20:].min()
    np.testing.assert_allclose(tempered[:, :20], found[:, :20], atol=0.002)  # (0.02 · 0.1)² of (0.9 · 0.3)²
    np.testing.assert_allclose(tempered.mean(axis=2), found.mean(axis=2), atol=1e-6)  # float32
    assert (tempered_colour(found, t, airlight_error=0.0) == found).all()


@pytest.mark.parametrize("value", [0.0, 0.9, 5.0])
def test_colours_of_grey_and_tiny_images_are_tempered_without_nan(value):
    image, t = np.full((1, 3, 3), value, np.float32), np.array([[0.0, 0.5, 1.0]], np.float32)
    np.testing.assert_allclose(tempered_colour(image, t), image, rtol=1e-6)  # float32
    with pytest.raises(ValueError, match="transmission"):
        tempered_colour(image, np.full((1, 3), np.nan, np.float32))
