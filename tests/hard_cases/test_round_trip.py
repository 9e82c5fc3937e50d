"""Haze put on and taken off again with the true transmission and airlight: what comes back, and what is lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.stages.blur import diffusion
from fogpipe.stages.composite import attenuate, naive, over_airlight
from fogpipe.stages.haze import lower_bound
from fogpipe.stages.metric import psnr
from fogpipe.stages.noise import quantise
from fogpipe.stages.prior import boundary_constraint, dark_channel, local_tv
from fogpipe.stages.restore import invert

shapes = st.tuples(st.integers(1, 9), st.integers(1, 9))
shares = st.floats(0, 1, width=32)


@st.composite
def hazy_scenes(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Any image in [0, 1], transmission in [0.05, 1] and airlight in [0.2, 1]."""
    height, width = draw(shapes)
    image = draw(hnp.arrays(np.float32, (height, width, 3), elements=shares))
    t = draw(hnp.arrays(np.float32, (height, width), elements=st.floats(np.float32(0.05).item(), 1, width=32)))
    airlight = draw(hnp.arrays(np.float32, 3, elements=st.floats(np.float32(0.2).item(), 1, width=32)))
    return image, t, airlight


@given(hazy_scenes())
def test_inversion_brings_any_image_back(scene):
    image, t, airlight = scene
    back = invert(naive(image, t, airlight), airlight, t, floor=0.05)
    np.testing.assert_allclose(back, image, atol=1e-5)  # float32 (6e-8) over t = 0.05 and a few operations


@given(hazy_scenes())
def test_the_lower_bound_holds_without_noise(scene):
    image, t, airlight = scene
    hazy = naive(image, t, airlight)
    assert (lower_bound(hazy, airlight, floor=0.01) <= t + 1e-5).all()  # float32 over an airlight of 0.2


@settings(max_examples=25)
@given(hazy_scenes())
@pytest.mark.parametrize("prior", [dark_channel, boundary_constraint, local_tv])
def test_every_prior_gives_a_transmission_and_a_picture(prior, scene):
    image, t, airlight = scene
    hazy = naive(image, t, airlight)
    found = prior(hazy, airlight, **({"iterations": 20} if prior is local_tv else {}))
    assert found.min() >= 0
    assert found.max() <= 1
    assert np.isfinite(invert(hazy, airlight, found)).all()


@pytest.fixture(scope="module")
def wide() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random colours behind a haze that thickens from left to right, t from 1 to 0.05, in float64."""
    rng = np.random.default_rng(9)
    t = np.broadcast_to(np.geomspace(1, 0.05, 400), (300, 400)).copy()
    return rng.random((300, 400, 3)), t, np.array([0.8, 0.85, 0.9])


def test_float64_comes_back_to_rounding(wide):
    image, t, airlight = wide
    back = invert(naive(image, t, airlight), airlight, t, floor=0.05)
    np.testing.assert_allclose(back, image, atol=1e-13)


def test_the_error_of_8_bit_grows_with_one_over_t(wide):
    image, t, airlight = wide
    back = invert(quantise(naive(image, t, airlight)), airlight, t, floor=0.05, clip=False)
    error = np.sqrt(np.mean((back - image) ** 2, axis=(0, 2)))
    predicted = 1 / 255 / np.sqrt(12) / t[0]
    # Rounding errors are uniform where the hazy values spread over many levels; 900 draws in a column give 2 %
    # of standard error, and where t is small a column holds but 13 levels.
    np.testing.assert_allclose(error[10:], predicted[10:], rtol=0.1)
    assert np.mean(error[10:] / predicted[10:]) == pytest.approx(1, abs=0.01)


def test_thicker_haze_than_the_floor_stays_in_part(wide):
    image, t, airlight = wide
    back = invert(naive(image, t, airlight), airlight, t, floor=0.1, clip=False)
    thick = t < 0.1
    assert np.abs(back - image)[~thick].max() < 1e-13
    expected = airlight + (image - airlight) * np.minimum(t / 0.1, 1)[..., None]
    np.testing.assert_allclose(back, expected, atol=1e-13)


def test_what_is_blurred_in_the_haze_does_not_come_back(wide):
    image, t, airlight = (array.astype(np.float32) for array in wide)
    scale = (1 + 4 * (1 - t)).astype(np.float32)
    sharp = attenuate(image, t)
    losses = {
        name: psnr(invert(over_airlight(layer, airlight), airlight, t, floor=0.05), image, color="srgb")
        for name, layer in {"sharp": sharp, "blurred": diffusion(sharp, scale)}.items()
    }
    assert losses["sharp"] > 100  # float32
    assert losses["blurred"] < 20
