"""Blur by scattered light: what it conserves, what it converges to, and hard cases."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fogpipe.kernels import bands
from fogpipe.stages.composite import add, attenuate, over_airlight
from fogpipe.stages.scattering import apsf, blur, forward, glow

RNG = np.random.default_rng(3)
HEIGHT, WIDTH = 24, 33
IMAGE = RNG.random((HEIGHT, WIDTH, 3))
STEP = np.where(np.arange(WIDTH) < 12, 0.9, 0.2) * np.ones((HEIGHT, 1))
"""Transmission of something near before something far."""
SMOOTH = np.exp(-np.linspace(0.05, 6, HEIGHT * WIDTH)).reshape(HEIGHT, WIDTH)
NOISY = np.exp(-RNG.uniform(0.01, 9, (HEIGHT, WIDTH)))
TRANSMISSIONS = {"step": STEP, "smooth": SMOOTH, "noisy": NOISY}
SCENES = pytest.mark.parametrize("scene", TRANSMISSIONS)
FORMS = pytest.mark.parametrize("form", ["scatter", "gather"])


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(difference**2)))


@cache
def reference(scene: str, form: str) -> np.ndarray:
    """The sum over all pairs of pixels."""
    return blur(IMAGE, TRANSMISSIONS[scene], form=form, solver="reference")


def test_shares_of_direct_forward_and_airlight_add_to_one():
    together = add(attenuate(IMAGE, SMOOTH), forward(IMAGE, SMOOTH, asymmetry=0.9))
    np.testing.assert_allclose(together[..., 3], SMOOTH ** (1 - 0.81), rtol=1e-12)
    np.testing.assert_allclose(together[..., :3], together[..., 3:] * IMAGE, rtol=1e-12)


def test_isotropic_scattering_leaves_nothing_forward():
    assert not forward(IMAGE, SMOOTH, asymmetry=0.0).any()


def test_a_sharp_direct_layer_and_a_blurred_scattered_one_make_a_composite():
    scattered = forward(blur(IMAGE, STEP), STEP)
    together = add(attenuate(IMAGE, STEP), scattered)
    assert together[..., 3].max() <= 1  # or the composite would take airlight away
    foggy = over_airlight(together, np.array([0.7, 0.7, 0.7]))
    # Detail is that of the direct light: neighbours differ by t times what they differed by, and little more.
    detail = np.abs(np.diff(foggy[:, 14:], axis=1)).mean() / np.abs(np.diff(IMAGE[:, 14:], axis=1)).mean()
    assert 0.2 < detail < 0.25


def test_an_evenly_lit_world_looks_the_same_through_any_fog():
    even = np.full((HEIGHT, WIDTH, 3), 0.7)
    together = add(attenuate(even, NOISY), forward(blur(even, NOISY), NOISY))
    np.testing.assert_allclose(over_airlight(together, np.array([0.7, 0.7, 0.7])), 0.7, rtol=1e-11)


@pytest.mark.parametrize("scene", ["step", "noisy"])
def test_a_glow_conserves_the_light_of_lamps(scene):
    t = TRANSMISSIONS[scene]
    lamps = np.where(IMAGE > 0.98, 1e4, 0.01)
    foggy = glow(lamps, t)
    np.testing.assert_allclose(foggy.sum(axis=(0, 1)), lamps.sum(axis=(0, 1)), rtol=1e-11)
    exact = t[..., None] * lamps + blur((1 - t[..., None]) * lamps, t, form="scatter", solver="reference")
    # What blur promises: the tolerance, but no less than 3e-5 of the variation of what is blurred.
    assert rms(foggy - exact) <= max(0.002, 3e-5 * ((1 - t[..., None]) * lamps).std())


def test_a_glow_keeps_the_tolerance():
    # Lamps of 50, for which 3e-5 of the variation is less than the tolerance.
    lamps = np.where(IMAGE > 0.98, 50, 0.01)
    for tolerance in (0.02, 0.002):
        exact = glow(lamps, NOISY, solver="reference")
        assert rms(glow(lamps, NOISY, tolerance=tolerance) - exact) <= tolerance


def test_a_glow_without_fog_is_skipped():
    clear = np.ones((HEIGHT, WIDTH))
    assert "unscattered" in glow.__stage__.identity_when(clear)
    np.testing.assert_allclose(glow(IMAGE, clear), IMAGE, rtol=0, atol=1e-15)


@SCENES
@FORMS
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_the_fast_solver_keeps_the_tolerance(scene, form, tolerance):
    fast = blur(IMAGE, TRANSMISSIONS[scene], form=form, tolerance=tolerance)
    assert rms(fast - reference(scene, form)) <= tolerance


@SCENES
def test_scattering_conserves_light_and_gathering_a_constant(scene):
    t = TRANSMISSIONS[scene]
    for spread in (blur(IMAGE, t, form="scatter", tolerance=0.1), reference(scene, "scatter")):
        # Float64, some thousand summands.
        np.testing.assert_allclose(spread.sum(axis=(0, 1)), IMAGE.sum(axis=(0, 1)), rtol=1e-11)
    for solver in ("fast", "reference"):
        small = blur(np.full((6, 7, 3), 0.3), t[::4, ::5], form="gather", solver=solver, tolerance=0.1)
        np.testing.assert_allclose(small, 0.3, rtol=1e-11)


@FORMS
def test_borders_do_not_darken(form):
    constant = np.full((HEIGHT, WIDTH, 3), 0.5)
    blurred = blur(constant, np.full((HEIGHT, WIDTH), 0.1), form=form)
    np.testing.assert_allclose(blurred, 0.5, rtol=1e-12)


def test_thicker_fog_blurs_more():
    point = np.zeros((41, 41, 3))
    point[20, 20] = 1
    peaks = [blur(point, np.full((41, 41), np.exp(-T)))[20, 20, 0] for T in (0.1, 0.5, 1, 2, 4, 8)]
    assert (np.diff(peaks) < 0).all()


@FORMS
def test_scatter_is_the_transpose_of_gather(form):
    other = {"scatter": "gather", "gather": "scatter"}[form]
    first, second = RNG.random((2, HEIGHT, WIDTH, 3))
    # With the same basis; the reference is exact, and the tolerance below what its nodes can do.
    one = np.vdot(blur(first, STEP, form=form, tolerance=1e-9), second)
    assert one == pytest.approx(np.vdot(first, blur(second, STEP, form=other, tolerance=1e-9)), rel=1e-5)


def test_a_camera_gives_the_focal_length():
    camera = np.array([[40.0, 0, 16], [0, 40.0, 12], [0, 0, 1]])
    angle = 2 * np.degrees(np.arctan(WIDTH / 2 / 40))
    np.testing.assert_allclose(blur(IMAGE, STEP, camera), blur(IMAGE, STEP, field_of_view=angle), rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "stage",
    [
        lambda image, t: blur(image, t, form="scatter"),
        lambda image, t: blur(image, t, form="gather"),
        glow,
        lambda image, t: apsf(image, 1 - t),
        lambda image, t: apsf(image, 1 - t, channels="all", form="scatter"),
    ],
    ids=["scatter", "gather", "glow", "apsf", "apsf in colour"],
)
def test_the_number_of_threads_changes_no_byte(dtype, stage):
    tall = RNG.random((200, 300, 3)).astype(dtype)
    t = np.exp(-RNG.uniform(0, 4, (200, 300))).astype(dtype)
    before, found = bands.threads(), []
    for count in (1, 2, 5):
        bands.set_threads(count)
        found.append(stage(tall, t).tobytes())
    bands.set_threads(before)
    assert found[0] == found[1] == found[2]


def test_light_of_10000_is_spread_and_does_not_go_negative_by_more_than_the_tolerance():
    image = np.zeros((24, 32, 3), np.float32)
    image[12, 16] = 1e4
    t = np.full((24, 32), 0.1, np.float32)
    t[:, :16] = 0.8
    exact = blur(image, t, form="scatter", solver="reference")
    fast = blur(image, t, form="scatter", tolerance=1e-3)
    assert exact.min() >= 0
    assert rms(fast - exact) <= 1e-3
    assert fast.sum() == pytest.approx(image.sum(), rel=1e-5)  # float32


@pytest.mark.parametrize("shape", [(1, 40), (40, 1), (1, 1), (2, 3)])
@FORMS
def test_narrow_pictures(shape, form):
    image, t = RNG.random((*shape, 3)), RNG.random(shape)
    exact = blur(image, t, form=form, solver="reference")
    assert rms(blur(image, t, form=form, tolerance=1e-4) - exact) <= 1e-4


@pytest.mark.parametrize("field_of_view", [0.01, 1.0, 179.0])
def test_a_kernel_may_be_larger_than_the_picture_or_smaller_than_a_pixel(field_of_view):
    image, t = IMAGE[::2, ::2], SMOOTH[::2, ::2]
    blurred = blur(image, t, field_of_view=field_of_view, form="scatter", solver="reference")
    assert blurred.min() >= 0
    np.testing.assert_allclose(blurred.sum(axis=(0, 1)), image.sum(axis=(0, 1)), rtol=1e-11)
    fast = blur(image, t, field_of_view=field_of_view, form="scatter", tolerance=1e-4)
    assert rms(fast - blurred) <= 1e-4


@pytest.mark.parametrize("t", [0.0, 1e-30, np.exp(-50.0), 1 - 1e-7, 1.0])
def test_any_thickness_has_a_kernel(t):
    blurred = blur(IMAGE, np.full((HEIGHT, WIDTH), t))
    assert np.isfinite(blurred).all()


def test_a_black_image_is_skipped():
    black = np.zeros((4, 5, 3), np.float32)
    assert "black" in blur.__stage__.identity_when(black)
    assert not blur(black, np.ones((4, 5), np.float32)).any()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_refused_with_its_place(bad):
    image, t = np.ones((5, 6, 3)), np.ones((5, 6))
    image[2, 3, 1] = bad
    for function in (blur, forward, glow, apsf):
        with pytest.raises(ValueError, match=r"NaN or infinite at 1 of \d+ values, the first at index \(2, 3"):
            function(image, t)
    unknown = t.copy()
    unknown[4, 5] = np.nan
    with pytest.raises(ValueError, match=r"transmission is .* at 1 of .* at index \(4, 5"):
        blur(np.ones((5, 6, 3)), unknown)


@pytest.mark.parametrize("asymmetry", [-0.1, 0.995, 1.0])
def test_an_asymmetry_outside_the_table_is_refused(asymmetry):
    with pytest.raises(ValueError, match="asymmetry must be in"):
        blur(np.ones((4, 5, 3)), np.full((4, 5), 0.5), asymmetry=asymmetry)


DEPTH = np.clip(np.linspace(-0.2, 1.2, HEIGHT * WIDTH), 0, 1).reshape(HEIGHT, WIDTH)


@FORMS
@pytest.mark.parametrize("channels", ["luminance", "all"])
@pytest.mark.parametrize("kernel", ["series", "gaussian"])
def test_interpolated_kernels_are_exact(form, channels, kernel):
    settings = {"form": form, "channels": channels, "kernel": kernel, "middle": 0.05, "far": 0.3}
    exact = apsf(IMAGE, DEPTH, solver="reference", **settings)
    np.testing.assert_allclose(apsf(IMAGE, DEPTH, **settings), exact, rtol=0, atol=1e-12)


def test_near_is_sharp_and_far_is_soft():
    blurred = apsf(IMAGE, DEPTH, far=0.4, middle=0.2, channels="all")
    np.testing.assert_allclose(blurred[DEPTH == 0], IMAGE[DEPTH == 0], rtol=1e-12)
    assert blurred[DEPTH == 1].std() < 0.8 * IMAGE[DEPTH == 1].std()


def test_figure_8_sizes_shrink_with_depth():
    point = np.zeros((61, 61, 3))
    point[30, 30] = 1
    widths = {"near": 0.2, "middle": 0.1, "far": 0.05}
    peaks = [
        apsf(point, np.full((61, 61), depth), channels="all", **widths)[30, 30, 0] for depth in (0.0, 0.5, 0.75, 1.0)
    ]
    assert (np.diff(peaks) > 0).all()
    assert peaks[2] == pytest.approx((peaks[1] + peaks[3]) / 2)  # halfway between the threshold and 1


def test_luminance_keeps_the_ratios_of_colours():
    blurred = apsf(IMAGE, np.ones((HEIGHT, WIDTH)), far=0.1)
    np.testing.assert_allclose(blurred / blurred.max(axis=2, keepdims=True), IMAGE / IMAGE.max(axis=2, keepdims=True))


def test_a_black_picture_stays_black_and_light_on_black_is_grey():
    black = np.zeros((9, 9, 3))
    assert not apsf(black, np.ones((9, 9)), far=0.2).any()
    black[4, 4] = (1, 0, 0)
    blurred = apsf(black, np.ones((9, 9)), far=0.2)
    assert (blurred[0, 0] == blurred[0, 0, 0]).all()
    assert blurred[0, 0, 0] > 0


def test_published_kernels_of_size_0_are_skipped():
    assert apsf.__stage__.identity_when(0, 0, 0)
    np.testing.assert_array_equal(apsf(IMAGE, DEPTH, near=0, middle=0, far=0), IMAGE)


@pytest.mark.parametrize("optical_thickness", [1.0, 0.7])
def test_the_series_is_refused_up_to_a_thickness_of_1_and_the_gaussian_is_not(optical_thickness):
    with pytest.raises(ValueError, match="needs an optical thickness above 1"):
        apsf(IMAGE, DEPTH, optical_thickness=optical_thickness)
    assert np.isfinite(apsf(IMAGE, DEPTH, optical_thickness=optical_thickness, kernel="gaussian")).all()


@pytest.mark.parametrize("optical_thickness", [1.001, 50.0])
@pytest.mark.parametrize("asymmetry", [0.0, 0.999])
def test_the_series_at_its_extremes_gives_a_picture_that_keeps_its_light(optical_thickness, asymmetry):
    settings = {"near": 0.1, "far": 0.1, "middle": 0.1, "channels": "all", "form": "scatter"}
    blurred = apsf(IMAGE, DEPTH, optical_thickness=optical_thickness, asymmetry=asymmetry, **settings)
    np.testing.assert_allclose(blurred.sum(), IMAGE.sum(), rtol=1e-11)
    assert blurred.min() > 0
