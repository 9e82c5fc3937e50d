"""Spreading sparse returns over the pixels between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fogpipe.stages.range import densify


def slanted_floor(height: int = 60, width: int = 80) -> tuple[np.ndarray, np.ndarray]:
    """A plane whose inverse range is linear in the image, as a floor's is, and a grey picture of it."""
    inverse = np.linspace(1 / 40, 1 / 5, height, dtype=np.float32)[:, None] * np.ones((1, width), np.float32)
    return 1 / inverse, np.full((height, width, 3), 0.5, np.float32)


def beams(range_map: np.ndarray, every: int = 6) -> np.ndarray:
    """The same map as a lidar would see it: one row in ``every``."""
    sparse = np.full_like(range_map, np.nan)
    sparse[::every] = range_map[::every]
    return sparse


def test_measured_pixels_are_the_same_to_the_last_bit_and_all_others_are_filled():
    truth, image = slanted_floor()
    sparse = beams(truth)
    dense = densify(sparse, image)
    np.testing.assert_array_equal(dense[::6], sparse[::6])
    assert np.isfinite(dense).all()


def test_a_plane_comes_back_to_a_few_per_cent():
    truth, image = slanted_floor()
    dense = densify(beams(truth), image)
    inner = np.s_[6:-8]
    # The nearest beam is at most 3 rows away, and a row changes the inverse range by 0.3 % of its largest value.
    assert np.abs(1 / dense - 1 / truth)[inner].max() < 3 * 0.003


def test_an_edge_of_the_range_falls_on_the_edge_of_the_image():
    truth, image = slanted_floor()
    truth[:, 41:] = 3.0
    image[:, 41:] = 0.05
    sparse = beams(truth)
    sparse[:, 36:44] = np.nan  # no beam within 4 pixels of the edge
    inverse = 1 / densify(sparse, image, window=15)[8:-8]
    middle = (1 / truth[8:-8, 40] + 1 / 3.0) / 2
    # Without the picture the edge would be midway between the beams, between the columns 39 and 40.
    assert (inverse[:, 40] < middle).all()
    assert (inverse[:, 41] > middle).all()


def test_a_dense_map_is_returned_unchanged():
    truth, image = slanted_floor()
    truth[10:20, 10:20] = np.nan
    np.testing.assert_array_equal(densify(truth, image), truth)


def test_beyond_reach_pixels_stay_unknown():
    truth, image = slanted_floor()
    sparse = beams(truth)
    sparse[:30] = np.nan
    dense = densify(sparse, image, reach=5)
    assert np.isnan(dense[:25]).all()
    assert np.isfinite(dense[26:]).all()


def test_infinite_and_zero_range_survive():
    truth, image = slanted_floor()
    truth[0], truth[6] = np.inf, 0.0
    dense = densify(beams(truth), image)
    assert np.isposinf(dense[0]).all()
    assert (dense[6] == 0).all()
    assert not np.isnan(dense).any()


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_nothing_measured_or_tiny(shape: tuple[int, int]):
    nothing = np.full(shape, np.nan, np.float32)
    image = np.zeros((*shape, 3), np.float32)
    assert np.isnan(densify(nothing, image)).all()
    single = nothing.copy()
    single[0, 0] = 4
    np.testing.assert_allclose(densify(single, image), 4, rtol=1e-6)  # inverse and back, float32


def test_real_lidar_held_out_returns_are_met(shared_data: Path):
    from fogpipe.io.depth import read_depth
    from fogpipe.io.images import read_image

    image = read_image(shared_data / "kitti" / "rgb.png").pixels
    truth = read_depth(shared_data / "kitti" / "depth.png", encoding="kitti", camera=None).values
    measured = np.flatnonzero(np.isfinite(truth))
    held_out = np.random.default_rng(0).choice(measured, measured.size // 10, replace=False)
    sparse = truth.copy()
    sparse.ravel()[held_out] = np.nan
    error = np.abs(densify(sparse, image).ravel()[held_out] / truth.ravel()[held_out] - 1)
    # Measured: median 0.5 %, ninth decile 1.7 %; what is beyond lies at outlines.
    assert np.median(error) < 0.01
    assert np.quantile(error, 0.9) < 0.03
