"""The stages of Hansard 2019, chained as the pipeline chains them, on scenes that break naive code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.kernels import bands
from fogpipe.stages import airlight, blur, composite, medium, sky
from fogpipe.stages import range as ranging


class Haze(NamedTuple):
    """What the chain of stages gives."""

    range_map: np.ndarray
    sky: np.ndarray
    transmission: np.ndarray
    scale: np.ndarray
    airlight: np.ndarray
    image: np.ndarray


def haze(image, range_map, *, solver="invariant", matting="colour", strength=8.0, **fog) -> Haze:
    """Haze on an image; by default so dense that visibility is 20 m."""
    undefined = sky.identify(range_map)
    farthest = ranging.farthest(range_map)
    filled = ranging.fill_holes(range_map, undefined.holes, image, rng=np.random.default_rng(0), largest=1.0)
    matted = sky.matte(filled, undefined.sky, farthest, image, solver=matting)
    air = medium.fog(farthest, **(fog or {"visibility": 20.0}))
    t = medium.transmission(matted, air.extinction)
    scale = blur.scale(matted, air.scattering, farthest, strength=strength)
    light = airlight.estimate(image, undefined.sky)
    layer = blur.diffusion(composite.attenuate(image, t), scale, solver=solver)
    return Haze(matted, undefined.sky, t, scale, light, composite.over_airlight(layer, light))


def thick(range_map: np.ndarray, optical_thickness: float) -> float:
    """Extinction for an optical thickness at the farthest return, or at 1 m where there is none beyond."""
    return optical_thickness / max(1.0, np.max(range_map, where=np.isfinite(range_map), initial=0.0))


def check(image, range_map, result: Haze) -> None:
    """What must hold for every scene."""
    measured = np.isfinite(range_map)
    np.testing.assert_array_equal(result.range_map[measured], range_map[measured])
    assert not np.isnan(result.range_map).any()
    assert np.isfinite(result.scale).all()
    assert 0 <= result.transmission.min() <= result.transmission.max() <= 1
    # A composite is a mean of colours of the image and of the airlight; float32, blurred in up to 13 steps.
    low, high = min(image.min(), result.airlight.min()), max(image.max(), result.airlight.max())
    slack = 1e-5 * max(high, 1)
    assert result.image.shape == image.shape
    assert low - slack <= result.image.min() <= result.image.max() <= high + slack


def photo(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(3).random((height, width, 3), dtype=np.float32)


def outdoors(height: int = 33, width: int = 47) -> np.ndarray:
    """Range with sky above and a tenth of all pixels missing below."""
    range_map = np.tile(np.linspace(90, 2, height, dtype=np.float32)[:, None], (1, width))
    range_map[np.random.default_rng(4).random((height, width)) < 0.1] = np.nan
    range_map[: height // 3] = np.nan
    return range_map


def filled_with(value: float, height: int = 9, width: int = 11) -> np.ndarray:
    return np.full((height, width), value, np.float32)


def half_and_half(left: float, right: float) -> np.ndarray:
    range_map = filled_with(left, 12, 14)
    range_map[:, 7:] = right
    return range_map


SCENES = {
    "sky and holes, odd size": outdoors(),
    "even size": outdoors(32, 48),
    "no sky, no holes": np.tile(np.linspace(2, 5, 31, dtype=np.float32), (17, 1)),
    "all sky, unknown": filled_with(np.nan),
    "all sky, infinite": filled_with(np.inf),
    "all at range zero": filled_with(0.0),
    "one range": filled_with(7.5),
    "one pixel": filled_with(3.0, 1, 1),
    "one pixel of sky": filled_with(np.inf, 1, 1),
    "one unknown pixel": filled_with(np.nan, 1, 1),
    "one row": outdoors(60, 1).T.copy(),
    "one column": outdoors(60, 1),
    "zero beside infinity": half_and_half(0.0, np.inf),
    "range beside infinity": half_and_half(4.0, np.inf),
    "holes beside range": half_and_half(np.nan, 4.0),
    "a single return": np.where(np.arange(99).reshape(9, 11) == 50, 6, np.nan).astype(np.float32),
    "a chequerboard of holes": np.where(np.indices((8, 9)).sum(0) % 2, 6, np.nan).astype(np.float32),
    "micrometres and light years": np.array([[1e-6, 1e16, 3.0, np.inf]], np.float32),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("solver", ["invariant", "euler"])
def test_scene(name, solver):
    range_map = SCENES[name]
    image = photo(*range_map.shape)
    matting = "direct" if solver == "invariant" else "jacobi"
    check(image, range_map, haze(image, range_map, solver=solver, matting=matting, extinction=thick(range_map, 1.5)))


@pytest.mark.parametrize("name", ["all sky, unknown", "all sky, infinite", "one unknown pixel", "all at range zero"])
def test_a_scene_without_distances_has_no_optical_thickness(name):
    with pytest.raises(ValueError, match=r"set visibility \(m\) or extinction"):
        haze(photo(*SCENES[name].shape), SCENES[name], optical_thickness=1.0)


def test_all_sky_is_all_airlight():
    image = photo(9, 11)
    result = haze(image, SCENES["all sky, unknown"])
    np.testing.assert_array_equal(result.image, np.broadcast_to(result.airlight, image.shape))


def test_everything_at_range_zero_is_seen_clearly():
    image = photo(9, 11)
    np.testing.assert_array_equal(haze(image, SCENES["all at range zero"]).image, image)


@pytest.mark.parametrize("solver", ["invariant", "euler"])
def test_no_extinction_changes_nothing(solver):
    image, range_map = photo(33, 47), outdoors()
    np.testing.assert_array_equal(haze(image, range_map, solver=solver, extinction=0.0).image, image)


def test_huge_extinction_leaves_only_airlight():
    image, range_map = photo(33, 47), outdoors()
    result = haze(image, range_map, extinction=1e30, strength=0.0)
    np.testing.assert_array_equal(result.image, np.broadcast_to(result.airlight, image.shape))


def test_no_strength_is_no_blur():
    image, range_map = photo(33, 47), outdoors()
    result = haze(image, range_map, strength=0.0)
    assert (result.scale == 1).all()
    np.testing.assert_allclose(
        result.image, composite.naive(image, result.transmission, result.airlight), rtol=1e-6
    )  # float32


@pytest.mark.parametrize("solver", ["invariant", "euler"])
def test_a_constant_image_of_the_colour_of_the_airlight_stays(solver):
    image = np.full((33, 47, 3), 0.6, np.float32)
    result = haze(image, outdoors(), solver=solver, optical_thickness=1.0)
    # Colour and opacity are blurred by the same weights, so they cancel but for the rounding of at most 160 steps.
    np.testing.assert_allclose(result.image, image, atol=160 * np.finfo(np.float32).eps / 2)


@pytest.mark.parametrize("solver", ["invariant", "euler"])
def test_lights_far_above_white(solver):
    image, range_map = photo(33, 47), outdoors()
    image[30, 30] = 1e4
    result = haze(image, range_map, solver=solver, optical_thickness=1.0)
    check(image, range_map, result)
    assert np.unravel_index(result.image[..., 0].argmax(), range_map.shape) == (30, 30)
    assert result.image.max() > 100


def test_half_precision_is_computed_in_single():
    image, range_map = photo(33, 47).astype(np.float16), outdoors().astype(np.float16)
    result = haze(image, range_map)
    assert {array.dtype for array in result if array.dtype != bool} == {np.dtype(np.float32)}
    check(image, range_map, result)


def test_double_precision_stays_double_and_agrees():
    image, range_map = photo(33, 47), outdoors()
    single, double = haze(image, range_map), haze(image.astype(np.float64), range_map.astype(np.float64))
    assert {array.dtype for array in double if array.dtype != bool} == {np.dtype(np.float64)}
    # Thirteen steps in float32; where a sample falls on a pixel, rounding may take the one beside it.
    np.testing.assert_allclose(double.image, single.image, atol=2e-5)


def spread_out(array: np.ndarray) -> np.ndarray:
    """The same values, neither contiguous nor in order of rows, and read-only."""
    wide = np.zeros((array.shape[1] * 2, array.shape[0] * 3, *array.shape[2:]), array.dtype).swapaxes(0, 1)
    view = wide[::3, ::2]
    view[...] = array
    view.flags.writeable = False
    return view


def test_layout_of_the_arrays_does_not_matter():
    image, range_map = photo(33, 47), outdoors()
    plain, spread = haze(image, range_map), haze(spread_out(image), spread_out(range_map))
    np.testing.assert_array_equal(plain.image, spread.image)


def test_arrays_that_are_given_are_left_alone():
    image, range_map = photo(33, 47), outdoors()
    kept = image.copy(), range_map.copy()
    haze(image, range_map)
    np.testing.assert_array_equal(image, kept[0])
    np.testing.assert_array_equal(range_map, kept[1])


@pytest.mark.parametrize("bad", [-1.0, -np.inf])
def test_negative_range_is_refused(bad):
    range_map = outdoors()
    range_map[-1, -1] = bad
    with pytest.raises(ValueError, match="range_map is negative"):
        haze(photo(33, 47), range_map)


@pytest.mark.parametrize("solver", ["invariant", "euler"])
def test_same_bytes_for_one_and_two_threads(solver):
    image, range_map = photo(187, 201), outdoors(187, 201)  # two bands
    before = bands.threads()
    try:
        results = []
        for count in (1, 2):
            bands.set_threads(count)
            results.append(b"".join(array.tobytes() for array in haze(image, range_map, solver=solver, strength=3.0)))
    finally:
        bands.set_threads(before)
    assert results[0] == results[1]


RANGES = st.one_of(st.floats(0, 1e6, width=32), st.sampled_from([0.0, np.nan, np.inf]))
SHAPES = st.tuples(st.integers(1, 6), st.integers(1, 6))


@settings(deadline=None, max_examples=150)
@given(
    scene=SHAPES.flatmap(
        lambda shape: st.tuples(
            hnp.arrays(np.float32, (*shape, 3), elements=st.floats(0, 1e4, width=32)),
            hnp.arrays(np.float32, shape, elements=RANGES),
        )
    ),
    optical_thickness=st.floats(0, 400),
    solver=st.sampled_from(["invariant", "euler"]),
    matting=st.sampled_from(["colour", "direct", "jacobi"]),
)
def test_every_small_scene(scene, optical_thickness, solver, matting):
    image, range_map = scene
    extinction = thick(range_map, optical_thickness)  # blurs by 5 px at most: Euler steps go with the square
    result = haze(image, range_map, solver=solver, matting=matting, extinction=extinction, strength=0.2)
    check(image, range_map, result)
