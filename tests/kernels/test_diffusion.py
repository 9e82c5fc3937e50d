"""Diffusion that meets a tolerance: the promise of `auto`, the hard cases, and what every solver keeps."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt, gaussian_filter

from fogpipe.io.scenes import open_scene
from fogpipe.kernels import bands
from fogpipe.kernels.diffusion import SOLVERS, adi, auto, fed, reference
from fogpipe.kernels.diffusion.choice import choose
from fogpipe.kernels.diffusion.grid import coarser, fine_grid, project, transfer
from fogpipe.kernels.diffusion.published import euler, fed_steps
from fogpipe.kernels.diffusion.pyramid import pyramid


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))


def yardstick(name: str) -> tuple[np.ndarray, np.ndarray]:
    """A sample scene as a premultiplied layer of 280 × 400 pixels, and its range as a share of the farthest."""
    values = open_scene(f"sample:{name}").load("linear").values
    range_map = values["range_map"].copy()
    farthest = np.percentile(range_map[np.isfinite(range_map)], 99)
    if name == "outdoor":
        range_map[~np.isfinite(range_map)] = farthest  # sky
    holes = ~np.isfinite(range_map)
    range_map = range_map[tuple(distance_transform_edt(holes, return_distances=False, return_indices=True))]
    ratio = np.minimum(cv2.resize(range_map, (400, 280), interpolation=cv2.INTER_NEAREST) / farthest, 1)
    image = cv2.resize(values["image"], (400, 280), interpolation=cv2.INTER_AREA)
    t = np.exp(-ratio)[..., None]
    return np.concatenate([image * t, t], axis=2).astype(np.float32), ratio.astype(np.float32)


@pytest.fixture(scope="module", params=["motorcycle", "outdoor"])
def frame(request) -> tuple[np.ndarray, np.ndarray]:
    return yardstick(request.param)


@pytest.mark.parametrize("largest", [8.5, 16.0, 25.0])
def test_auto_keeps_its_promise(frame, largest):
    layer, ratio = frame
    scale = 1 + ratio**1.5 * (largest - 1)
    exact = reference(layer, scale, 1.0)
    for tolerance in (1e-2, 4e-3, 2e-3, 1e-3, 3e-4):
        assert rms(auto(layer, scale, 1.0, tolerance) - exact) <= tolerance


@pytest.mark.parametrize("tolerance", [1e-2, 2e-3, 3e-4])
@pytest.mark.parametrize("power", [1, 3])
def test_auto_keeps_its_promise_where_the_scale_grows_smoothly(power, tolerance):
    layer, _ = yardstick("motorcycle")
    scale = np.tile(1 + 24 * np.linspace(0, 1, 400) ** power, (280, 1))
    assert rms(auto(layer, scale, 1.0, tolerance) - reference(layer, scale, 1.0)) <= tolerance


@pytest.mark.parametrize("sigma", [2.0, 5.0, 12.0, 25.0])
@pytest.mark.parametrize("tolerance", [1e-2, 2e-3, 3e-4])
def test_auto_against_the_gaussian(sigma, tolerance):
    layer, _ = yardstick("motorcycle")
    width = math.sqrt(sigma**2 - 1)
    exact = gaussian_filter(layer.astype(np.float64), (width, width, 0), mode="reflect")
    error = rms(auto(layer, np.full(layer.shape[:2], sigma), 1.0, tolerance) - exact)
    # The equation on four neighbours is itself 2.5e-3/σ² from the Gaussian, measured on this frame.
    assert error <= tolerance + 3e-3 / sigma**2


def test_a_frame_without_jumps_gets_levels_and_one_with_jumps_does_not():
    layer, ratio = yardstick("motorcycle")
    assert choose(layer, np.full_like(ratio, 25.0), 1.0, 2e-3)[0] >= 2
    torn = np.where(np.indices(ratio.shape)[1] // 5 % 2, 25.0, 1.0).astype(np.float32)
    assert choose(layer, torn, 1.0, 2e-3)[0] == 0


def test_the_reference_is_what_euler_converges_to(frame):
    layer, ratio = (part[:90, :120] for part in frame)
    scale = 1 + ratio * 3
    exact = reference(layer, scale, 1.0)
    errors = [rms(euler(layer.astype(np.float64), scale, 1.0, rate) - exact) for rate in (0.1, 0.05, 0.025)]
    # First order: half the rate, half the error.
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.1)
    assert rms(pyramid(layer.astype(np.float64), scale.astype(np.float64), 1.0, 0, math.inf, 1e-6) - exact) < 1e-6


def test_fed_and_adi_come_near(frame):
    layer, ratio = frame
    scale = 1 + ratio**1.5 * 7.5
    exact = reference(layer, scale, 1.0)
    # Measured 1.0e-3 and 6e-4 (fed), 9e-4 and 1.5e-3 (adi).
    assert rms(fed(layer, scale, 1.0, 0.25) - exact) < 2e-3
    assert rms(adi(layer, scale, 1.0) - exact) < 3e-3
    # Implicit steps are first order.
    assert rms(adi(layer, scale, 1.0, 32) - exact) < 0.5 * rms(adi(layer, scale, 1.0, 8) - exact)


@given(st.floats(1e-3, 1e5), st.integers(1, 6))
def test_a_cycle_of_fed_goes_all_the_way_and_is_stable(euler_count, cycles):
    sizes = fed_steps(euler_count, cycles)
    assert sizes.sum() * cycles == pytest.approx(1)
    # A whole cycle shrinks every pattern: λ up to twice the number of Euler steps at the limit.
    patterns = np.linspace(0, 2 * euler_count, 1001)
    log_gain = np.log(np.abs(1 - np.outer(patterns, sizes)) + 1e-300).sum(axis=1)
    assert log_gain.max() <= 1e-6


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 37), (37, 1), (2, 3), (5, 7), (31, 33), (64, 65), (99, 300)])
@pytest.mark.parametrize("levels", [0, 1, 2, 4])
def test_the_mean_is_conserved_and_a_constant_stays(shape, levels):
    rng = np.random.default_rng(1)
    scale = rng.choice([0.5, 1.0, 3.0, 25.0], shape).astype(np.float32)
    scale = np.maximum(scale, 1)
    layer = rng.random((*shape, 4), dtype=np.float32)
    after = pyramid(layer, scale, 1.0, levels, 4.0, 0.01)
    assert np.isfinite(after).all()
    # Rates of neighbours cancel; float32 rounding of up to a hundred steps. Tiles of unlike age meet below the share.
    np.testing.assert_allclose(after.mean((0, 1), dtype=float), layer.mean((0, 1), dtype=float), atol=1e-5)
    constant = pyramid(np.full_like(layer, 0.3), scale, 1.0, levels, 4.0, 0.01)
    np.testing.assert_allclose(constant, 0.3, rtol=2e-5)


@pytest.mark.parametrize("shape", [(8, 8), (9, 14), (1, 5), (23, 1)])
def test_levels_conserve_what_they_hold(shape):
    rng = np.random.default_rng(2)
    layer = rng.random((shape[0], 4, shape[1]))
    widths, heights = rng.choice([0.25, 0.5, 1.0], shape[1]), np.ones(shape[0])
    across, along = transfer(widths), transfer(heights)
    coarse = project(layer, across, along)
    fine_sum = np.einsum("ykx,y,x", layer, heights, widths)
    coarse_sum = 4 * np.einsum("ykx,y,x", coarse, along.widths, across.widths)
    assert coarse_sum == pytest.approx(fine_sum, rel=1e-12)  # float64


def test_a_coarse_rate_is_a_quarter_of_an_even_one_and_nothing_crosses_a_wall():
    scale = np.full((16, 16), 5.0)
    grid = fine_grid(scale, 1.0)
    half = coarser(grid, transfer(grid.widths), transfer(grid.heights))
    np.testing.assert_allclose(half.east[:, :-1], 12 / 4)
    np.testing.assert_allclose(half.south[:-1], 12 / 4)
    scale[:, 6:9] = 1
    grid = fine_grid(scale, 1.0)
    half = coarser(grid, transfer(grid.widths), transfer(grid.heights))
    np.testing.assert_array_equal(half.east[:, 3], 0)


def impulse() -> np.ndarray:
    layer = np.zeros((65, 71, 4), np.float32)
    layer[32, 35] = 1
    return layer


def step() -> np.ndarray:
    layer = np.zeros((64, 80, 4), np.float32)
    layer[:, 40:] = 1e6
    return layer


def chequerboard() -> np.ndarray:
    return np.repeat((np.indices((63, 65)).sum(0) % 2)[..., None], 4, axis=2).astype(np.float32)


def jump(shape: tuple[int, ...]) -> np.ndarray:
    scale = np.full(shape[:2], 25.0, np.float32)
    scale[:, : shape[1] // 2] = 0.4
    return scale


def pole(shape: tuple[int, ...]) -> np.ndarray:
    scale = np.full(shape[:2], 12.0, np.float32)
    scale[:, shape[1] // 3] = 1
    return scale


@pytest.mark.parametrize(
    "make_scale", [jump, pole, lambda shape: np.full(shape[:2], 25.0)], ids=["jump", "pole", "even"]
)
@pytest.mark.parametrize("make_layer", [impulse, step, chequerboard], ids=["impulse", "step", "chequerboard"])
def test_hard_cases(make_layer, make_scale):
    layer = make_layer()
    scale = make_scale(layer.shape)
    tolerance = 2e-3 * float(layer.max())
    after = auto(layer, scale, 1.0, tolerance)
    assert np.isfinite(after).all()
    np.testing.assert_allclose(
        after.mean((0, 1), dtype=float), layer.mean((0, 1), dtype=float), atol=1e-5 * layer.max()
    )
    exact = reference(layer, scale, 1.0)
    assert rms(after - exact) <= tolerance
    # A polynomial, and interpolation at an edge, may overshoot; measured up to 0.014.
    overshoot = max(float(after.max() - layer.max()), float(layer.min() - after.min()))
    assert overshoot <= 0.05 * layer.max()


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_threads_do_not_change_a_bit(name, dtype):
    rng = np.random.default_rng(3)
    layer = rng.random((190, 191, 4)).astype(dtype)
    scale = np.tile(np.linspace(1, 14, 191), (190, 1))
    before = bands.threads()
    try:
        results = []
        for count in (1, 2):
            bands.set_threads(count)
            results.append(SOLVERS[name](layer, scale, 1.0, 0.2, 0.01).tobytes())
    finally:
        bands.set_threads(before)
    assert results[0] == results[1]


@pytest.mark.parametrize("name", SOLVERS)
def test_sharp_foreground_stays(name):
    rng = np.random.default_rng(4)
    layer, scale = rng.random((40, 60, 4), dtype=np.float32), np.full((40, 60), 8.0)
    scale[:, :25] = 1
    after = SOLVERS[name](layer, scale, 1.0, 0.25, 1e-3)
    # Only the last column of the foreground meets the blurred side; rates of 0 move nothing else.
    np.testing.assert_allclose(after[:, :24], layer[:, :24], atol=2e-3)
    assert not np.allclose(after[:, 30:], layer[:, 30:], atol=0.1)
