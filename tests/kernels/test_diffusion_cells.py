"""Cells as large as the blur allows: what they cover, how they are linked, and what moves between them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from fogpipe.kernels import bands
from fogpipe.kernels.diffusion import reference
from fogpipe.kernels.diffusion.adaptive import adaptive
from fogpipe.kernels.diffusion.grid import FEW_CELLS, Level, hierarchy
from fogpipe.kernels.diffusion.partition import Partition, links_back, partition
from fogpipe.kernels.diffusion.rows import as_integers, end_of_run, flags, largest_known, largest_of, next_flag


def cells_of(scale: np.ndarray, clip: float = 2.0, cap: float = 4.0) -> tuple[list[Level], Partition]:
    levels = list(hierarchy(scale, 1.0, clip, cap))
    return levels, partition(levels, np.full_like(levels[0].joined, 2), cap)


def owners(levels: list[Level], cells: Partition) -> np.ndarray:
    """Number of the cell that each pixel is in, found anew from the places of the cells."""
    owner = np.full(levels[-1].joined.shape, -1)
    for k in range(len(levels) - 1, -1, -1):
        rows, columns = levels[k].shape
        joined = levels[k].joined
        bits = np.zeros((2 * joined.shape[0], 2 * joined.shape[1]), int)
        for bit in range(4):
            bits[bit >> 1 :: 2, bit & 1 :: 2] = joined >> bit & 1
        owner = np.where(bits > 0, np.kron(owner, np.ones((2, 2), int)), -1)[:rows, :columns].copy()
        first, last = cells.starts[k : k + 2]
        owner.ravel()[cells.places[first:last]] = np.arange(first, last)
    return owner


def torn(shape: tuple[int, int]) -> np.ndarray:
    """Scales with holes, tips and bridges of all sizes."""
    noise = np.random.default_rng(2).random(shape)
    return np.where(cv2.GaussianBlur(noise, (0, 0), 2) > 0.5, 25.0, 1.6) if min(shape) > 1 else 1 + 24 * noise


SHAPES = [(1, 1), (1, 9), (23, 1), (8, 8), (9, 14), (37, 65), (120, 90)]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_pixel_is_in_one_cell(shape):
    levels, cells = cells_of(torn(shape))
    assert cells.mass.sum() == shape[0] * shape[1]
    assert (cells.mass > 0).all()
    np.testing.assert_array_equal(np.bincount(owners(levels, cells).ravel(), minlength=len(cells.mass)), cells.mass)


@pytest.mark.parametrize("shape", SHAPES)
def test_what_flows_from_a_cell_to_another_flows_back_alike(shape):
    _, cells = cells_of(torn(shape))
    count = len(cells.mass)
    flow = np.zeros((count, count))
    for cell, (others, weights) in enumerate(zip(cells.neighbours, cells.weights, strict=True)):
        np.add.at(flow[cell], others[weights > 0], weights[weights > 0] * cells.mass[cell])
    start, back = cells.starts[1], links_back(cells)
    for cell in range(start, count):
        links = slice(back.first[cell - start], back.first[cell - start + 1])
        np.add.at(flow[cell], back.finer[links], back.rates[links] * cells.mass[cell])
    np.testing.assert_allclose(flow, flow.T, rtol=1e-12)  # float64
    # No link evens out the smaller of its cells by more than the cap; a cell may touch another along two sides.
    assert (cells.weights <= 4.0 + 1e-12).all()
    assert back.leaving == pytest.approx((flow.sum(axis=1) / cells.mass).max(), rel=1e-12)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 40])
def test_flags_are_found_one_after_the_other(count):
    for share in (0.0, 0.1, 0.9, 1.0):
        on = np.random.default_rng(count).random(count) < share
        found, eights = flags(count)
        found[:count] = on
        x, seen = next_flag(0, found, eights), []
        while x < count:
            end = end_of_run(x, found, eights)
            seen += range(x, end)
            x = next_flag(end, found, eights)
        assert seen == np.flatnonzero(on).tolist()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_largest_is_found_among_the_bits(dtype):
    for values in ([0.0], [1e-40, 0.0], [3.0, 1e30, np.inf], [5.0, 312.0, 0.25]):
        largest = largest_of(as_integers(np.array(values, dtype)))
        assert np.array([largest], f"i{np.dtype(dtype).itemsize}").view(dtype)[0] == dtype(max(values))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_largest_that_is_known_passes_over_what_is_not(dtype):
    for values in ([np.nan, 3.0, -7.0], [-np.nan, 0.0], [np.nan, np.inf, 1.0], [-1.0, -2.0, np.nan]):
        largest = largest_known(as_integers(np.array(values, dtype)))
        wanted = max(0, np.nanmax(values))
        assert np.array([largest], f"i{np.dtype(dtype).itemsize}").view(dtype)[0] == dtype(wanted)


def test_few_cells_are_not_joined_unless_links_between_them_would_be_capped():
    side = int(FEW_CELLS**0.5)
    # ϱ is 40 and 312 px²: over the pixels of a cell 10, 2.5 and 0.6, or 78, 20, 4.9 and 1.2.
    for scale, of_few, of_many in ((9.0, 2, 8), (25.0, 8, 16)):
        for count, across in ((side, of_few), (16 * side, of_many)):
            _, cells = cells_of(np.full((count, count), scale, np.float32), clip=2.0, cap=10.0)
            assert np.median(cells.mass) == across**2  # others are cut off by the border


def test_threads_do_not_change_a_bit():
    """Bands begin at odd rows as well, and beside one another cells are joined across the line between two."""
    scale = torn((620, 898)).astype(np.float32)
    layer = np.random.default_rng(5).random((*scale.shape, 4), dtype=np.float32)
    before = bands.threads()
    try:
        results = []
        for count in (1, 2, 3):
            bands.set_threads(count)
            results.append(adaptive(layer, scale, 1.0, 1.0, 0.1).tobytes())
    finally:
        bands.set_threads(before)
    assert results[0] == results[1] == results[2]


def test_the_rate_of_larger_cells_is_that_of_their_pixels():
    levels, _ = cells_of(np.full((32, 32), 9.0))
    assert levels[0].scale.shape == (32, 32)
    for level, size in zip(levels[1:], (2, 4, 8), strict=False):
        # ϱ = 40 px² less what means and interpolation blur, over the pixels in a cell of that size.
        rate = 40 - 0.5 * (size**2 - 1) / 3
        np.testing.assert_allclose(level.east[:, :-1] / level.mass[:, :-1], rate / size**2)
        np.testing.assert_allclose(level.south[:-1] / level.mass[:-1], rate / size**2)


def test_cells_grow_until_their_rate_is_below_the_clip():
    for scale, across in ((2.0, 1), (3.0, 2), (6.0, 4), (12.0, 8)):
        _, cells = cells_of(np.full((64, 64), scale))
        assert set(cells.mass) == {across**2}


def test_no_cell_lies_on_both_sides_of_a_wall():
    scale = np.full((64, 64), 25.0)
    scale[:, 29:32] = 1  # three columns, of which the outer two share what is beside them
    owner = owners(*cells_of(scale))
    left, right = owner[:, :29], owner[:, 32:]
    assert not set(left.ravel()) & set(right.ravel())
    layer = np.zeros((64, 64, 4), np.float32)
    layer[:, 31:] = 1
    after = adaptive(layer, scale.astype(np.float32), 1.0, 2.0, 1e-3)
    np.testing.assert_allclose(after[:, :29], 0, atol=1e-6)  # float32 rounding
    np.testing.assert_allclose(after[:, 31:], 1, atol=1e-5)  # and of coefficients


def test_two_parts_of_a_square_that_only_touch_at_a_corner_are_not_joined():
    scale = np.ones((16, 16))
    scale[:7, :7] = scale[9:, 9:] = 25  # with the pixels that share a face with these, two squares of eight
    levels, cells = cells_of(scale)
    owner = owners(levels, cells)
    upper, lower = owner[:8, :8], owner[8:, 8:]
    assert cells.mass.max() == 8 * 8 - 1  # the corners themselves touch nothing that is blurred
    assert not set(upper.ravel()) & set(lower.ravel())


def test_a_slope_stays_a_slope():
    """Light that grows evenly flows through; cells give back what they hold along that slope, whatever their size."""
    layer = np.repeat(np.add.outer(np.arange(160.0), 2 * np.arange(192.0))[..., None], 4, axis=2)
    after = adaptive(layer, np.full((160, 192), 8.0), 1.0, 2.0, 1e-6)
    # The borders, where nothing flows on, are five widths away.
    np.testing.assert_allclose(after[48:-48, 48:-48], layer[48:-48, 48:-48], rtol=2e-4)


@pytest.mark.parametrize("name", ["lens", "leaves", "poles"])
def test_the_error_falls_with_smaller_cells(name):
    rows, columns = np.indices((200, 264))
    scale = {
        "lens": 1 + 20 * np.exp(-((rows - 90) ** 2 + (columns - 140) ** 2) / 4000),
        "leaves": torn((200, 264)),
        "poles": np.where(columns % 40 < 3, 1.2, 20.0),
    }[name]
    layer = cv2.GaussianBlur(np.random.default_rng(3).random((200, 264, 4)), (0, 0), 1.5)
    layer = layer + (scale > 10)[..., None] * 0.5
    exact = reference(layer, scale, 1.0)
    errors = [float(np.sqrt(np.mean((adaptive(layer, scale, 1.0, clip, 1e-4) - exact) ** 2))) for clip in (1, 4, 16)]
    # Seen: 7.6e-3 … 1.7e-2 with the largest cells, a fifth to a third of that with the smallest.
    assert errors[0] > 1.3 * errors[1] > 1.6 * errors[2]
    assert errors[0] < 0.05


def test_pixels_far_from_larger_cells_are_done_on_the_grid_and_those_between_fit():
    """Both ways meet where the blur is narrow: no line between them stands out."""
    layer = cv2.GaussianBlur(np.random.default_rng(4).random((96, 400, 4), dtype=np.float32), (0, 0), 2)
    scale = np.tile(np.linspace(1, 6, 400, dtype=np.float32), (96, 1))
    error = np.abs(adaptive(layer, scale, 1.0, 4.0, 1e-3) - reference(layer, scale, 1.0)).mean((0, 2))
    alone = next(hierarchy(scale, 1.0, 4.0, 8.0)).joined[:, 1:-1].any(axis=0)
    first = 2 * int(np.argmax(alone)) + 2
    # Without larger cells only the polynomial errs, by a thousandth of the detail, which is 0.04; the last sixteen
    # columns before them get light from them.
    assert error[: first - 16].max() <= 4e-5
    assert error.max() <= 5e-3
