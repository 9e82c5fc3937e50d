"""The two published diffusion schemes: what they conserve, what they converge to, and by how much they miss."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from fogpipe.kernels import bands
from fogpipe.kernels.diffusion.published import euler, euler_steps, invariant, invariant_corrected, invariant_steps

BOTH = pytest.mark.parametrize("solver", [invariant, euler], ids=["invariant", "euler"])
FLOATS = pytest.mark.parametrize("dtype", [np.float32, np.float64])


def noise(height: int, width: int, dtype=np.float32) -> np.ndarray:
    return np.random.default_rng(2).random((height, width, 4)).astype(dtype)


def ramp(height: int, width: int, largest: float = 6.0) -> np.ndarray:
    """A scale from σ0 on the left to ``largest`` on the right."""
    return np.tile(np.linspace(1, largest, width), (height, 1))


def test_the_number_of_steps_in_the_paper():
    # Section 5.3: more than 900 iterations as opposed to 13, for 25 px.
    assert euler_steps(25, 1, 0.25) == 1248
    assert invariant_steps(25, 1, 0.25) == 13


@FLOATS
@pytest.mark.parametrize("scale", [ramp(33, 47), np.full((33, 47), 4.0)], ids=["ramp", "constant"])
def test_euler_conserves_the_mean(dtype, scale):
    layer = noise(33, 47, dtype)
    blurred = euler(layer, scale, 1.0, 0.25)
    steps = euler_steps(scale.max(), 1, 0.25)
    drift = np.abs(blurred.mean((0, 1), dtype=np.float64) - layer.mean((0, 1), dtype=np.float64))
    # What one pixel gives its neighbour takes, to the last bit; only the sum of a step is rounded, at random.
    assert drift.max() < np.sqrt(steps) * np.finfo(dtype).eps


@BOTH
@FLOATS
@pytest.mark.parametrize("rate", [0.25, 0.1])
def test_no_value_beyond_the_least_and_the_largest(solver, dtype, rate):
    layer = noise(29, 31, dtype)
    layer[5, 6] = 1e4  # HDR
    blurred = solver(layer, ramp(29, 31), 1.0, rate)
    # Weights of a mean, rounded once per step: at most 1e4 is exceeded by its own rounding.
    slack = np.finfo(dtype).eps * layer.max((0, 1))
    assert (blurred >= layer.min((0, 1)) - slack).all()
    assert (blurred <= layer.max((0, 1)) + slack).all()


@BOTH
def test_a_constant_layer_stays(solver):
    layer = np.full((13, 17, 4), 0.3, np.float32)
    # Differences of equal numbers are 0, whatever the weights.
    np.testing.assert_array_equal(solver(layer, ramp(13, 17), 1.0, 0.25), layer)


@BOTH
def test_a_sharp_foreground_stays_to_the_last_bit(solver):
    layer, scale = noise(20, 40), np.full((20, 40), 8.0)
    scale[:, :15] = 1
    blurred = solver(layer, scale, 1.0, 0.25)
    # At rate 0, samples are taken 1 px away: only the last column of the foreground meets the blurred side.
    np.testing.assert_array_equal(blurred[:, :14], layer[:, :14])
    assert (blurred[:, 20:] != layer[:, 20:]).any()


@BOTH
@FLOATS
def test_rows_and_columns_and_directions_are_treated_alike(solver, dtype):
    layer, scale = noise(18, 25, dtype), ramp(18, 25)
    blurred = solver(layer, scale, 1.0, 0.25)
    # Terms are added in another order, and distances to the far border are rounded.
    same = {"rtol": 0, "atol": 3000 * np.finfo(dtype).eps if solver is invariant else 10 * np.finfo(dtype).eps}
    mirrored = solver(layer[:, ::-1], scale[:, ::-1], 1.0, 0.25)
    np.testing.assert_allclose(mirrored[:, ::-1], blurred, **same)
    turned = solver(layer.transpose(1, 0, 2), scale.T, 1.0, 0.25)
    np.testing.assert_allclose(turned.transpose(1, 0, 2), blurred, **same)


def spread(solver, sigma: float, rate: float) -> float:
    """Variance that a point gains along an axis, as a share of σ² − σ0²."""
    half = round(6 * sigma)
    layer = np.zeros((2 * half + 1, 2 * half + 1, 4))
    layer[half, half] = 1
    profile = solver(layer, np.full(layer.shape[:2], sigma), 1.0, rate)[..., 0].sum(0)
    return (profile * np.arange(-half, half + 1) ** 2).sum() / profile.sum() / (sigma**2 - 1)


@pytest.mark.parametrize("sigma", [2.0, 3.3, 7.0])
def test_euler_reaches_the_variance(sigma):
    # Each step adds exactly twice its rate; 1e-9 is the Gaussian tail beyond 6 σ.
    assert spread(euler, sigma, 0.25) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("sigma", "rate", "measured"),
    [(5.0, 0.25, 0.804), (15.0, 0.25, 0.778), (15.0, 0.125, 0.886), (15.0, 0.0625, 0.944)],
)
def test_invariant_misses_the_variance(sigma, rate, measured):
    """The published scheme adds 2ρσk² in a step where the scale asks for (e^{2ρ} − 1)σk²."""
    got = spread(invariant, sigma, rate)
    assert got == pytest.approx(measured, abs=2e-3)  # measured figures, three decimals
    actual_rate = np.log(sigma) / invariant_steps(sigma, 1, rate)
    predicted = 2 * actual_rate / np.expm1(2 * actual_rate)
    # A sample between two pixels, f of the way, adds 2ρ f (1 − f) px² to a step: at most ½ ln(σ/σ0) to all of them.
    assert predicted < got < predicted + 0.5 * np.log(sigma) / (sigma**2 - 1)


@pytest.mark.parametrize("sigma", [5.0, 15.0])
def test_the_corrected_invariant_scheme_reaches_the_variance(sigma):
    got = spread(invariant_corrected, sigma, 0.25)
    # A sample between two pixels adds up to ½ ln(σ/σ0) times 2ρ'/2ρ < 1.25, as in the published scheme.
    assert 1 - 1e-6 < got < 1 + 0.65 * np.log(sigma) / (sigma**2 - 1)


def gaussian_error(solver, image: np.ndarray, sigma: float, rate: float) -> tuple[float, float]:
    """RMS and largest error against the exact Gaussian, four σ inside the border."""
    layer = np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
    blurred = solver(layer, np.full(layer.shape[:2], sigma), 1.0, rate)
    width = np.sqrt(sigma**2 - 1)
    exact = gaussian_filter(layer.astype(np.float64), (width, width, 0), mode="nearest")
    border = round(4 * sigma)
    error = (blurred - exact)[border:-border, border:-border, :3]
    return float(np.sqrt((error**2).mean())), float(np.abs(error).max())


@pytest.fixture(scope="module")
def photograph() -> np.ndarray:
    """Part of the Motorcycle frame, in linear light to within the shape of the curve."""
    import skimage.data

    left, _, _ = skimage.data.stereo_motorcycle()
    return ((left[60:360, 100:500] / 255) ** 2.2).astype(np.float32)


@pytest.mark.parametrize("sigma", [3.0, 5.0, 10.0])
def test_euler_against_the_gaussian(photograph, sigma):
    rms, largest = gaussian_error(euler, photograph, sigma, 0.125)
    # Measured 1.5e-4, 6e-5 and 2e-5: the four-neighbour Laplacian errs in proportion to 1/σ².
    assert rms < 2e-3 / sigma**2
    assert largest < 3e-2 / sigma**2


def test_euler_at_the_limit_leaves_a_chequerboard(photograph):
    """At a rate of exactly 1/4 the pattern of alternating pixels changes sign at each step, and never fades."""
    at_limit, _ = gaussian_error(euler, photograph, 5.0, 0.25)
    below, _ = gaussian_error(euler, photograph, 5.0, 0.2)
    # 48 steps at 1/4; 60 at 0.2, each of which multiplies the pattern by −0.6. Measured 9.6e-4 and 1.3e-4.
    assert below < at_limit / 5


@pytest.mark.parametrize("sigma", [5.0, 10.0, 20.0])
def test_invariant_against_the_gaussian(photograph, sigma):
    rms, _ = gaussian_error(invariant, photograph, sigma, 0.25)
    # Measured 6.4e-3, 7.6e-3 and 8.7e-3: three quarters of the variance are reached.
    assert 3e-3 < rms < 1e-2


def test_invariant_with_a_scale_that_varies(photograph):
    layer = np.concatenate([photograph, np.ones_like(photograph[..., :1])], axis=2)
    scale = ramp(*layer.shape[:2], largest=10.0)
    # Half the rate moves this reference by 3e-5, so it stands for the equation itself.
    exact = euler(layer.astype(np.float64), scale, 1.0, 0.2)
    error = invariant(layer, scale, 1.0, 0.25) - exact
    # Measured 4.6e-3, and 0.086 at worst.
    assert 3e-3 < np.sqrt((error**2).mean()) < 6e-3
    assert np.abs(error).max() < 0.1


@BOTH
@FLOATS
def test_threads_do_not_change_a_bit(solver, dtype):
    layer, scale = noise(190, 191, dtype), ramp(190, 191, 4.0)  # two bands
    before = bands.threads()
    try:
        results = []
        for count in (1, 2):
            bands.set_threads(count)
            results.append(solver(layer, scale, 1.0, 0.25).tobytes())
    finally:
        bands.set_threads(before)
    assert results[0] == results[1]


@BOTH
@settings(deadline=None, max_examples=40)  # the first call compiles
@given(
    height=st.integers(1, 7),
    width=st.integers(1, 7),
    largest=st.floats(1, 30),
    finest=st.floats(0.3, 2),
    hdr=st.booleans(),
)
def test_every_shape_and_scale(solver, height, width, largest, finest, hdr):
    layer = noise(height, width) * (1e4 if hdr else 1)
    kept = layer.copy()
    layer.flags.writeable = False
    blurred = solver(layer, ramp(height, width, largest), finest, 0.25)
    slack = 1e-6 * layer.max()  # float32
    assert blurred.shape == layer.shape
    assert blurred.dtype == np.float32
    assert blurred.min() >= layer.min() - slack
    assert blurred.max() <= layer.max() + slack
    np.testing.assert_array_equal(layer, kept)
