"""Where sky ends, how much to trust it, and the depth of the ground and of what stands before the sky."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels.photo.cues import hiding_sky, trust
from fogpipe.kernels.photo.horizon import ASIDE, Horizon, ground_nearness, horizon_of, upright_length

ROWS, COLUMNS = 100, 160


def sky_down_to(row: int) -> np.ndarray:
    """Sky above a row, and none from there on."""
    sky = np.zeros((ROWS, COLUMNS), np.float32)
    sky[:row] = 1
    return sky


def plain() -> np.ndarray:
    return np.zeros((ROWS, COLUMNS), np.float32)


HEIGHT = 4.0
"""To which objects reach above the camera, in camera heights."""


def nearness(sky: np.ndarray, y: float, objects: np.ndarray | None = None, weight: float = 0.6) -> np.ndarray:
    return ground_nearness(1 - sky, Horizon(y, 1.0), plain() if objects is None else objects, weight, HEIGHT)


@pytest.mark.parametrize("row", [10, 40, 80])
def test_the_horizon_is_where_the_sky_ends(row: int):
    assert horizon_of(sky_down_to(row)) == (row / ROWS, 1.0)


def test_houses_and_masts_hide_the_horizon_and_do_not_move_it():
    sky = sky_down_to(50)
    sky[20:, 20:60] = 0  # a row of houses, a quarter of the width
    sky[5:, 100:103] = 0  # a mast
    assert horizon_of(sky) == (0.5, 1.0)


def test_a_speck_of_sky_far_below_is_none():
    sky = sky_down_to(50)
    sky[90, 10:60] = 1  # thinner than the 3 × 3 pixels that count
    assert horizon_of(sky).y == 0.5


def test_without_sky_there_is_no_horizon():
    assert horizon_of(plain()) == (0.0, 0.0)


@pytest.mark.parametrize(("share", "confidence"), [(0.25, 0.0), (0.5, 0.0), (0.625, 0.5), (0.75, 1.0)])
def test_it_is_trusted_as_far_as_the_sky_spans_the_upper_edge(share: float, confidence: float):
    sky = sky_down_to(40)
    sky[:, round(share * COLUMNS) :] = 0
    assert horizon_of(sky).confidence == pytest.approx(confidence)


def test_the_horizon_stays_above_the_lower_edge():
    assert horizon_of(np.ones((ROWS, COLUMNS), np.float32)).y == 0.98


def test_ground_is_as_near_as_it_is_below_the_horizon():
    near = nearness(sky_down_to(40), 0.4)
    assert (near[:40] == 0).all()
    below = (np.arange(40, ROWS) + 0.5) / ROWS - 0.4
    np.testing.assert_allclose(near[40:, 0], below / 0.6, rtol=1e-5)  # float32


def test_under_a_low_horizon_even_the_lower_edge_is_far():
    assert nearness(sky_down_to(90), 0.9).max() < 0.2  # a tenth of the height, of at least a half


def test_what_stands_out_of_the_ground_is_nearer_by_a_factor():
    objects = plain()
    objects[60:70, 50:60] = 1
    near = nearness(sky_down_to(40), 0.4, objects, weight=0.5)
    np.testing.assert_allclose(near[60:70, 55], 1.5 * near[60:70, 5], rtol=1e-5)  # float32
    np.testing.assert_array_equal(near[:, 5], near[:, 155])


def test_of_objects_of_one_height_the_one_that_looks_taller_is_nearer():
    sky = sky_down_to(60)
    sky[:, 20:50] = 0  # up to the upper edge
    sky[30:, 90:120] = 0  # half as high
    near = nearness(sky, 0.6)
    # A camera height at nearness 1 spans half the photo: the lower edge is 45° below a horizon in the middle.
    tall = 0.6 / (HEIGHT * 0.5)
    # The middles of the two are 15 columns from their sides, ten times the deviation of the blur between columns.
    assert near[:60, 35] == pytest.approx(tall, rel=1e-5)
    assert near[30:60, 105] == pytest.approx(tall / 2, rel=1e-5)
    assert (near[:60, 70] < 1e-3).all()


def test_it_stands_on_the_ground_where_that_is_as_near():
    sky = sky_down_to(50)
    sky[:, 20:50] = 0
    near = nearness(sky, 0.5)
    feet = np.flatnonzero(np.diff(near[:, 35]) > 0)[0] + 1
    assert near[feet, 35] == pytest.approx(near[feet, 150])  # from here down, it is the ground
    assert near[feet, 35] == pytest.approx(1 / HEIGHT, abs=0.02)  # a row of ground is 1/50


def test_all_of_a_mast_has_one_length_and_so_one_range():
    hidden = plain()
    hidden[10:40, 80] = 1  # a pole
    for row in range(40, 90):  # on two legs that spread by 1 in 10
        spread = 1 + (row - 40) // 10
        hidden[row, [80 - spread, 79 - spread, 80 + spread, 81 + spread]] = 1
    hidden[40, 76:85] = 1  # below a platform
    lengths = upright_length(hidden)
    steps = 5  # aside, from the pole to the inner side of a foot
    assert lengths.max() == 80 - steps * ASIDE
    assert (lengths[10:40, 80] == lengths.max()).all()
    # What is on no shortest way, the outer side of a leg and the ends of the platform, is a step or two from one.
    assert lengths[hidden > 0].min() >= lengths.max() - 4 * ASIDE


def test_what_floats_or_stands_beside_a_mast_has_a_length_of_its_own():
    hidden = plain()
    hidden[:, 80] = 1
    hidden[80:, 20:] = 1  # a hedge, before which the mast stands
    hidden[30:33, 20:23] = 1  # a bird
    lengths = upright_length(hidden)
    assert (lengths[:, 80] == ROWS).all()
    assert lengths[85, 77] == ROWS - 3 * ASIDE
    assert lengths[85, 30] == 20
    assert lengths[31, 21] == 3
    assert lengths[10, 10] == 0


def test_a_lattice_hides_the_sky_as_a_whole_and_specks_hide_nothing():
    matte = np.ones((300, 480), np.float32)
    matte[:, [100, 108, 116]] = 0  # 3 bars a pixel wide, 8 apart: on the coarse grid a third of every second pixel
    matte[::12, 300] = 0  # specks
    hidden = hiding_sky(matte, (ROWS, COLUMNS)) > 0.5
    assert hidden[:, 34:38].all()
    assert not hidden[:, 80:].any()


def test_nearness_has_the_range_of_a_share():
    near = nearness(np.random.default_rng(1).random((ROWS, COLUMNS), np.float32), 0.3, plain() + 1, weight=5)
    assert near.min() >= 0
    assert near.max() == 1


def in_colour(sky: np.ndarray, red: float, yellow: float) -> np.ndarray:
    """L*a*b* of a photo whose sky has a colour, with green ground."""
    colour = np.where(sky[..., None] > 0.5, [80.0, red, yellow], [40.0, -20.0, 20.0])
    return colour.astype(np.float32)


def test_blue_sky_is_sky_wherever_it_is_and_grey_sky_where_it_spans_the_photo():
    patch = sky_down_to(60)
    patch[:, 60:] = 0
    assert trust(patch, in_colour(patch, 0, -20), road=0) > 0.99
    whole = sky_down_to(60)
    assert trust(whole, in_colour(whole, 0, 0), road=0) == 1


def test_a_grey_patch_at_the_upper_edge_is_a_wall_unless_a_road_ends_below_it():
    patch = sky_down_to(60)
    patch[:, 60:] = 0
    grey = in_colour(patch, 0, 0)
    assert trust(patch, grey, road=0) < 0.02
    assert trust(patch, grey, road=1) == 1
    assert trust(plain(), grey, road=1) == 0  # nothing is found that could be sky
