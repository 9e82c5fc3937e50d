"""Diffusion on the pixels: tiles, and the rows that roll down them, leave no trace in the result."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_cdt

from fogpipe.kernels.diffusion import tiles
from fogpipe.kernels.diffusion.polynomial import LARGEST_FACTOR, coefficients, degree_for, quantised
from fogpipe.kernels.diffusion.rolling import COLUMNS
from fogpipe.kernels.diffusion.tiles import LEAST_ROWS, SQUARE

FEW, MANY = (1.0, 0.15), (16.0, 0.005)
"""Rate and share of a polynomial of one pass over the tiles, and of more than one."""
SHAPES = [(1, 1), (1, 700), (300, 1), (3, 5), (2 * LEAST_ROWS - 3, COLUMNS + 12), (LEAST_ROWS, 2 * COLUMNS + 6)]


def on_grid(layer: np.ndarray, rate: np.ndarray, *arguments) -> np.ndarray:
    """Of rates in place of scales, for a σ0 of 1."""
    return tiles.on_grid(layer, np.sqrt(2 * rate + 1), 1.0, *arguments)


def degree(largest: float, share: float) -> int:
    return degree_for(quantised(8 * largest), share)


def some(shape: tuple[int, int], seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A layer of noise, and squares of it: single ones, many, single ones, none, and again single ones,
    and some that lead into a corner."""
    rng = np.random.default_rng(seed)
    squares = [-(-count // SQUARE) for count in shape]
    often = np.array([0.002, 0.5, 0.002, 0.0, 0.002])[np.arange(squares[1]) * 5 // squares[1]]
    wanted = rng.random(squares) < often
    np.fill_diagonal(wanted[-16:, -16:], val=True)  # what is beside them, up to the border, is now needed and now not
    return rng.random((*shape, 4), np.float32), wanted


def pixels(squares: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return np.kron(squares, np.ones((SQUARE, SQUARE), bool))[: shape[0], : shape[1]]


def by_matrix(layer: np.ndarray, rate: np.ndarray, largest: float, share: float) -> np.ndarray:
    """The polynomial in float64, from its series, a step at a time over the whole layer."""
    spectrum = quantised(8 * largest)
    across, down = (rate[:, 1:] + rate[:, :-1]) / 2, (rate[1:] + rate[:-1]) / 2

    def step(values: np.ndarray) -> np.ndarray:  # X = 1 − 2A/λ
        flow = np.zeros_like(values)
        for axis, ways in ((1, across), (0, down)):
            moved = ways[..., None] * np.diff(values, axis=axis)
            nothing = np.zeros_like(np.take(values, [0], axis=axis))
            flow += np.diff(np.concatenate([nothing, moved, nothing], axis=axis), axis=axis)
        return values + 2 / spectrum * flow

    series = coefficients(spectrum, degree_for(spectrum, share))
    before, now = layer, step(layer)
    total = series[0] * before + series[1] * now
    for factor in series[2:]:
        before, now = now, 2 * step(now) - before
        total += factor * now
    return total


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("largest", "share"), [FEW, (8.0, 0.0285), MANY])
def test_it_is_the_polynomial(shape, largest, share):
    layer = some(shape)[0].astype(np.float64)
    rate = np.random.default_rng(2).uniform(0.9 * largest, largest, shape)  # so that no tile takes fewer steps
    wanted = by_matrix(layer, rate, largest, share)
    # Rounding of some dozens of steps in float64, and of the roots where there is more than one pass.
    np.testing.assert_allclose(on_grid(layer, rate, largest, share), wanted, atol=1e-9)


def test_the_cases_are_of_one_pass_and_of_more():
    assert degree(*FEW) <= LARGEST_FACTOR < degree(*MANY)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("largest", "share"), [FEW, MANY])
def test_squares_that_are_wanted_are_as_if_all_were(shape, largest, share):
    (layer, squares), rate = some(shape), np.full(shape, largest, np.float32)
    wanted = pixels(squares, shape)
    after = on_grid(layer, rate, largest, share, squares, np.full_like(layer, np.nan))
    np.testing.assert_array_equal(after[wanted], on_grid(layer, rate, largest, share)[wanted])


@pytest.mark.parametrize("shape", SHAPES[-2:])
@pytest.mark.parametrize(("largest", "share"), [FEW, MANY])
def test_what_is_farther_than_steps_reach_does_not_matter_were_it_nan(shape, largest, share):
    (layer, squares), rate = some(shape, 3), np.full(shape, largest, np.float32)
    wanted = pixels(squares, shape)
    far = distance_transform_cdt(~wanted, "taxicab") > degree(largest, share)
    assert far.any()
    assert wanted.any()
    missing = np.where(far[..., None], np.float32(np.nan), layer)
    after = on_grid(missing, rate, largest, share, squares)
    np.testing.assert_array_equal(after[wanted], on_grid(layer, rate, largest, share)[wanted])


def test_where_no_light_moves_all_stays_as_it_is():
    layer, squares = some((200, 1100))
    wanted = pixels(squares, layer.shape[:2])
    after = on_grid(layer, np.zeros(layer.shape[:2], np.float32), 1.0, 0.15, squares)
    np.testing.assert_array_equal(after[wanted], layer[wanted])


def test_where_the_scale_is_unknown_nothing_is_blurred():
    """And a tile in which scales are missing is copied, or takes as few steps, as if these pixels were sharp."""
    layer = some((200, 700))[0]
    scale = np.ones(layer.shape[:2], np.float32)
    scale[:100] = np.random.default_rng(5).uniform(1, 1.2, (100, 700))
    unknown = np.random.default_rng(6).random(scale.shape) < 0.1
    missing, sharp = np.where(unknown, np.float32(np.nan), scale), np.where(unknown, np.float32(1), scale)
    expected = tiles.on_grid(layer, sharp, 1.0, *FEW)
    np.testing.assert_array_equal(tiles.on_grid(layer, missing, 1.0, *FEW), expected)
    np.testing.assert_array_equal(expected[2 * LEAST_ROWS + 4 :], layer[2 * LEAST_ROWS + 4 :])
    assert np.abs(expected[:100] - layer[:100]).mean() > 0.01
