"""What is sky, and how the scene passes into it."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.sky import identify, matte


def street() -> np.ndarray:
    """Sky above row 30, cut by a tree that reaches the top, with the glass of a car and a lidar shadow as holes."""
    range_map = np.full((60, 100), np.nan, np.float32)
    range_map[30:] = np.linspace(50, 5, 30, dtype=np.float32)[:, None]
    range_map[:35, 60:70] = 12  # the tree: sky to its left and right
    range_map[5:8, 64:66] = np.nan  # a gap in its leaves
    range_map[40:50, 20:24] = np.nan  # the glass of a car, large enough for sky
    range_map[58:, 90:] = np.nan  # a corner without returns
    return range_map


def test_large_regions_at_the_top_are_sky_the_rest_are_holes():
    range_map = street()
    sky, holes = identify(range_map, gap=0)
    expected = np.zeros((60, 100), bool)
    expected[:30, :60] = expected[:30, 70:] = True
    np.testing.assert_array_equal(sky, expected)
    np.testing.assert_array_equal(holes, np.isnan(range_map) & ~expected)


def test_sky_behind_trees_is_sky_if_there_is_sky_above():
    range_map = street()
    range_map[10:13, :60] = 8.0  # a branch cuts the left part of the sky in two
    assert identify(range_map).sky[13:30, :60].all()
    assert identify(range_map).holes[40:50, 20:24].all()  # as large a part, but below the horizon
    range_map[:30, :60][np.isnan(range_map[:30, :60])] = 40
    range_map[:10] = 40  # now no undefined region touches the top
    assert not identify(range_map).sky.any()
    assert identify(range_map, touching="any").sky[10:30, 70:].all()


def test_a_frame_without_depth_is_no_sky():
    range_map = np.full((40, 60), np.nan, np.float32)  # as registered depth of an indoor camera has it
    range_map[4:-4, 4:-4] = 2.0
    assert identify(range_map).holes.sum() == 40 * 60 - 32 * 52
    assert identify(range_map, touching="any").sky.sum() == 40 * 60 - 32 * 52


def test_infinitely_far_is_sky_whatever_its_size():
    range_map = np.full((40, 60), 3.0, np.float32)
    range_map[20, 30] = np.inf
    sky, holes = identify(range_map)
    assert np.flatnonzero(sky).tolist() == [20 * 60 + 30]
    assert not holes.any()


def test_unknown_pixels_that_only_sky_surrounds_are_sky():
    range_map = np.full((10, 10), np.inf, np.float32)
    range_map[8:] = 4
    range_map[3, 3] = np.nan
    assert identify(range_map).sky[:8].all()


def test_nothing_measured_is_all_sky():
    sky, holes = identify(np.full((4, 5), np.nan))
    assert sky.all()
    assert not holes.any()


def test_indoor_scene_has_holes_but_no_sky(motorcycle):
    _, range_map = motorcycle
    sky, holes = identify(range_map)
    assert not sky.any()
    np.testing.assert_array_equal(holes, np.isnan(range_map))
    assert holes.any()


@pytest.mark.parametrize("solver", ["direct", "jacobi"])
def test_what_is_measured_stays_the_same_to_the_last_bit(solver):
    range_map = street()
    sky = identify(range_map).sky
    matted = matte(range_map, sky, np.array(50.0), solver=solver)
    np.testing.assert_array_equal(matted[~sky], range_map[~sky])
    assert not np.isnan(matted[sky]).any()


def test_sky_lies_beyond_the_scene_and_the_margin_between():
    range_map = street()
    sky = identify(range_map).sky
    matted = matte(range_map, sky, np.array(50.0), margin=6, beyond=2)
    assert (matted[:20, :50] == 100).all()
    band = matted[24:30, :50]
    # 1e-5: float32 of values near 100.
    assert (np.diff(band, axis=0) < 1e-5).all()
    assert band.min() > 49.99
    assert band.max() < 100


def test_straight_horizon_is_a_straight_ramp():
    range_map = np.full((40, 8), np.nan, np.float32)
    range_map[20:] = 10
    matted = matte(range_map, np.isnan(range_map), np.array(10.0), margin=4, beyond=2)
    # Between row 20 (10 m) and row 15 (20 m) there are five equal steps; float32.
    np.testing.assert_allclose(matted[15:21, 3], [20, 18, 16, 14, 12, 10], rtol=1e-6)


def test_margin_of_zero_is_a_hard_edge():
    range_map = street()
    sky = identify(range_map).sky
    matted = matte(range_map, sky, np.array(50.0), margin=0, beyond=1.5)
    assert (matted[sky] == 75).all()


def test_sky_around_nothing_measured_is_infinitely_far():
    range_map = np.full((3, 4), np.nan, np.float32)
    assert np.isposinf(matte(range_map, np.ones((3, 4), bool), np.array(np.nan))).all()


def test_a_measured_pixel_in_the_mask_keeps_its_range():
    range_map = np.array([[np.nan, np.inf, 3.0, 3.0]], np.float32)
    matted = matte(range_map, np.ones((1, 4), bool), np.array(3.0), margin=1, beyond=2)
    # The pixel of the margin lies between 6 and 3.
    np.testing.assert_allclose(matted, [[6, 4.5, 3, 3]], rtol=1e-6)


def test_an_unfilled_hole_beside_the_margin_is_left_out():
    range_map = np.full((9, 9), np.nan, np.float32)
    range_map[6:] = 10
    sky = np.isnan(range_map)
    range_map[6:, 4] = np.nan
    for solver in ("direct", "jacobi"):
        matted = matte(range_map, sky, np.array(10.0), margin=3, solver=solver)
        np.testing.assert_array_equal(np.isnan(matted), np.isnan(range_map) & ~sky)


def leafy_crown() -> np.ndarray:
    """Sky above row 10, and below it a crown whose gaps lie 3 px from the sky and from each other."""
    range_map = np.full((60, 60), 20.0, np.float32)
    range_map[:10] = np.nan
    for row in (13, 17, 21):
        range_map[row, 30] = np.nan
    range_map[50, 30] = np.nan
    return range_map


def test_sky_between_leaves_is_sky_but_a_hole_far_from_it_is_not():
    found = identify(leafy_crown())
    assert found.sky[[13, 17, 21], 30].all()
    assert found.holes[50, 30]
    assert found.sky.sum() == 600 + 3


def test_without_a_gap_only_large_regions_are_sky_as_in_the_paper():
    found = identify(leafy_crown(), gap=0)
    assert found.sky.sum() == 600
    assert found.holes.sum() == 4


def test_gaps_alone_make_no_sky():
    range_map = leafy_crown()
    range_map[:10] = 30.0
    assert not identify(range_map).sky.any()


def leaves_before_a_blue_sky() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A crown with gaps of one and two pixels, its range and its sky; the image is a pixel off to the right."""
    leaf, blue = np.float32([0.05, 0.1, 0.02]), np.float32([0.2, 0.35, 0.7])
    scene = np.zeros((40, 40), bool)
    scene[20:, 5:35] = True
    scene[22:36:4, 8:30] = False
    scene[24:26, 8:30] = False
    image = np.where(np.roll(scene, 1, axis=1)[..., None], leaf, blue)
    return image, np.where(scene, np.float32(10), np.float32(np.nan)), ~scene


