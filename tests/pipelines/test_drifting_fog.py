"""Fog that drifts: the same fog at every moment and from every place, and never a flicker."""

from __future__ import annotations

import numpy as np
import pytest

import fogpipe
from fogpipe.io.scenes import open_scene


@pytest.fixture(scope="module")
def street() -> dict[str, np.ndarray]:
    return open_scene("sample:outdoor:3:160x120").load("linear", ["image", "range_map", "camera"]).values


def density(street: dict[str, np.ndarray], seed: int = 7, **settings: object) -> np.ndarray:
    chosen = {f"density.{name}": value for name, value in settings.items()}
    return fogpipe.load("drifting-fog", set=chosen, seed=seed).run(to=["density"], **street)["density"]


def test_a_moment_later_the_fog_is_nearly_the_same_and_later_it_is_another(street):
    now, next_frame, later, other = (density(street, time=t) for t in (0.0, 0.1, 60.0, 3600.0))
    change = np.sqrt(np.mean((next_frame - now) ** 2))
    # In 0.1 s the wind of 2.2 m/s carries it 0.22 m, a fraction of the finest cells of 30/8 m.
    assert 0 < change < 0.1 * np.sqrt(np.mean((later - now) ** 2))
    assert np.abs(other - later).max() > 0.05


def test_who_drifts_with_the_fog_sees_it_stand_still(street):
    drifted = [[1.0, 0.0, 0.0, 20.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 10.0]]  # 10 s of the wind (2, 0, 1) m/s
    # Single precision at 150 m in cells of 4 m: 1e-5 of a cell, and steep noise makes some 1e-4 of it.
    np.testing.assert_allclose(density(street, time=10.0, pose=drifted), density(street, time=0.0), atol=1e-3)


def test_a_seed_is_a_fog(street):
    assert np.abs(density(street, seed=1) - density(street, seed=2)).max() > 0.1


def test_every_frame_of_a_still_camera_differs_by_the_fog_alone(street):
    pipeline = fogpipe.load("drifting-fog", set={"density.contrast": 0.0})
    moved = fogpipe.load("drifting-fog", set={"density.contrast": 0.0, "density.time": 5.0})
    np.testing.assert_array_equal(pipeline.run(**street)["foggy"], moved.run(**street)["foggy"])
