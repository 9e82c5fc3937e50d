"""Transmission by well-known priors: right where the prior holds, in bounds everywhere."""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np
import pytest

from fogpipe.kernels.bands import set_threads, threads
from fogpipe.kernels.compositing import blend
from fogpipe.stages import prior

B = np.array([0.9, 0.85, 0.8], np.float32)
STAGES = (prior.dark_channel, prior.boundary_constraint, prior.local_tv)
every_stage = pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.__name__)


def scene_with_black(height: int = 80, width: int = 100) -> np.ndarray:
    """Colours with a black pixel in every patch of 4, for which the dark channel prior is exact."""
    scene = np.random.default_rng(6).random((height, width, 3)).astype(np.float32)
    scene[::4, ::4] = 0
    return scene


def layers(height: int = 80, width: int = 100) -> np.ndarray:
    """A near left half and a far right half."""
    return np.broadcast_to(np.where(np.arange(width) < width // 2, 0.8, 0.3), (height, width)).astype(np.float32)


def test_the_dark_channel_is_exact_where_the_prior_holds():
    t = layers()
    found = prior.dark_channel(blend(scene_with_black(), t, B), B, strength=1, guide="none", patch=7)
    inside = np.s_[:, 4:-4]
    away = np.abs(np.arange(100) - 50) > 4  # of the border between the layers, as wide as half a patch
    np.testing.assert_allclose(found[inside][:, away[4:-4]], t[inside][:, away[4:-4]], atol=1e-6)  # float32


def test_the_dark_channel_without_refinement_is_the_dilated_lower_bound():
    image = np.random.default_rng(1).random((40, 50, 3)).astype(np.float32) * 0.8
    bound = 1 - (image / B).min(axis=2)
    expected = cv2.dilate(bound, np.ones((9, 9), np.uint8))
    found = prior.dark_channel(image, B, strength=1, guide="none", patch=9)
    np.testing.assert_allclose(found, np.clip(expected, 0, 1), atol=1e-6)  # float32


def test_strength_leaves_a_share_of_the_haze():
    image = blend(scene_with_black(), layers(), B)
    full, most = (prior.dark_channel(image, B, strength=s, guide="none") for s in (1.0, 0.95))
    np.testing.assert_allclose(1 - most, 0.95 * (1 - full), atol=1e-6)  # float32


@every_stage
def test_more_haze_is_less_transmission(stage):
    scene = scene_with_black()
    found = [stage(blend(scene, np.full((80, 100), t, np.float32), B), B).mean() for t in (0.9, 0.6, 0.3)]
    assert found[0] > found[1] + 0.1 > found[2] + 0.2


@every_stage
def test_near_and_far_are_told_apart(stage):
    if stage is prior.dark_channel:  # whose filter is by default as wide as this picture
        stage = partial(stage, radius=20, smoothness=1e-3)
    found = stage(blend(scene_with_black(), layers(), B), B)
    assert found[:, 10:40].mean() > found[:, 60:90].mean() + 0.3


def test_the_boundary_constraint_bounds_from_black_and_from_white():
    # One channel below the airlight: t ≥ (B − I) / (B − C0); one above it: t ≥ (I − B) / (C1 − B).
    for value, expected in ((0.4, 0.5 / 0.9), (1.0, 0.1 / 0.3)):
        image = np.full((40, 40, 3), value, np.float32)
        found = prior.boundary_constraint(image, np.full(3, 0.9), darkest=0, brightest=1.2)
        np.testing.assert_allclose(found, expected, rtol=1e-4)  # float32 Fourier transforms


def test_local_tv_is_at_least_the_lower_bound():
    image = np.random.default_rng(2).random((30, 40, 3)).astype(np.float32)
    found = prior.local_tv(image, B, blur=0, floor=0.05)
    assert (found >= np.clip(1 - (image / B).min(axis=2), 0.05, 1) - 1e-6).all()  # logarithm and back


def images() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(8)
    some = rng.random((20, 24, 3)).astype(np.float32)
    return {
        "brighter than the airlight": 0.9 + some,
        "values above 1": 5 * some,
        "noise below black": some - 0.5,
        "black": np.zeros_like(some),
        "constant": np.full_like(some, 0.4),
        "grey": np.repeat(some[..., :1], 3, axis=2),
        "saturated": np.ones_like(some),
        "all sky": np.broadcast_to(B, some.shape),
        "one pixel": some[:1, :1],
        "one row": some[:1],
        "one column": some[:, :1],
        "float64": some.astype(np.float64),
        "float16": some.astype(np.float16),
        "not contiguous": some[::-1, ::2],
    }


@every_stage
@pytest.mark.parametrize("case", images())
def test_hard_images_have_a_transmission(stage, case):
    image = images()[case]
    found = stage(image, B)
    assert found.shape == image.shape[:2]
    assert found.dtype == (np.float64 if case == "float64" else np.float32)
    assert found.min() >= 0  # NaN would fail
    assert found.max() <= 1


@every_stage
def test_airlight_is_nearly_opaque_and_black_is_clear(stage):
    assert stage(np.broadcast_to(B, (30, 30, 3)), B).max() <= 0.06  # 1 − ω = 0.05 of the dark channel, ε of the TV
    assert stage(np.zeros((30, 30, 3), np.float32), B).min() >= 1 - 1e-5  # float32


@every_stage
@pytest.mark.parametrize("airlight", [(0.9, 0.8, 0.0), (1.0, 1.0, 1.0), (1.5, 1.4, 1.2), (0.01, 0.01, 0.01)])
def test_hard_airlights(stage, airlight):
    found = stage(images()["grey"], np.array(airlight))
    assert found.min() >= 0
    assert found.max() <= 1


@every_stage
def test_an_airlight_that_varies(stage):
    image = blend(scene_with_black(), layers(), B)
    np.testing.assert_array_equal(stage(image, np.broadcast_to(B, image.shape)), stage(image, B))


@every_stage
def test_what_cannot_be_is_refused(stage):
    image = images()["grey"]
    with pytest.raises(ValueError, match="NaN or infinite"):
        stage(np.where(image > 0.5, np.nan, image), B)
    with pytest.raises(ValueError, match="airlight is black"):
        stage(image, np.zeros(3))
    with pytest.raises(ValueError, match="same size"):
        stage(image, np.ones((4, 4, 3)))


@every_stage
def test_one_and_two_threads_give_the_same_bytes(stage):
    before = threads()
    image = blend(scene_with_black(200, 260), layers(200, 260), B)
    try:
        results = []
        for count in (1, 2):
            set_threads(count)
            cv2.setNumThreads(count)
            results.append(stage(image, B).tobytes())
    finally:
        set_threads(before)
        cv2.setNumThreads(-1)
    assert results[0] == results[1]
