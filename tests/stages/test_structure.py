"""Structure: texture goes, edges stay."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.structure import edge_preserving, relative_total_variation

BOTH = [relative_total_variation, edge_preserving]


def textured_step(height: int = 48, width: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Two grey halves, and the same with a fine pattern and noise on them."""
    clean = np.full((height, width, 3), 0.3, np.float32)
    clean[:, width // 2 :] = 0.7
    y, x = np.mgrid[:height, :width]
    pattern = 0.06 * ((x + y) % 2 - 0.5) + np.random.default_rng(0).normal(0, 0.02, (height, width))
    return clean, clean + pattern[..., None].astype(np.float32)


@pytest.mark.parametrize("function", BOTH)
def test_texture_goes_and_the_step_stays(function):
    clean, textured = textured_step()
    got = function(textured)
    flat = np.s_[:, 4:24]
    # The domain transform stops a little at every edge, those of texture too.
    left = 0.25 if function is relative_total_variation else 0.7
    assert got[flat].std() < left * textured[flat].std()
    middle = clean.shape[1] // 2
    step = got[:, middle + 3].mean() - got[:, middle - 4].mean()
    assert step == pytest.approx(0.4, rel=0.15)


@pytest.mark.parametrize("function", BOTH)
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 4), (20, 30)])
def test_a_constant_stays(function, shape):
    image = np.full((*shape, 3), 0.4, np.float32)
    np.testing.assert_allclose(function(image), 0.4, atol=1e-6)  # float32


def test_no_smoothness_is_the_image():
    _, image = textured_step()
    np.testing.assert_array_equal(relative_total_variation(image, smoothness=0), image)


def test_a_tighter_tolerance_comes_nearer_to_the_solution():
    _, image = textured_step()
    wanted = relative_total_variation(image, tolerance=1e-7)
    errors = [
        np.sqrt(np.mean((relative_total_variation(image, tolerance=t) - wanted) ** 2)) for t in (1e-2, 1e-3, 1e-4)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[1] < 1e-3


@pytest.mark.parametrize("function", BOTH)
def test_nan_is_refused(function):
    image = np.full((3, 4, 3), 0.5, np.float32)
    image[1, 1, 1] = np.nan
    with pytest.raises(ValueError, match="image is NaN or infinite at 1 of 36"):
        function(image)
