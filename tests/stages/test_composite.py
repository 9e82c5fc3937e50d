"""Premultiplied composites: what t = 1 and t = 0 must give, and that all ways agree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.stages.composite import add, add_density, attenuate, colour, naive, opaque, over_airlight

RNG = np.random.default_rng(11)
IMAGE = RNG.random((7, 9, 3), dtype=np.float32) * 3
AIRLIGHT = np.array([0.8, 0.85, 0.9], np.float32)
FIELD = RNG.random((7, 9, 3), dtype=np.float32)
AIRLIGHTS = pytest.mark.parametrize("airlight", [AIRLIGHT, FIELD], ids=["one colour", "field"])


@AIRLIGHTS
def test_clear_air_gives_the_image(airlight):
    t = np.ones((7, 9), np.float32)
    np.testing.assert_array_equal(over_airlight(attenuate(IMAGE, t), airlight), IMAGE)
    np.testing.assert_array_equal(naive(IMAGE, t, airlight), IMAGE)


@AIRLIGHTS
def test_nothing_transmitted_gives_the_airlight(airlight):
    t = np.zeros((7, 9), np.float32)
    np.testing.assert_array_equal(over_airlight(attenuate(IMAGE, t), airlight), np.broadcast_to(airlight, IMAGE.shape))
    np.testing.assert_array_equal(naive(IMAGE, t, airlight), np.broadcast_to(airlight, IMAGE.shape))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@AIRLIGHTS
def test_the_formulas(airlight, dtype):
    image, t = IMAGE.astype(dtype), RNG.random((7, 9)).astype(dtype)
    layer = attenuate(image, t)
    np.testing.assert_array_equal(layer, t[..., None] * np.concatenate([image, np.ones((7, 9, 1), dtype)], axis=2))
    expected = layer[..., :3] + (1 - layer[..., 3:]) * airlight.astype(dtype)
    got = over_airlight(layer, airlight)
    assert got.dtype == layer.dtype == dtype
    # The same three operations; a compiler may fuse two of them, which saves a rounding.
    np.testing.assert_allclose(got, expected, rtol=2 * np.finfo(dtype).eps)


@AIRLIGHTS
def test_without_a_blur_the_naive_composite_is_right(airlight):
    t = RNG.random((7, 9), dtype=np.float32)
    # The same three operations.
    np.testing.assert_allclose(naive(IMAGE, t, airlight), over_airlight(attenuate(IMAGE, t), airlight), rtol=3e-7)


@settings(deadline=None)  # the first call compiles
@given(
    hnp.arrays(np.float32, (3, 4, 3), elements=st.floats(0, 1e4, width=32)),
    hnp.arrays(np.float32, (3, 4), elements=st.floats(0, 1, width=32)),
)
def test_a_composite_lies_between_the_image_and_the_airlight(image, t):
    got = over_airlight(attenuate(image, t), AIRLIGHT)
    slack = 3 * np.finfo(np.float32).eps * np.maximum(image, AIRLIGHT)  # three roundings
    assert (got >= np.minimum(image, AIRLIGHT) - slack).all()
    assert (got <= np.maximum(image, AIRLIGHT) + slack).all()


def test_colour_undoes_attenuate():
    t = RNG.uniform(0.1, 1, (7, 9)).astype(np.float32)
    np.testing.assert_allclose(colour(attenuate(IMAGE, t)), IMAGE, rtol=2e-7)  # one product, one quotient
    assert (colour(np.zeros((2, 3, 4))) == 0).all()


def test_an_opaque_layer_is_the_image():
    layer = opaque(IMAGE)
    np.testing.assert_array_equal(layer[..., :3], IMAGE)
    assert (layer[..., 3] == 1).all()


def test_layers_that_share_the_light_add_up():
    t = RNG.random((7, 9), dtype=np.float32)
    direct, scattered = attenuate(IMAGE, 0.75 * t), attenuate(IMAGE, 0.25 * t)
    np.testing.assert_allclose(add(direct, scattered), attenuate(IMAGE, t), rtol=3e-7)  # float32


def test_unknown_transmission_is_refused_with_the_way_out():
    t = np.ones((7, 9), np.float32)
    t[2, 3] = np.nan
    for call in (lambda: attenuate(IMAGE, t), lambda: naive(IMAGE, t, AIRLIGHT)):
        with pytest.raises(ValueError, match=r"unknown at 1 pixels: .* range\.fill_holes"):
            call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: attenuate(IMAGE, np.ones((9, 7))), "transmission has 7 × 9 pixels but image has 9 × 7"),
        (lambda: attenuate(IMAGE[..., 0], np.ones((7, 9))), "image has shape .7, 9., not .height, width, 3."),
        (lambda: attenuate(IMAGE[:0], np.ones((0, 9))), "with at least one pixel"),
        (lambda: over_airlight(IMAGE, AIRLIGHT), "layer has shape .7, 9, 3., not .height, width, 4."),
        (lambda: over_airlight(opaque(IMAGE), np.ones(4)), "airlight has shape .4,."),
        (lambda: over_airlight(opaque(IMAGE), FIELD[:3]), "airlight has 9 × 3 pixels but image has 9 × 7"),
        (lambda: naive(IMAGE, np.ones((7, 9)), np.ones((9, 3))), "airlight has shape .9, 3."),
        (lambda: add(opaque(IMAGE), opaque(IMAGE[1:])), "other has 9 × 6 pixels but layer has 9 × 7"),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_published_noise_is_added_whatever_the_distance():
    density = RNG.random((7, 9), dtype=np.float32) * 2
    noise = add_density(IMAGE, density, strength=0.15) - IMAGE
    # A sum and a difference of float32 numbers up to 3.
    np.testing.assert_allclose(noise, 0.15 * np.repeat((density - 1)[..., None], 3, axis=2), atol=5e-7)
    np.testing.assert_array_equal(add_density(IMAGE, np.ones((7, 9), np.float32)), IMAGE)
