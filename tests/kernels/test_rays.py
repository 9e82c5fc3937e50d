"""Planar depth and distance along the ray."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fogpipe.kernels import bands
from fogpipe.kernels.rays import planar_to_radial, radial_to_planar

# Three rounded float32 operations and a rounded square root: a few units in the last place (6e-8 each).
FLOAT32 = 4e-7
# The same count in float64.
FLOAT64 = 1e-15

CAMERA = np.array([[700.0, 0, 600.5], [0, 650.0, 180.25], [0, 0, 1]])


def rays_by_inverse(camera: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """|K⁻¹ (u, v, 1)| as it is written, in float64."""
    v, u = np.mgrid[:rows, :columns]
    return np.linalg.norm(np.linalg.inv(camera) @ np.stack([u, v, np.ones_like(u)]).reshape(3, -1), axis=0).reshape(
        rows, columns
    )


def test_the_principal_ray_is_not_changed():
    camera = np.array([[500.0, 0, 3], [0, 500, 2], [0, 0, 1]])
    assert planar_to_radial(np.full((5, 7), 4.0, np.float32), camera)[2, 3] == 4


def test_a_345_triangle():
    camera = np.array([[4.0, 0, 0], [0, 4, 0], [0, 0, 1]])
    # Pixel (3, 0) lies at x = 3/4 of the depth: a depth of 4 m is 5 m along the ray.
    assert planar_to_radial(np.full((1, 4), 4.0), camera)[0, 3] == pytest.approx(5, rel=FLOAT64)


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, FLOAT32), (np.float64, FLOAT64)])
@pytest.mark.parametrize("skew", [0.0, 25.0])
def test_equals_the_formula_for_any_intrinsic_matrix(dtype, tolerance, skew):
    camera = CAMERA.copy()
    camera[0, 1] = skew
    depth = np.random.default_rng(0).uniform(1, 100, (211, 303)).astype(dtype)
    radial = planar_to_radial(depth, camera)
    assert radial.dtype == dtype
    np.testing.assert_allclose(radial, depth * rays_by_inverse(camera, 211, 303), rtol=tolerance)


@given(
    depth=st.floats(1e-3, 1e6),
    focal_length=st.floats(10, 5000),
    centre=st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
)
def test_the_inverse_undoes_it(depth, focal_length, centre):
    camera = np.array([[focal_length, 0, centre[0]], [0, focal_length, centre[1]], [0, 0, 1]])
    planar = np.full((3, 4), depth)
    np.testing.assert_allclose(radial_to_planar(planar_to_radial(planar, camera), camera), planar, rtol=FLOAT64)


def test_radial_is_never_nearer_than_planar():
    depth = np.ones((64, 64), np.float32)
    assert (planar_to_radial(depth, CAMERA) >= depth).all()


def test_unknown_and_sky_stay():
    depth = np.array([[np.nan, np.inf, 0, 1]], np.float32)
    radial = planar_to_radial(depth, CAMERA)
    assert np.isnan(radial[0, 0])
    assert radial[0, 1] == np.inf
    assert radial[0, 2] == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (5, 0)])
def test_odd_shapes(shape):
    assert planar_to_radial(np.ones(shape, np.float32), CAMERA).shape == shape


def test_views_and_half_floats_are_accepted():
    depth = np.arange(1, 41, dtype=np.float32).reshape(5, 8)
    expected = planar_to_radial(depth, CAMERA)
    strided = np.repeat(np.repeat(depth, 2, axis=0), 3, axis=1)[::2, ::3]
    strided.flags.writeable = False
    np.testing.assert_array_equal(planar_to_radial(strided, CAMERA), expected)
    # 1 to 40 are exact in half precision.
    np.testing.assert_array_equal(planar_to_radial(depth.astype(np.float16), CAMERA), expected)


def test_threads_do_not_change_a_bit():
    depth = np.random.default_rng(1).random((300, 400), np.float32)
    before = bands.threads()
    try:
        results = []
        for count in (1, 2, 3):
            bands.set_threads(count)
            results.append(planar_to_radial(depth, CAMERA).tobytes())
    finally:
        bands.set_threads(before)
    assert len(set(results)) == 1


@pytest.mark.parametrize(
    "camera",
    [
        np.eye(4),
        np.diag([0.0, 1, 1]),
        np.diag([1.0, -1, 1]),
        np.diag([np.nan, 1, 1]),
        CAMERA.T,
        2 * CAMERA,
    ],
    ids=["4×4", "fx = 0", "fy < 0", "NaN", "transposed", "scaled"],
)
def test_what_is_no_intrinsic_matrix_is_refused(camera):
    with pytest.raises(ValueError, match="intrinsic matrix"):
        planar_to_radial(np.ones((2, 2)), camera)


def test_three_axes_are_refused():
    with pytest.raises(ValueError, match="two axes"):
        planar_to_radial(np.ones((2, 2, 3)), CAMERA)
