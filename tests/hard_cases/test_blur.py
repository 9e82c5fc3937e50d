"""Every blur solver where blurs go wrong: overshoot within a stated bound, no NaN, the mean kept, the same bytes."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels import bands
from fogpipe.kernels.diffusion import SOLVERS, reference
from fogpipe.kernels.diffusion.choice import Plan, follow
from fogpipe.kernels.diffusion.published import prepared
from fogpipe.stages.blur import diffusion


def on_cells(layer, scale, finest, max_rate, tolerance):
    """What auto does on large photographs; these small layers it would do on their pixels."""
    layer, scale = prepared(layer, scale, finest)
    return follow(Plan(2.0, 1, 0.01), layer, scale, finest)


SOLVERS = SOLVERS | {"cells": on_cells}
CONSERVING = [name for name in SOLVERS if not name.startswith("invariant") and name != "mipmap"]
"""The others do not solve the equation in the form that conserves the mean."""
OVERSHOOT = {"auto": 0.03, "cells": 0.03, "fed": 0.05}
"""Share of the range of values by which a solver may leave it; the rest are means with no negative weight."""


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


def odd() -> np.ndarray:
    """One row and column more than whole tiles of 48 × 96, noise."""
    return np.random.default_rng(6).random((97, 193, 4), dtype=np.float32)


def row() -> np.ndarray:
    return np.random.default_rng(7).random((1, 90, 4), dtype=np.float32)


def jump(shape: tuple[int, ...]) -> np.ndarray:
    scale = np.full(shape[:2], 25.0, np.float32)
    scale[:, : shape[1] // 2] = 1
    return scale


def below(shape: tuple[int, ...]) -> np.ndarray:
    """σ < σ0 stands for σ0."""
    return np.where(jump(shape) > 1, np.float32(6), np.float32(0.4))


def pole(shape: tuple[int, ...]) -> np.ndarray:
    scale = np.full(shape[:2], 12.0, np.float32)
    scale[:, shape[1] // 3] = 1
    return scale


def even(shape: tuple[int, ...]) -> np.ndarray:
    return np.full(shape[:2], 25.0, np.float32)


LAYERS = pytest.mark.parametrize("make_layer", [impulse, step, chequerboard, odd, row], ids=lambda f: f.__name__)
SCALES = pytest.mark.parametrize("make_scale", [jump, below, pole, even], ids=lambda f: f.__name__)


@pytest.mark.parametrize("name", SOLVERS)
@SCALES
@LAYERS
def test_values_stay_and_so_does_their_mean(name, make_layer, make_scale):
    layer = make_layer()
    height = float(layer.max())
    after = SOLVERS[name](layer, make_scale(layer.shape), 1.0, 0.2, 2e-3 * height)
    assert np.isfinite(after).all()
    overshoot = max(float(after.max()) - height, float(layer.min()) - float(after.min()))
    assert overshoot <= (OVERSHOOT.get(name, 0) + 1e-5) * height  # 1e-5: float32
    if name in CONSERVING:
        np.testing.assert_allclose(
            after.mean((0, 1), dtype=float), layer.mean((0, 1), dtype=float), rtol=0, atol=1e-5 * height
        )


@SCALES
@LAYERS
def test_auto_keeps_its_promise(make_layer, make_scale):
    layer = make_layer()
    scale = make_scale(layer.shape)
    exact = reference(layer, scale, 1.0)
    for share in (1e-2, 2e-3, 3e-4):
        tolerance = share * float(layer.max())
        difference = SOLVERS["auto"](layer, scale, 1.0, 0.25, tolerance) - exact
        assert np.sqrt(np.mean(difference**2)) <= tolerance


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


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (1, 40), (40, 1), (2, 2), (3, 200), (200, 3)])
@pytest.mark.parametrize("width", [1.5, 25.0, 60.0])
def test_auto_takes_every_shape(shape: tuple[int, int], width: float):
    rng = np.random.default_rng(8)
    layer = rng.random((*shape, 4), dtype=np.float32)
    scale = np.float32(width) * (1 + rng.random(shape, dtype=np.float32))
    blurred = diffusion(layer, scale)
    # No light is made or lost, but for the rounding of single precision.
    np.testing.assert_allclose(blurred.mean((0, 1), dtype=float), layer.mean((0, 1), dtype=float), atol=1e-5)


def test_a_blur_wider_than_any_picture_stays_between_the_values():
    rng = np.random.default_rng(9)
    layer = rng.random((60, 70, 4), dtype=np.float32)
    blurred = diffusion(layer, np.full((60, 70), 400, np.float32))
    # 400 px over 70 px leaves the mean; rounding errors of some 150 stretches of single precision add to 1e-5.
    np.testing.assert_allclose(blurred, np.broadcast_to(layer.mean((0, 1)), layer.shape), atol=1e-4)


@pytest.mark.parametrize("shape", [(40, 50), (300, 330)])
def test_nothing_is_blurred_at_once_however_wide(shape):
    """Air that lets nothing through leaves an empty layer, and a blur of thousands of pixels."""
    layer = np.zeros((*shape, 4), np.float32)
    np.testing.assert_array_equal(diffusion(layer, np.full(shape, 7000, np.float32)), 0)


@pytest.mark.parametrize("column", [400, 401])
def test_a_single_point_of_light_spreads_wherever_it_is(column):
    """What auto looks at is a sample of the layer, which may hold the point, or a neighbour of it, or nothing."""
    layer = np.zeros((300, 800, 4), np.float32)
    layer[::9, column] = 1
    blurred = diffusion(layer, np.full((300, 800), 9, np.float32))
    np.testing.assert_allclose(blurred.mean((0, 1), dtype=float), layer.mean((0, 1), dtype=float), atol=1e-5)
    # 34 points over 300 rows, each spread over √(9² − 1) px across: 0.0050 at the column, to a tenth.
    assert blurred[100:200, column].mean() == pytest.approx(34 / 300 / np.sqrt(2 * np.pi * 80), rel=0.1)


def test_a_photograph_that_is_blurred_away_leaves_its_mean():
    noise = np.random.default_rng(10).random((300, 330, 4), dtype=np.float32) - 0.5
    layer = noise.cumsum(axis=0).cumsum(axis=1) / 300
    blurred = diffusion(layer, np.full((300, 330), 7000, np.float32))
    np.testing.assert_allclose(blurred, np.broadcast_to(layer.mean((0, 1)), layer.shape), atol=2e-3)  # the tolerance