def test_with_an_image_the_sky_between_leaves_is_as_far_as_the_sky():
    image, range_map, sky = leaves_before_a_blue_sky()
    by_colour = matte(range_map, sky, np.array(10.0), image, beyond=20)
    by_distance = matte(range_map, sky, np.array(10.0), image, beyond=20, solver="direct")
    gap = (slice(24, 26), slice(12, 28))
    # A share of 3e-3 (how well colours tell) of 1/10 m, beside 1/200 m, is 188 m.
    assert by_colour[gap].min() > 188
    assert by_distance[gap].max() < 11  # seen clearly, whatever the haze
    assert by_colour[30, 35] == pytest.approx(10, rel=5e-3)  # leaf in the image, sky in the range
    np.testing.assert_array_equal(by_colour[~sky], range_map[~sky])
    np.testing.assert_array_equal(matte(range_map, sky, np.array(10.0), beyond=20), by_distance)


def test_half_a_leaf_is_half_as_near():
    image, range_map, sky = leaves_before_a_blue_sky()
    image[30, 36] = (image[30, 34] + image[30, 38]) / 2
    matted = matte(range_map, sky, np.array(10.0), image, beyond=20)
    assert 1 / matted[30, 36] == pytest.approx((1 / 10 + 1 / 200) / 2, rel=5e-3)


def test_a_sky_that_is_all_margin_still_has_its_colour():
    image, range_map, sky = leaves_before_a_blue_sky()
    image, range_map, sky = image[21:], range_map[21:], sky[21:]
    sky[:, :5] = sky[:, 35:] = False
    range_map[:, :5] = range_map[:, 35:] = 10
    assert matte(range_map, sky, np.array(10.0), image, beyond=20)[3:5, 12:28].min() > 188


def test_colour_needs_an_image():
    _, range_map, sky = leaves_before_a_blue_sky()
    with pytest.raises(ValueError, match="wire image"):
        matte(range_map, sky, np.array(10.0), solver="colour")
