"""Measured range, its farthest point, and its holes."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels import regions
from fogpipe.stages.range import farthest, fill_holes, from_depth, to_relative
from fogpipe.stages.sky import identify


def rng():
    return np.random.default_rng(1)


def test_range_is_depth_along_the_ray():
    camera = np.array([[4.0, 0, 0], [0, 4, 0], [0, 0, 1]])
    depth = np.full((1, 4), 8.0)
    # The last pixel lies 3 px beside the axis of a 4 px lens: a triangle of 3, 4 and 5.
    got = from_depth(depth, camera)
    assert got[0, 0] == 8
    assert got[0, 3] == 10


def test_farthest_counts_only_what_is_measured():
    range_map = np.array([[1.0, np.nan, 7.5], [np.inf, 3.0, 0.0]], np.float32)
    assert farthest(range_map) == 7.5
    assert np.isnan(farthest(np.array([[np.nan, np.inf]])))


def test_stray_returns_can_be_left_out():
    range_map = np.linspace(0, 100, 101).reshape(1, 101)
    assert farthest(range_map, percentile=90) == 90
    range_map[0, :50] = np.nan  # 51 left, 50 to 100
    assert farthest(range_map, percentile=90) == 95


class TestToRelative:
    METRES = np.array([[1.0, 2.0, 6.0, 10.0, np.inf, np.nan]], np.float32)

    def test_near_and_far_are_0_and_1_and_what_is_beyond_them_too(self):
        assert to_relative(self.METRES, near=2, far=6)[0, :5].tolist() == [0, 0, 1, 1, 1]
        assert to_relative(self.METRES, near=1, far=11)[0, :4] == pytest.approx([0, 0.1, 0.5, 0.9], abs=1e-6)

    def test_by_default_what_is_measured_spans_0_to_1_and_sky_is_1_and_the_unknown_stays(self):
        found = to_relative(self.METRES)[0]
        assert found[:5] == pytest.approx([0, 1 / 9, 5 / 9, 1, 1], abs=1e-6)
        assert np.isnan(found[5])
        assert to_relative(self.METRES, near=0)[0, :4] == pytest.approx([0.1, 0.2, 0.6, 1], abs=1e-6)

    def test_a_scene_of_one_range_is_near(self):
        assert to_relative(np.array([[3.0, 3.0, np.inf]])).tolist() == [[0, 0, 1]]

    def test_where_nothing_is_measured_the_sky_is_far(self):
        assert to_relative(np.array([[np.inf, np.nan]]))[0, 0] == 1

    def test_a_far_end_that_is_not_beyond_the_near_one_is_refused(self):
        with pytest.raises(ValueError, match=r"far \(10 m\) must be beyond near \(12 m\)"):
            to_relative(self.METRES, near=12, far=10)


def wall_and_floor() -> tuple[np.ndarray, np.ndarray]:
    """A near wall at 2 m on the left and a far one at 9 m, with a hole that borders mostly the far one."""
    range_map = np.full((20, 30), 9.0, np.float32)
    range_map[:, :10] = 2
    range_map[5:12, 10:25] = np.nan
    return range_map, np.isnan(range_map)


def test_a_hole_takes_the_side_with_most_of_its_boundary():
    range_map, holes = wall_and_floor()
    filled = fill_holes(range_map, holes, rng=rng())
    assert (filled[holes] == 9).all()
    np.testing.assert_array_equal(filled[~holes], range_map[~holes])


def test_every_hole_gets_one_value_of_its_own_boundary():
    noise = np.random.default_rng(4)
    range_map = noise.uniform(2, 9, (60, 80)).astype(np.float32)
    holes = noise.random((60, 80)) < 0.3
    range_map[holes] = np.nan
    filled = fill_holes(range_map, holes, rng=rng(), at_edge="consensus")
    labels, count = regions.label(holes)
    inside, outside = regions.border_pairs(holes, ~holes)
    assert count > 100
    for hole in range(1, count + 1):
        (value,) = np.unique(filled[labels == hole])
        assert value in range_map.ravel()[outside[labels.ravel()[inside] == hole]]


def test_the_value_is_the_best_of_the_whole_boundary():
    noise = np.random.default_rng(4)
    range_map = noise.uniform(5, 6, (9, 9)).astype(np.float32)
    range_map[3:6, 3:6] = np.nan
    holes = np.isnan(range_map)
    boundary = range_map.ravel()[regions.border_pairs(holes, ~holes)[1]].astype(np.float64)
    jumps = boundary[None] - boundary[:, None]
    cost = (jumps**2 / (jumps**2 + (0.05 * boundary[:, None]) ** 2)).sum(1)
    # 12 values, 200 draws: all but (11/12)^200 = 3e-8 of all seeds try the best one.
    filled = fill_holes(range_map, holes, rng=rng(), samples=200)
    assert filled[4, 4] == np.float32(boundary[cost.argmin()])


def test_the_seed_decides():
    noise = np.random.default_rng(4)
    range_map = noise.uniform(2, 9, (40, 40)).astype(np.float32)
    range_map[noise.random((40, 40)) < 0.3] = np.nan
    first, again, other = (
        fill_holes(range_map, np.isnan(range_map), rng=np.random.default_rng(seed), samples=1) for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_nothing_to_fill_from():
    range_map = np.full((4, 4), np.nan, np.float32)
    range_map[0, :] = np.inf
    filled = fill_holes(range_map, np.isnan(range_map), rng=rng(), largest=1.0)
    np.testing.assert_array_equal(filled, range_map)


def test_a_measured_pixel_in_the_mask_keeps_its_range():
    range_map = np.array([[3.0, np.nan, 4.0, np.inf]], np.float32)
    filled = fill_holes(range_map, np.ones((1, 4), bool), rng=rng())
    assert filled[0, 1] in (3, 4)
    np.testing.assert_array_equal(filled[0, [0, 2, 3]], [3, 4, np.inf])


def test_a_range_of_zero_is_a_range():
    range_map = np.array([[0.0, np.nan, 0.0]], np.float32)
    np.testing.assert_array_equal(fill_holes(range_map, np.isnan(range_map), rng=rng()), [[0, 0, 0]])


def test_a_sparse_map_is_refused():
    range_map = np.full((20, 20), np.nan, np.float32)
    range_map[::4, ::4] = 10.0
    with pytest.raises(ValueError, match=r"one hole covers 94% of the image.*sky\.identify"):
        fill_holes(range_map, np.isnan(range_map), rng=rng())
    assert (fill_holes(range_map, np.isnan(range_map), rng=rng(), largest=1.0) == 10).all()


def test_real_lidar_is_refused(shared_data):
    import cv2

    code = cv2.imread(str(shared_data / "kitti" / "depth.png"), cv2.IMREAD_UNCHANGED)
    range_map = np.where(code == 0, np.nan, code / 256).astype(np.float32)
    undefined = identify(range_map)
    assert not undefined.sky.any()  # its largest gap reaches from the top of the image to the bottom
    with pytest.raises(ValueError, match="one hole covers 72% of the image"):
        fill_holes(range_map, undefined.holes, rng=rng())


def test_real_structured_light(shared_data):
    import cv2

    code = cv2.imread(str(shared_data / "kinect" / "tum_depth.png"), cv2.IMREAD_UNCHANGED)
    range_map = np.where(code == 0, np.nan, code / 5000).astype(np.float32)
    undefined = identify(range_map)
    filled = fill_holes(range_map, undefined.holes, rng=rng())
    assert not undefined.sky.any()
    assert np.isfinite(filled).all()
    np.testing.assert_array_equal(filled[code > 0], range_map[code > 0])


def test_a_hole_at_the_edge_continues_what_it_frames():
    range_map = np.tile(np.array([np.nan, np.nan, 2.0, 3.0, 5.0, np.nan], np.float32), (4, 1))
    holes = np.isnan(range_map)
    range_map[0, 3], range_map[3, 4] = 3.5, 6.0
    filled = fill_holes(range_map, holes, rng=rng())
    np.testing.assert_array_equal(filled[:, :2], 2.0)
    np.testing.assert_array_equal(filled[:, 5], [5, 5, 5, 6])


def test_a_hole_at_the_edge_can_be_filled_like_every_other():
    range_map = np.array([[np.nan, 2, 2, 2], [np.nan, 9, 2, 2], [np.nan, 2, 2, 2]], np.float32)
    filled = fill_holes(range_map, np.isnan(range_map), rng=rng(), at_edge="consensus")
    np.testing.assert_array_equal(filled[:, 0], 2.0)
    nearest = fill_holes(range_map, np.isnan(range_map), rng=rng())
    np.testing.assert_array_equal(nearest[:, 0], [2, 9, 2])


def framed() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A red wall at 2 m above a blue one at 8 m; their border rises in a frame of 16 px that is not measured."""
    y, x = np.mgrid[:60, :60]
    red = y < 20 + np.maximum(0, 16 - x)
    image = np.where(red[..., None], np.float32([0.6, 0.1, 0.1]), np.float32([0.1, 0.1, 0.6]))
    true = np.where(red, np.float32(2), np.float32(8))
    return image, true, x < 16


