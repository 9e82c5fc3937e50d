"""Transmission from one hazy image: what L ≥ 0 says, and the non-local estimate above it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fogpipe.bench.hazy_scenes import clear_scene
from fogpipe.stages.haze import contrast_corrected, lower_bound, non_local

GREY = np.array([0.9, 0.9, 0.9], np.float32)
COLOUR = st.floats(0, 1, width=32)


def hazy(scene: np.ndarray, t: np.ndarray, airlight: np.ndarray) -> np.ndarray:
    return t[..., None] * scene + (1 - t[..., None]) * airlight


def street(height: int = 60, width: int = 80, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A wall near by, texture in the distance: a scene with dark places everywhere, and its transmission."""
    rng = np.random.default_rng(seed)
    scene = rng.random((height, width, 3)).astype(np.float32) ** 2
    t = np.full((height, width), 0.25, np.float32)
    t[:, width // 2 :] = 0.8
    return scene, t


@given(
    scene=arrays(np.float32, (4, 5, 3), elements=COLOUR),
    t=arrays(np.float32, (4, 5), elements=st.floats(0.0625, 1, width=32)),
    airlight=arrays(np.float32, (3,), elements=st.floats(0.25, 1, width=32)),
)
def test_without_noise_the_bound_holds_and_so_does_the_estimate(scene, t, airlight):
    image = hazy(scene, t, airlight)
    bound = lower_bound(image, airlight)
    # I is rounded to half a unit in the last place of 1 in float32, and divided by B ≥ 0.25.
    assert (bound <= np.maximum(t, 0.01) + 1e-6).all()
    estimate = non_local(image, airlight, noise_sigma=0.0, window=3, floor=0.01)
    assert np.isfinite(estimate).all()
    assert (estimate >= bound * (1 - 1e-6)).all()  # through logarithm and exponential
    assert estimate.max() <= 1


def test_black_tells_the_transmission_exactly():
    t = np.linspace(0.05, 1, 12, dtype=np.float32).reshape(3, 4)
    image = hazy(np.zeros((3, 4, 3), np.float32), t, GREY)
    np.testing.assert_allclose(lower_bound(image, GREY), t, atol=2e-7)  # float32


def test_a_channel_without_airlight_is_passed_over():
    image = np.array([[[0.5, 0.45, 0.45]]], np.float32)
    np.testing.assert_allclose(lower_bound(image, np.array([0.0, 0.9, 0.9])), 0.5, atol=1e-7)


def test_a_colour_per_pixel_is_an_airlight_too():
    scene, t = street()
    field = np.broadcast_to(GREY, scene.shape)
    image = hazy(scene, t, GREY)
    np.testing.assert_array_equal(lower_bound(image, field), lower_bound(image, GREY))
    np.testing.assert_array_equal(non_local(image, field), non_local(image, GREY))


def test_noise_is_averaged_before_the_bound_is_taken():
    t = np.full((60, 80), 0.3, np.float32)
    image = hazy(np.zeros((60, 80, 3), np.float32), t, GREY)
    noisy = image + np.random.default_rng(0).normal(0, 10 / 255, image.shape).astype(np.float32)
    naive, aware = lower_bound(noisy, GREY), lower_bound(noisy, GREY, noise_sigma=10 / 255)
    # The least of three normal numbers lies 0.846 σ below their mean.
    assert naive.mean() == pytest.approx(0.3 + 0.846 * 10 / 255 / 0.9, abs=2e-3)  # 4800 pixels
    assert aware.mean() == pytest.approx(0.3, abs=2e-3)
    assert aware.std() < naive.std() / 2.5  # nine pixels, a third at best


def test_two_layers_keep_their_edge():
    scene, t = street()
    layers = np.repeat(t[..., None], 3, axis=2)
    found = non_local(hazy(scene, t, GREY), GREY, layers, noise_sigma=0.0, darkest=0, saturation=1)
    # Random colours reach black in one of 900 pixels to some hundredths; beside the edge no less.
    assert np.abs(found - t).max() < 0.05


def test_the_published_form_is_the_median_of_neighbours_above_the_bound():
    scene, t = street()
    image = hazy(scene, t, GREY)
    published = {"noise_sigma": 0.0, "darkest": 0, "saturation": 1, "quantile": 0.5}
    medians, dilation = non_local(image, GREY, **published), non_local(image, GREY, noise_sigma=0.0)
    assert (medians >= lower_bound(image, GREY, floor=0.02) * (1 - 1e-6)).all()
    assert medians.mean() < dilation.mean()


PUBLISHED = {"darkest": 0, "saturation": 1, "quantile": 0.5}
DUST = np.array([0.8, 0.85, 0.95], np.float32)


@pytest.mark.parametrize(
    ("noise", "airlight", "options"),
    [
        (0, GREY, {"noise_sigma": 0.005}),
        (0, GREY, {"noise_sigma": 0.0} | PUBLISHED),  # few values
        (0, DUST, {"noise_sigma": 0.0, "passes": 2} | PUBLISHED),
        (10, DUST, PUBLISHED),
        (0, GREY, {"noise_sigma": 0.005, "quantile": 0.5, "passes": 2}),
    ],
)
def test_the_fast_solver_is_within_its_tolerance(motorcycle, noise, airlight, options):
    picture = motorcycle[0][200:290, 300:400]
    image = hazy(picture, np.full(picture.shape[:2], 0.4, np.float32), airlight)
    image = np.rint(255 * image + noise * np.random.default_rng(7).normal(size=image.shape)).astype(np.float32) / 255
    exact, fast = (non_local(image, airlight, solver=solver, **options) for solver in ("exact", "fast"))
    assert np.sqrt(np.mean((exact - fast) ** 2)) < 1e-3


def test_so_it_is_where_the_clearest_pixels_see_few_others():
    """In haze that thickens they lie on their bound: 1.6e-3 if their few neighbours are counted and not sorted."""
    picture, distance = (part[180:300, 260:400] for part in clear_scene("motorcycle", 640, 480))
    image = hazy(picture, np.exp(-2 * distance), DUST)
    image = np.rint(255 * image + 10 * np.random.default_rng(7).normal(size=image.shape)).astype(np.float32) / 255
    exact, fast = (non_local(image, DUST, solver=solver, **PUBLISHED) for solver in ("exact", "fast"))
    assert np.sqrt(np.mean((exact - fast) ** 2)) < 1e-3


def test_the_guide_counts_in_units_of_the_airlight_and_alike_above_twice_that():
    scene, t = street()
    image = hazy(scene, t, GREY)
    structure = np.where(t[..., None] > 0.5, image, 50)
    dim, bright = (non_local(image * k, GREY * k, structure * k, noise_sigma=0.0) for k in (1, 8))  # 8 rounds nothing
    np.testing.assert_allclose(dim, bright, rtol=1e-5)  # float32
    brighter = np.where(t[..., None] > 0.5, image, 5000)
    np.testing.assert_array_equal(non_local(image, GREY, brighter), non_local(image, GREY, structure))


def hard_cases() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(0)
    image = rng.random((12, 17, 3)).astype(np.float32)
    return {
        "brighter than the airlight": (image * 0.1 + 0.9, GREY * 0.5),
        "airlight without red": (image, np.array([0, 0.8, 0.9], np.float32)),
        "saturated airlight": (image, np.ones(3, np.float32)),
        "constant": (np.full((12, 17, 3), 0.4, np.float32), GREY),
        "black": (np.zeros((12, 17, 3), np.float32), GREY),
        "grey": (np.repeat(image[..., :1], 3, axis=2), GREY),
        "tiny": (image[:3, :2], GREY),
        "all sky": (np.broadcast_to(GREY, (12, 17, 3)), GREY),
        "above 1": (image * 50, GREY),
        "one row": (image[:1], GREY),
        "one column": (image[:, :1], GREY),
        "one pixel": (image[:1, :1], GREY),
        "float64": (image.astype(np.float64), GREY),
        "float16": (image.astype(np.float16), GREY),
        "below 0": (image - 0.5, GREY),
    }


@pytest.mark.parametrize("case", hard_cases())
@pytest.mark.parametrize("options", [{}, {"solver": "exact"}, {"noise_sigma": 0.0}, {"noise_sigma": 0.1}])
def test_hard_cases_give_a_transmission(case, options):
    image, airlight = hard_cases()[case]
    t = non_local(image, airlight, **options)
    assert t.shape == image.shape[:2]
    assert np.isfinite(t).all()
    assert t.min() >= 0.02 * (1 - 1e-6)
    assert t.max() <= 1


def test_what_cannot_be_read_backwards_is_refused():
    image = np.full((4, 5, 3), 0.5, np.float32)
    for function in (lower_bound, non_local):
        with pytest.raises(ValueError, match="the airlight is black"):
            function(image, np.zeros(3))
        with pytest.raises(ValueError, match="airlight is NaN or infinite at 1 of 3"):
            function(image, np.array([0.9, np.nan, 0.9]))
        holed = image.copy()
        holed[1, 2, 0] = np.nan
        with pytest.raises(ValueError, match="image is NaN or infinite at 1 of 60"):
            function(holed, GREY)
    with pytest.raises(ValueError, match="structure has 4 × 4 pixels but image has 5 × 4"):
        non_local(image, GREY, image[:, :4])


def test_haze_of_one_thickness_leaves_the_contrast_as_it_was():
    """ρ is of the scene: behind t and behind t/2 the correction differs by its coefficient of ln t alone."""
    scene = street(seed=3)[0] * 0.5
    thin, thick = np.full(scene.shape[:2], 0.4, np.float32), np.full(scene.shape[:2], 0.2, np.float32)
    # The constants 0.01 and 0.05 that keep ρ finite weigh twice as much behind the thicker haze: a few per cent.
    options = {"noise_sigma": 0.0, "interplay": 0.0, "offset": 0.0, "slope": -0.3}
    first, second = (np.log(contrast_corrected(hazy(scene, t, GREY), GREY, t, **options) / t) for t in (thin, thick))
    np.testing.assert_allclose(first, second, atol=0.05)


def test_an_even_surface_is_not_taken_for_haze_and_leaves_are():
    rng = np.random.default_rng(5)
    scene = np.full((80, 160, 3), 0.4, np.float32)
    scene[:, 80:] = rng.choice([0.05, 0.75], (80, 80, 1))
    image = hazy(scene, np.full((80, 160), 0.8, np.float32), GREY)
    before = np.full((80, 160), 0.5, np.float32)
    after = contrast_corrected(image, GREY, before, noise_sigma=0.0)
    assert after[:, :40].min() > 1.1 * before[0, 0]
    assert after[:, 120:].mean() < after[:, :40].mean()


def test_without_coefficients_the_transmission_stays_and_the_bound_holds():
    scene, t = street()
    image = hazy(scene, t, GREY)
    options = {"noise_sigma": 0.0, "slope": 0.0, "interplay": 0.0}
    np.testing.assert_allclose(contrast_corrected(image, GREY, t, offset=0.0, **options), t, rtol=1e-6)  # exp(log t)
    lowered = contrast_corrected(image, GREY, t, offset=-5.0, **options)
    assert (lowered >= np.minimum(t, lower_bound(image, GREY, floor=0.02)) * (1 - 1e-6)).all()  # float32


def test_noise_is_not_taken_for_contrast():
    t = np.full((90, 120), 0.5, np.float32)
    scene = np.full((90, 120, 3), 0.4, np.float32)
    noisy = hazy(scene, t, GREY) + np.random.default_rng(2).normal(0, 10 / 255, scene.shape).astype(np.float32)
    clean = contrast_corrected(hazy(scene, t, GREY), GREY, t, noise_sigma=0.0)
    told = contrast_corrected(noisy, GREY, t, noise_sigma=10 / 255)
    untold = contrast_corrected(noisy, GREY, t, noise_sigma=0.0)
    assert np.abs(np.log(told / clean)).mean() < np.abs(np.log(untold / clean)).mean() / 2


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (5, 4)])
@pytest.mark.parametrize("value", [0.0, 0.9, 3.0])
def test_constant_tiny_black_and_bright_images_are_corrected_to_something_finite(shape, value):
    image, t = np.full((*shape, 3), value, np.float32), np.full(shape, 0.5, np.float32)
    for airlight in (GREY, np.array([0.0, 0.9, 0.9], np.float32)):
        corrected = contrast_corrected(image, airlight, t)
        assert corrected.shape == shape
        assert (corrected >= 0.02).all()
        assert (corrected <= 1).all()
