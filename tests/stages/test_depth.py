"""Depth guessed from one photograph, and how the guess is scored."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from fogpipe.io.scenes import open_scene, scene_from_files
from fogpipe.stages.depth import agreement, from_photo, from_transmission, row_prior, to_range
from fogpipe.stages.haziness import mrf

MOTORCYCLE, ROADS = "sample:motorcycle", tuple(f"sample:outdoor:{seed}:640x400" for seed in (1, 4, 9))


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@functools.cache
def scene(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Display values and true range of a sample, at most 800 pixels wide."""
    values = open_scene(name).load("srgb").values
    step = max(1, values["image"].shape[1] // 800)
    return np.clip(values["image"][::step, ::step], 0, 1), values["range_map"][::step, ::step]


def photographed(shared_data, image: str, depth: str, encoding: str) -> tuple[np.ndarray, np.ndarray]:
    values = scene_from_files(shared_data / image, shared_data / depth, encoding=encoding).load("srgb").values
    return values["image"], values["range_map"]


def score(true_range: np.ndarray, depth: np.ndarray) -> float:
    return float(agreement(true_range, depth, rng=rng()).spearman)


@pytest.mark.parametrize("name", [MOTORCYCLE, *ROADS])
def test_it_beats_the_rows_and_the_published_map(name: str):
    image, true_range = scene(name)
    photo = score(true_range, from_photo(image).depth)
    assert photo > score(true_range, row_prior(image))
    assert photo > score(true_range, from_transmission(mrf(image).transmission)) + 0.3


def test_on_roads_the_sky_is_far_and_found():
    for name in ROADS:
        image, true_range = scene(name)
        depth, sky = from_photo(image)
        unmeasured = np.isnan(true_range)  # in this sample, that is the sky
        # Measured: 0.994 to 0.996; what is left is leaves and wires.
        assert np.mean(sky == unmeasured) > 0.985
        assert np.median(depth[unmeasured]) > 0.98
        # Measured: 1.7 to 1.8 %, gaps between leaves; with clouds cut out around chimneys and trees 2.5 %.
        assert np.mean(depth[unmeasured] < 0.95) < 0.022


def test_the_sky_of_a_night_photo_is_sky_and_its_masts_are_not():
    image = np.clip(open_scene("sample:rocket").load("srgb").values["image"], 0, 1)
    depth, sky = from_photo(image)
    assert sky[:200, 100:250].mean() > 0.9  # between two masts
    assert depth[:200, 100:130].min() > 0.95
    assert depth[200:350, 318:322].max() < 0.8  # the rocket


def test_a_mast_before_the_sky_stands_at_one_range():
    """The thin mast right of the rocket: a pole on a lattice whose bars are as bright as the sky."""
    image = np.clip(open_scene("sample:rocket").load("srgb").values["image"], 0, 1)
    depth = from_photo(image).depth
    pole, leg = depth[130:190, 440:455].min(axis=1), depth[230:400, 435:480].min(axis=1)
    assert pole.max() < 0.8
    # One range within a tenth of the nearness: the lengths of two paths, up to the pole and along a leg.
    assert abs(np.median(leg) - np.median(pole)) < 0.1 * (1 - np.median(pole))
    assert np.percentile(leg, 95) < 0.8  # no gaps


def test_studio_backdrops_and_brick_are_no_sky(shared_data):
    import skimage.data

    from fogpipe.io.images import read_image

    for name in ("hazy/house.jpg", "kinect/color.jpg"):  # brick behind leaves; a white wall beside a window
        assert from_photo(read_image(shared_data / name, color="srgb").pixels).sky.mean() < 0.01
    assert from_photo(skimage.data.astronaut() / 255).sky.mean() < 0.01


@pytest.mark.parametrize("name", ["foggy_house.jpg", "man.png", "canyon.png"])
def test_grey_and_blue_skies_are_sky(shared_data, name: str):
    from fogpipe.io.images import read_image

    sky = from_photo(read_image(shared_data / "hazy" / name, color="srgb").pixels).sky
    assert sky[: len(sky) // 8].mean() > 0.7  # the house has branches before its sky


def test_a_corridor_is_far_where_its_lines_meet():
    """Four edges of a box that meet in the middle, and nothing else."""
    import cv2

    picture = np.full((240, 320, 3), 0.4, np.float32)
    for x, y in ((0, 0), (319, 0), (0, 239), (319, 239)):
        for share in (0.0, 0.1, 0.2):
            start = (round(x + share * (160 - x)), y)
            cv2.line(picture, start, (160, 120), (0.9, 0.9, 0.9), 2)
    depth = from_photo(picture).depth
    assert depth[115:125, 155:165].min() > 0.9
    assert max(depth[120, 5], depth[235, 160], depth[120, 314]) < 0.5


def test_linear_light_and_display_values_are_told_apart():
    from fogpipe.kernels.srgb import linear_from_srgb

    image, _ = scene(MOTORCYCLE)
    depth = from_photo(image).depth
    # The curve there and back changes a value by 1e-6, and a grey level here and there by one.
    assert np.abs(from_photo(linear_from_srgb(image), encoding="linear").depth - depth).mean() < 0.01


def test_a_large_photo_is_solved_like_a_small_one():
    import cv2

    image, _ = scene(ROADS[0])
    large = cv2.resize(image, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)
    reduced = cv2.resize(from_photo(large).depth, image.shape[1::-1], interpolation=cv2.INTER_AREA)
    # Lines and regions are found at the same size; edges move by a pixel of the small one.
    assert np.abs(reduced - from_photo(image).depth).mean() < 0.02


def test_rows_are_farther_the_higher_they_are():
    depth = row_prior(np.zeros((100, 3, 3), np.float32), horizon=0.25)
    assert (np.diff(depth[:, 1]) <= 0).all()
    assert (depth[:25] == 1).all()
    assert depth[99, 0] == pytest.approx(0.005 / 0.75, rel=1e-4)  # half a pixel above the edge; float32


def test_transmission_and_back():
    t = np.exp(-np.linspace(0, 3, 12)).reshape(3, 4)
    depth = from_transmission(t, least=float(np.exp(-3)))
    np.testing.assert_allclose(depth, np.linspace(0, 1, 12).reshape(3, 4), atol=1e-15)  # a logarithm of an exponential
    assert np.isnan(from_transmission(np.array([[np.nan]], np.float32)))[0, 0]
    np.testing.assert_array_equal(from_transmission(np.array([[0.0, 1.0]])), [[1, 0]])
    np.testing.assert_array_equal(from_transmission(np.array([[0.3, 1.0]]), least=1), [[1, 0]])


@pytest.mark.parametrize("law", ["inverse", "linear", "logarithmic"])
def test_range_goes_from_near_to_far(law):
    depth = np.linspace(0, 1, 20).reshape(4, 5)
    metres = to_range(depth, near=2, far=300, law=law)
    assert (np.diff(metres.ravel()) > 0).all()
    np.testing.assert_allclose(metres.ravel()[[0, -1]], [2, 300], rtol=1e-13)  # a few operations in float64


def test_the_inverse_law_is_a_plane_ground():
    # A ground plane at 1.5 m below the camera, seen at rows below the horizon: range 1.5 f / offset.
    offset = np.linspace(0.5, 0.01, 9)[:, None]
    depth = 1 - (offset - 0.01) / 0.49
    np.testing.assert_allclose(to_range(depth, near=3, far=150), 1.5 / offset, rtol=1e-12)


def test_far_must_be_beyond_near():
    with pytest.raises(ValueError, match="beyond near"):
        to_range(np.zeros((2, 2)), near=5, far=5)


def test_agreement_of_known_orders():
    true = np.arange(1.0, 101.0).reshape(10, 10)
    assert agreement(true, true**3, rng=rng()) == (pytest.approx(1), 1)
    assert agreement(true, -true, rng=rng()) == (pytest.approx(-1), 0)
    # 5 standard errors of a rank correlation of 10 000 independent values, and of 200 000 pairs.
    chance = agreement(np.tile(np.arange(1.0, 101), (100, 1)), np.random.default_rng(1).random((100, 100)), rng=rng())
    assert abs(chance.spearman) < 0.05
    assert abs(chance.pairwise - 0.5) < 0.02


def test_agreement_matches_scipy_with_ties():
    from scipy.stats import spearmanr

    true, guess = np.random.default_rng(2).integers(1, 6, (2, 40, 50)).astype(float)
    # The same sums in another order.
    assert score(true, guess) == pytest.approx(spearmanr(true.ravel(), guess.ravel()).statistic, abs=1e-12)


def test_unknown_range_does_not_count_and_sky_is_farthest():
    true = np.array([[1.0, 2.0, np.inf, np.nan]])
    assert agreement(true, np.array([[0.1, 0.2, 0.9, 0.0]]), rng=rng()) == (pytest.approx(1), 1)
    assert score(true, np.array([[0.1, 0.2, 0.0, 0.0]])) < 0


def test_a_constant_guess_says_nothing():
    spearman, pairwise = agreement(np.array([[1.0, 2.0]]), np.array([[0.5, 0.5]]), rng=rng())
    assert np.isnan(spearman)
    assert pairwise == 0.5
    assert np.isnan(agreement(np.full((2, 2), np.nan), np.zeros((2, 2)), rng=rng())).all()


FRAMES = {
    "kitti": ("kitti/rgb.png", "kitti/depth.png", "kitti", 0.95),
    "tum": ("kinect/tum_color.png", "kinect/tum_depth.png", "tum", 0.40),
    "sun": ("kinect/sun_color.jpg", "kinect/sun_depth.png", "sun", 0.55),
    "kinect": ("kinect/color.jpg", "kinect/depth_mm.png", "millimetres", 0.40),
}


@pytest.mark.parametrize("name", FRAMES)
def test_photos_with_measured_depth(shared_data, name: str):
    """Measured: 0.98, 0.46, 0.61 and 0.49; a few hundredths are left for other versions of OpenCV."""
    image, depth, encoding, least = FRAMES[name]
    picture, true_range = photographed(shared_data, image, depth, encoding)
    assert score(true_range, from_photo(picture).depth) > least