@pytest.mark.parametrize("most_unknowns", [40_000, 100])
def test_a_hole_at_the_edge_continues_along_the_edges_of_the_image(monkeypatch, most_unknowns: int):
    from fogpipe.kernels import edge_fill

    monkeypatch.setattr(edge_fill, "MOST_UNKNOWNS", most_unknowns)  # 960 pixels: blocks of 4
    image, true, frame = framed()
    holed = np.where(frame, np.float32(np.nan), true)
    by_image = fill_holes(holed, frame, image, rng=np.random.default_rng(0))
    by_distance = fill_holes(holed, frame, image, rng=np.random.default_rng(0), at_edge="nearest")
    # Across the border a share of 3e-4 flows; within blocks, those on the border are of both colours.
    assert np.mean(np.abs(by_image / true - 1) > 0.05) < (0.01 if most_unknowns == 100 else 1e-9)
    assert np.mean(np.abs(by_distance / true - 1) > 0.05) > 0.03
    np.testing.assert_array_equal(by_image[~frame], holed[~frame])
    without = fill_holes(holed, frame, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(without, by_distance)


def test_filling_by_the_image_needs_it():
    _, true, frame = framed()
    with pytest.raises(ValueError, match="wire image"):
        fill_holes(np.where(frame, np.nan, true), frame, rng=np.random.default_rng(0), at_edge="image")
