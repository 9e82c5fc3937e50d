"""Transmission of one photo from a Markov random field: what the parameters mean, and hard cases."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.haziness import field_of, mrf

RAMP = np.linspace(0, 1, 32)


def picture(grey: np.ndarray) -> np.ndarray:
    """A grey picture as an image of three equal channels."""
    return np.repeat(np.asarray(grey, np.float32)[..., None], 3, axis=2)


def noise(height: int, width: int, seed: int = 1) -> np.ndarray:
    return picture(np.random.default_rng(seed).random((height, width)))


def fields(image: np.ndarray, **parameters):
    settings = {
        "labels": 32, "omega": 1.0, "smoothness": 0.01, "violation": 100.0, "edge_weight": 15.0, "threshold": 15.0,
        "scale": "grey-levels", "reading": "vertical-order",
    }  # fmt: skip
    return field_of(image, **(settings | parameters))


def test_brighter_is_hazier_and_the_labels_are_thirty_two():
    across = picture(np.tile(RAMP, (8, 1)))
    found = mrf(across, smoothness=0)
    np.testing.assert_allclose(found.transmission, 1 - across[..., 0], atol=1 / 62)  # half a label
    assert len(np.unique(found.transmission)) == 32


def test_the_order_holds_upwards_and_is_broken_only_at_its_price():
    darker_above = picture(np.repeat([0.2, 0.6], 10)[:, None] * np.ones((1, 12)))
    ordered = mrf(darker_above, smoothness=0, violation=1e4).transmission
    assert (np.diff(ordered, axis=0) >= 0).all()  # more haze above than below
    free = mrf(darker_above, smoothness=0, violation=0).transmission
    np.testing.assert_allclose(free, 1 - darker_above[..., 0], atol=1 / 62)


def test_a_high_smoothness_leaves_one_label():
    assert np.ptp(mrf(noise(24, 30), smoothness=1e4).transmission) == 0


def test_omega_scales_the_grey_and_so_the_haze():
    flat = picture(np.full((6, 7), 0.8))
    assert mrf(flat, omega=0.5).transmission == pytest.approx(0.6, abs=1 / 62)
    assert (mrf(flat, omega=0).transmission == 1).all()


def test_greys_that_differ_by_less_than_the_threshold_are_joined_more_strongly():
    steps = picture(np.array([[0, 14.5, 29.5], [0, 0, 100]]) / 255)
    made = fields(steps)
    np.testing.assert_array_equal(made.right, [[15, 1, 0], [15, 1, 0]])
    np.testing.assert_array_equal(made.down, [[15, 15, 1], [0, 0, 0]])


def test_the_readings_differ_in_edges_and_in_what_they_ask_of_them():
    image = noise(20, 22)
    vertical, every, sites = (fields(image, reading=name) for name in ("vertical-order", "all-edges", "site-order"))
    assert vertical.horizontal.jump == 0
    assert every.horizontal == every.vertical == vertical.vertical
    assert not sites.right.any()
    assert set(np.unique(sites.down)) == {0, 15}
    # Independent chains, so columns alone are exact, and the default solver proves it in the precision of the image.
    assert mrf(image, reading="site-order", solver="columns").gap < 1e-12
    assert mrf(image.astype(np.float64), reading="site-order").gap < 1e-12
    assert mrf(image, reading="site-order").gap < 1e-7


def test_the_unit_scale_is_the_grey_scale_with_g_and_s_divided_by_255():
    image = noise(16, 18).astype(np.float64)
    grey = mrf(image, smoothness=2.55, violation=51, target_gap=0)
    unit = mrf(image, smoothness=0.01, violation=0.2, scale="unit", target_gap=0)
    # The same field in other units: equal up to the rounding of float64.
    assert float(unit.energy) * 255 == pytest.approx(float(grey.energy), rel=1e-9)


@pytest.mark.parametrize("solver", ["chains", "columns", "trws", "icm"])
@pytest.mark.parametrize(
    "parameters",
    [
        {}, {"violation": 0}, {"smoothness": 0}, {"smoothness": 500, "violation": 1}, {"labels": 1}, {"labels": 256},
        {"reading": "all-edges"}, {"smoothness": 0, "violation": 0, "scale": "unit"}, {"omega": 3},
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    "image",
    [
        picture(np.full((9, 11), 0.3)), picture(np.arange(99).reshape(9, 11) % 11 > 4), noise(9, 11), noise(1, 40),
        noise(40, 1), noise(1, 1), noise(9, 11).astype(np.float64),
    ],
    ids=["constant", "two levels", "noise", "a row", "a column", "a pixel", "float64"],
)  # fmt: skip
def test_hard_cases(image: np.ndarray, parameters: dict, solver: str):
    found = mrf(image, solver=solver, **parameters)
    labels = parameters.get("labels", 32)
    assert found.transmission.shape == image.shape[:2]
    assert found.transmission.dtype == image.dtype
    nearest = np.rint((1 - found.transmission) * max(1, labels - 1)) / max(1, labels - 1)
    np.testing.assert_allclose(1 - found.transmission, nearest, atol=1e-6)  # float32
    assert float(found.bound) <= float(found.energy) * (1 + 1e-12) + 1e-9
    assert 0 <= found.gap <= 1
    if solver == "chains":
        assert found.gap < 0.15  # measured: the worst is 12 %, all edges ordered on pure noise


def test_a_constant_photo_gets_one_transmission():
    assert np.ptp(mrf(picture(np.full((33, 65), 0.37))).transmission) == 0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_refused(value: float):
    image = noise(5, 6)
    image[2, 3, 1] = value
    with pytest.raises(ValueError, match=r"NaN or infinite at 1 of 90 values"):
        mrf(image)


def test_sixteen_bits_keep_what_eight_bits_lose():
    # Half a label of 256 is two thousandths of the range of 16 bits but nothing that 8 bits can show.
    grey = np.round(np.linspace(0, 65535, 512)).reshape(16, 32) / 65535
    found = mrf(picture(grey), labels=256, smoothness=0, violation=0)
    np.testing.assert_allclose(1 - found.transmission, grey, atol=0.5 / 255 + 1e-6)  # float32


def test_a_large_photo_is_solved_at_the_cap_and_keeps_its_edges():
    skimage = pytest.importorskip("skimage")
    photo = skimage.data.camera()[::2, ::2].astype(np.float32) / 255
    whole = mrf(picture(photo), smoothness=0.5)
    capped = mrf(picture(photo), smoothness=0.5, cap=photo.size / 4 / 1e6)
    assert capped.transmission.shape == photo.shape
    assert capped.energy < whole.energy / 3  # a quarter of the pixels
    # Measured 0.04; the map of a smaller photo is another map, but one of the same objects.
    assert np.abs(capped.transmission - whole.transmission).mean() < 0.06


def test_twelve_megapixels_are_solved_at_the_cap():
    import cv2

    skimage = pytest.importorskip("skimage")
    photo = cv2.resize(skimage.data.rocket(), (4000, 3000)).astype(np.float32) / 255
    found = mrf(photo)
    assert found.transmission.shape == (3000, 4000)
    assert found.gap <= 1e-3
    assert found.energy < 255 * 0.5e6  # of half a million pixels


def test_the_published_parameters_are_certified_to_a_thousandth():
    skimage = pytest.importorskip("skimage")
    assert mrf(skimage.data.rocket().astype(np.float32) / 255).gap <= 1e-3


def test_half_a_label_of_smoothness_is_certified_to_two_percent_and_a_half():
    skimage = pytest.importorskip("skimage")
    photo = skimage.data.coffee()[::2, ::2].astype(np.float32) / 255
    assert mrf(photo, smoothness=0.5).gap <= 0.025
