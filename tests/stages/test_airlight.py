"""One colour for the airlight, from the sky, from bright patches, or given."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.airlight import LUMINANCE, estimate

HAZE = np.array([0.6, 0.65, 0.7], np.float32)


def scene() -> tuple[np.ndarray, np.ndarray]:
    """A dark scene under a sky that pales from blue to the colour of haze at the horizon, row 40."""
    image = np.full((90, 120, 3), 0.1, np.float32)
    paleness = np.linspace(0, 1, 40, dtype=np.float32)[:, None, None]
    image[:40] = (1 - paleness) * np.array([0.2, 0.4, 0.8], np.float32) + paleness * HAZE
    sky = np.zeros((90, 120), bool)
    sky[:40] = True
    return image, sky


def test_sky_near_the_horizon():
    image, sky = scene()
    # The lowest tenth of the sky, rows 36 to 39, is within 10 % of the way from the horizon to the zenith.
    np.testing.assert_allclose(estimate(image, sky, horizon=0.1), HAZE, atol=0.1 * 0.5)
    assert estimate(image, sky, horizon=1)[0] < estimate(image, sky)[0] < HAZE[0]


def test_sun_and_branches_do_not_move_the_sky():
    image, sky = scene()
    image[:40] = HAZE
    image[35:38, 10:40] = 1e4  # a sun
    image[:40, 60:80] = 0.02  # a tree that the mask has missed
    np.testing.assert_array_equal(estimate(image, sky), HAZE)


def test_dark_ground_in_a_sky_that_was_guessed_does_not_count_with_its_brighter_share():
    image, sky = scene()
    image[:40] = HAZE
    image[15:40] = 0.05  # mountains that were taken for sky, most of it
    np.testing.assert_array_equal(estimate(image, sky, horizon=1, darkest=0), np.float32([0.05] * 3))
    np.testing.assert_array_equal(estimate(image, sky, horizon=1, darkest=0, brighter=0.25), HAZE)
    assert estimate(image[:1], sky[:1], brighter=1e-9) == pytest.approx(HAZE)  # one pixel is left


def test_trees_above_the_reach_of_a_lidar_are_no_sky():
    image, sky = scene()
    image[:40] = HAZE
    image[10:40] = 0.02  # three quarters of the mask, and all of its lowest part
    np.testing.assert_array_equal(estimate(image, sky), HAZE)
    np.testing.assert_array_equal(estimate(image, sky, darkest=0), np.float32([0.02] * 3))
    image[10:40] = 0.5 * HAZE  # but clouds and the blue of the zenith are
    np.testing.assert_array_equal(estimate(image, sky), 0.5 * HAZE)


def test_an_overexposed_sky_makes_a_light_grey_and_no_white():
    image, sky = scene()
    image[:40] = 1
    np.testing.assert_allclose(estimate(image, sky), 0.7, rtol=1e-6)  # float32 sums of three
    np.testing.assert_allclose(estimate(image), 0.7, rtol=1e-6)
    np.testing.assert_array_equal(estimate(image, sky, ceiling=1), [1, 1, 1])
    image[:40] = [0.8, 0.9, 1.0]  # its hue stays
    found = estimate(image, sky)
    np.testing.assert_allclose(found / found[2], [0.8, 0.9, 1.0], rtol=1e-6)


def test_a_sky_that_is_bright_in_hdr_stays_as_bright():
    image, sky = scene()
    image[:40] = 3 * HAZE
    np.testing.assert_array_equal(estimate(image, sky), 3 * HAZE)


def test_brightest_patches_without_a_sky():
    image, _ = scene()
    image[:40] = HAZE
    np.testing.assert_array_equal(estimate(image), HAZE)
    np.testing.assert_array_equal(estimate(image, np.zeros((90, 120), bool)), HAZE)


def test_a_black_background_is_no_sky():
    image, sky = scene()
    image[:40] = 0  # a rendered picture on nothing
    image[60:] = HAZE
    np.testing.assert_array_equal(estimate(image, sky), HAZE)
    np.testing.assert_array_equal(estimate(image, sky, source="sky"), [0, 0, 0])
    image[39, :, 2] = 0.01  # a sky at night is one
    assert estimate(image, sky, horizon=0.025)[2] == np.float32(0.01)


def test_a_rendered_picture_on_nothing(shared_data):
    from fogpipe.io.depth import read_depth
    from fogpipe.io.images import read_image

    path = shared_data / "exr" / "beachball.exr"
    sky = np.isposinf(read_depth(path, encoding="exr-z").values)
    assert estimate(read_image(path).pixels, sky).min() > 0


def test_a_lamp_does_not_count():
    image, _ = scene()
    image[:40] = HAZE
    image[60:74, 61:75] = 1e4  # 14 px, less than a patch
    np.testing.assert_array_equal(estimate(image), HAZE)
    assert estimate(image, patch=4)[0] == 1e4  # a patch that the lamp fills does


def test_the_given_colour_comes_first():
    image, sky = scene()
    given = estimate(image, sky, colour=(0.5, 0.25, 1.5))
    np.testing.assert_array_equal(given, [0.5, 0.25, 1.5])
    assert given.dtype == np.float32


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (17, 31)])
def test_every_size_has_an_airlight(shape):
    image = np.broadcast_to(HAZE, (*shape, 3))
    np.testing.assert_array_equal(estimate(image), HAZE)
    np.testing.assert_array_equal(estimate(image, np.ones(shape, bool)), HAZE)


def test_light_below_zero_is_none():
    image = np.full((4, 4, 3), [-0.1, 0.2, 0.3])  # a colour outside the gamut
    np.testing.assert_array_equal(estimate(image), [0, 0.2, 0.3])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"source": "given"}, "needs a colour"),
        ({"source": "sky"}, "this scene has none"),
        ({"source": "sky", "colour": (1.0, 1.0, 1.0)}, "leave colour out"),
        ({"colour": (178.0, 188.0, 198.0)}, r"As levels of 0 to 255 it would be \(0.445, 0.503, 0.565\)"),
        ({"colour": (1.0, -0.1, 1.0)}, "three finite numbers of 0 or more"),
        ({"colour": (1.0, np.nan, 1.0)}, "three finite numbers of 0 or more"),
        ({"colour": (1.0, 1.0)}, "three finite numbers of 0 or more"),
    ],
)
def test_what_cannot_be_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        estimate(np.ones((4, 4, 3)), **options)


@pytest.mark.parametrize("brightest", [20.0, 1e4])
def test_the_airlight_of_an_hdr_image_may_be_as_bright_as_the_image(brightest: float):
    image = np.full((4, 4, 3), brightest)
    np.testing.assert_array_equal(estimate(image, colour=(200.0, 200.0, 200.0)), [200, 200, 200])


def test_an_image_without_a_finite_pixel_is_refused():
    with pytest.raises(ValueError, match=r"brightest.*three finite numbers"):
        estimate(np.full((4, 4, 3), np.nan))
    with pytest.raises(ValueError, match=r"auto.*three finite numbers"):
        estimate(np.full((4, 4, 3), np.nan), np.ones((4, 4), bool))


def test_an_estimated_colour_can_be_made_paler_at_the_same_luminance():
    image = np.broadcast_to(np.array([0.2, 0.4, 0.8], np.float32), (30, 30, 3))
    full, pale, grey = (estimate(image, saturation=saturation) for saturation in (1.0, 0.5, 0.0))
    luminance = full @ np.array(LUMINANCE)
    np.testing.assert_allclose(pale @ np.array(LUMINANCE), luminance, rtol=1e-6)  # float32 sums of three
    np.testing.assert_allclose(pale - luminance, 0.5 * (full - luminance), atol=1e-6)
    np.testing.assert_allclose(grey, luminance, rtol=1e-6)


def test_a_given_colour_is_never_made_paler():
    image = np.zeros((3, 3, 3), np.float32)
    np.testing.assert_array_equal(estimate(image, colour=(0.25, 0.5, 0.75), saturation=0.0), [0.25, 0.5, 0.75])
