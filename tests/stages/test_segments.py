"""Mean-shift segments at a reduced size."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.segments import mean_shift


def patches(rows: int, columns: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Two noisy surfaces with a slanted border between them; the colours without noise."""
    y, x = np.mgrid[:rows, :columns]
    clean = np.where((x > columns / 2 + (y - rows / 2) / 3)[..., None], (0.7, 0.6, 0.5), (0.2, 0.3, 0.4))
    noisy = clean + noise * np.random.default_rng(1).standard_normal(clean.shape)
    return np.clip(noisy, 0, 1).astype(np.float32), clean


def test_surfaces_become_flat_and_their_border_stays():
    noisy, clean = patches(120, 160, 0.03)
    segments = mean_shift(noisy, cap=1)
    # The noise of 0.03 is averaged over a hundred pixels and more; levels are 0.004 apart.
    assert np.abs(segments - clean).mean() < 0.01


def test_a_capped_size_keeps_the_border_where_it_is():
    noisy, clean = patches(240, 320, 0.03)
    nearer_to = np.abs(mean_shift(noisy, cap=0.01) - (0.7, 0.6, 0.5)).sum(axis=2) < 0.5
    # Each pixel takes the mode of its own colour, so no block of the coarse grid (2.8 pixels) shows.
    assert np.mean(nearer_to == (clean[..., 0] > 0.5)) > 0.999


def test_the_cap_costs_little():
    import skimage.data

    photo = (skimage.data.rocket() / np.float32(255)).astype(np.float32)
    difference = mean_shift(photo) - mean_shift(photo, cap=1)
    assert np.sqrt(np.mean(difference**2)) < 0.05  # measured 0.03: thin masts, lamps


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_image_that_is_not_finite_is_refused(value: float):
    with pytest.raises(ValueError, match="NaN or infinite"):
        mean_shift(np.full((4, 4, 3), value, np.float32))


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 300, 3), (300, 1, 3), (2, 2, 3)])
def test_thin_images(shape):
    image = np.random.default_rng(4).random(shape)
    segments = mean_shift(image, cap=1e-4)
    assert segments.shape == shape
    assert 0 <= segments.min() <= segments.max() <= 1
