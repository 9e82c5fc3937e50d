"""The share of the scene in a pixel at the edge of the sky, from its colour."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels.sky_colour import share_of_scene

LEAF, BLUE = np.float32([0.05, 0.1, 0.02]), np.float32([0.2, 0.35, 0.7])


def edge(shares: list[float]) -> tuple[np.ndarray, dict]:
    """Rows of leaf below, of sky above, and between them rows in which leaf and sky are mixed."""
    share = np.concatenate([np.zeros(20), shares[::-1], np.ones(20)]).astype(np.float32)
    image = np.repeat((share[:, None] * LEAF + (1 - share[:, None]) * BLUE)[:, None], 9, axis=1)
    row = np.broadcast_to(np.arange(len(share))[:, None], image.shape[:2])
    scene = row >= 20 + len(shares)
    margin = (row >= 20) & ~scene
    distance = (20 + len(shares) - row).astype(np.float32)
    return image, {"margin": margin, "scene": scene, "sky": row < 20, "distance": distance, "width": len(shares)}


@pytest.mark.parametrize("exposure", [1e-3, 1.0, 1e3])
def test_a_mixture_is_told_apart_at_any_exposure(exposure: float):
    shares = [1.0, 0.6, 0.25, 0.0]
    image, masks = edge(shares)
    found = share_of_scene(image * np.float32(exposure), **masks).reshape(4, 9)
    # The distance counts for a thousandth of the squared levels, here 2e-3 of the squared contrast.
    np.testing.assert_allclose(found, np.repeat(np.array(shares[::-1])[:, None], 9, axis=1), atol=3e-3)


def test_without_contrast_the_share_falls_with_the_distance():
    image, masks = edge([1.0, 0.6, 0.25, 0.0])
    image[:] = BLUE
    found = share_of_scene(image, **masks).reshape(4, 9)[::-1, 0]
    np.testing.assert_allclose(found, [0.8, 0.6, 0.4, 0.2], atol=1e-5)  # float32


def test_a_sky_that_is_near_is_known_in_a_gap_and_one_that_is_far_is_not():
    image, masks = edge([0.0] * 60)
    masks["width"] = 1.0  # sky is near within 16 px
    found = share_of_scene(image, **masks).reshape(60, 9)[:, 0]
    assert found[:15].max() < 3e-3
    assert (found[17:] == 1).all()


def test_a_sky_of_many_colours_tells_nothing():
    image, masks = edge([0.0] * 4)
    sky = masks["sky"]
    image[sky] = np.random.default_rng(0).random((np.count_nonzero(sky), 3), np.float32)
    found = share_of_scene(image, **masks).reshape(4, 9)[::-1].mean(axis=1)
    assert (np.diff(found) < 0).all()  # by the distance
    assert found.min() > 0.1


def test_a_picture_that_is_not_finite_is_refused():
    image, masks = edge([0.5])
    image[0, 0] = np.nan
    with pytest.raises(ValueError, match="image is NaN"):
        share_of_scene(image, **masks)


def test_a_lamp_and_a_sun_tell_nothing():
    image, masks = edge([1.0, 0.6, 0.25, 0.0])
    image[26, 4], image[10, 4] = 1e4, 1e5
    found = share_of_scene(image, **masks).reshape(4, 9)[:, 0]
    # The lamp is one of 20 to 40 pixels of the scene, and counts as twice the sky: it moves their mean by a tenth.
    np.testing.assert_allclose(found, [0.0, 0.25, 0.6, 1.0], atol=0.15)
