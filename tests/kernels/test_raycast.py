"""The object-order ray caster against solids whose first meeting with a ray is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.raycast import (
    ELLIPSE,
    FIRST_SOLID,
    NOTHING,
    RECTANGLE,
    TRIANGLE,
    Solids,
    View,
    bounds,
    cast_solids,
    meet_terrain,
    trace_profiles,
)

ROWS, COLUMNS = 81, 121
VIEW = View(fx=100.0, fy=100.0, cx=60.0, cy=40.0)
NO_PATCHES = np.zeros((0, 3, 3))
NO_CAPSULES = np.zeros((0, 7))
# Depths are kept in float32 (6e-8); the algebra before is float64.
TOLERANCE = 2e-7
AHEAD = np.array([0.0, 0, 6])


def cast(patches=NO_PATCHES, shapes=(), capsules=NO_CAPSULES) -> tuple[np.ndarray, np.ndarray]:
    patches, capsules = np.asarray(patches, np.float64), np.asarray(capsules, np.float64)
    solids = Solids(patches, np.asarray(shapes, np.int8), capsules, bounds(patches, capsules, VIEW, ROWS, COLUMNS))
    depth, owner = np.full((ROWS, COLUMNS), np.inf, np.float32), np.zeros((ROWS, COLUMNS), np.int32)
    in_bands(cast_solids, ROWS, COLUMNS, 0, VIEW, solids, depth, owner)
    return depth, owner


def directions() -> np.ndarray:
    row, column = np.mgrid[:ROWS, :COLUMNS]
    return np.stack([(column - VIEW.cx) / VIEW.fx, (VIEW.cy - row) / VIEW.fy, np.ones((ROWS, COLUMNS))], axis=-1)


def test_a_slanted_plane_is_met_at_its_equation():
    corner, a, b = np.array([-9.0, -9, 3]), np.array([18.0, 0, 2]), np.array([0.0, 18, 4])
    depth, owner = cast([[corner, a, b]], [RECTANGLE])
    normal = np.cross(a, b)
    np.testing.assert_allclose(depth, normal @ corner / (directions() @ normal), rtol=TOLERANCE)
    assert (owner == FIRST_SOLID).all()


def test_a_sphere_is_met_at_the_nearer_root():
    centre, radius = np.array([0.4, -0.2, 5.0]), 1.0
    depth, owner = cast(capsules=[[*centre, *centre, radius]])
    d = directions()
    d2, b = (d * d).sum(-1), d @ centre
    discriminant = b * b - d2 * (centre @ centre - radius**2)
    hit = discriminant >= 0
    np.testing.assert_array_equal(owner == FIRST_SOLID, hit)
    # At the silhouette the root amplifies rounding, so its square root is taken of the float64 discriminant here too.
    np.testing.assert_allclose(depth[hit], (b[hit] - np.sqrt(discriminant[hit])) / d2[hit], rtol=1e-6)


def test_points_on_a_capsule_are_at_its_radius_from_the_segment():
    start, end, radius = np.array([-1.0, -0.6, 4]), np.array([1.2, 0.5, 6]), 0.3
    depth, owner = cast(capsules=[[*start, *end, radius]])
    hit = owner != NOTHING
    assert hit.sum() > 200
    points = depth[hit, None] * directions()[hit]
    axis = end - start
    along = np.clip((points - start) @ axis / (axis @ axis), 0, 1)
    distance = np.linalg.norm(points - start - along[:, None] * axis, axis=1)
    # float32 depths of 4 to 6 m are exact to 3e-7 m; grazing rays amplify that.
    np.testing.assert_allclose(distance, radius, atol=2e-6)


@pytest.mark.parametrize(("shape", "share"), [(RECTANGLE, 1.0), (TRIANGLE, 0.5), (ELLIPSE, np.pi / 4)])
def test_shapes_cover_their_share_of_the_parallelogram(shape, share):
    depth, _ = cast([[[-0.3, -0.3, 1], [0.6, 0, 0], [0, 0.6, 0]]], [shape])
    # 60×60 samples; a boundary of at most 240 samples falls to either side.
    assert np.isfinite(depth).sum() == pytest.approx(share * 3600, abs=125)


def test_the_nearer_of_two_solids_wins_whatever_their_order():
    near = [[-0.5, -0.5, 2], [1, 0, 0], [0, 1, 0]]
    far = [[-9, -9, 3], [18, 0, 0], [0, 18, 0]]
    one, _ = cast([near, far], [RECTANGLE] * 2)
    other, _ = cast([far, near], [RECTANGLE] * 2)
    np.testing.assert_array_equal(one, other)
    assert set(np.unique(one)) == {2.0, 3.0}


def test_what_reaches_behind_the_eye_is_left_out():
    depth, owner = cast([[[-1, -1, -2], [2, 0, 0], [0, 2, 0]]], [RECTANGLE], [[0, 0, 0.1, 0, 0, 0.1, 0.5]])
    assert np.isinf(depth).all()
    assert (owner == NOTHING).all()


def test_bounds_hold_every_sample_that_a_solid_covers():
    """With the whole grid as bounds nothing more is met."""
    rng = np.random.default_rng(3)
    patches = np.concatenate([rng.uniform(-2, 2, (40, 1, 3)) + AHEAD, rng.normal(size=(40, 2, 3))], axis=1)
    ends = rng.uniform(-2, 2, (40, 2, 3)) + AHEAD
    capsules = np.concatenate([ends.reshape(40, 6), rng.uniform(0.02, 0.4, (40, 1))], axis=1)
    shapes = rng.integers(0, 3, 40).astype(np.int8)
    depth, owner = cast(patches, shapes, capsules)
    everywhere = np.tile(np.array([0, ROWS - 1, 0, COLUMNS - 1], np.int32), (80, 1))
    full_depth, full_owner = np.full_like(depth, np.inf), np.zeros_like(owner)
    cast_solids(0, ROWS, 0, VIEW, Solids(patches, shapes, capsules, everywhere), full_depth, full_owner)
    np.testing.assert_array_equal(depth, full_depth)
    np.testing.assert_array_equal(owner, full_owner)


def terrain_depths(heights: np.ndarray, eye: float) -> np.ndarray:
    depths = np.geomspace(1, 100, 200)
    lowest, profile = np.empty((2, COLUMNS, depths.size), np.float32)
    trace_profiles(0, COLUMNS, VIEW, eye, heights, -100.0, depths, lowest, profile)
    result = np.empty((ROWS, COLUMNS))
    for column in range(COLUMNS):
        step = depths.size
        for row in range(ROWS):
            descent = (row - VIEW.cy) / VIEW.fy
            result[row, column], step = meet_terrain(descent, eye, depths, lowest[column], profile[column], step)
    return result


def test_a_flat_terrain_is_the_plane():
    depth = terrain_depths(np.zeros((120, 201)), eye=1.5)
    descent = (np.arange(ROWS) - VIEW.cy) / VIEW.fy
    seen = descent > 1.5 / 100
    # Exact but for the rounding of float64.
    np.testing.assert_allclose(depth[seen], (1.5 / descent[seen])[:, None].repeat(COLUMNS, 1), rtol=1e-12)
    assert np.isinf(depth[descent < 1.5 / 101]).all()


def test_a_hill_hides_what_is_behind_it_and_stands_against_the_sky():
    heights = np.zeros((120, 201))
    heights[50:61] = 5.0
    depth = terrain_depths(heights, eye=1.5)
    # The horizontal ray meets the face, which rises from z = 49 to z = 50 on the grid of 1 m.
    assert 49 <= depth[40, 60] <= 50
    # Rays above the plateau's near edge, 3.5 m above the eye at 50 m, meet nothing behind it.
    assert np.isinf(depth[: 40 - 8, 60]).all()
    # A ray met in the valley before the hill is as on the plane.
    assert depth[60, 60] == pytest.approx(1.5 / 0.2)
