"""Scenes that the tests of several stages share."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="session")
def motorcycle() -> tuple[np.ndarray, np.ndarray]:
    """Middlebury 2014 Motorcycle as scikit-image ships it: display values in [0, 1]; range (m), NaN if unknown."""
    import skimage.data

    left, _, disparity = skimage.data.stereo_motorcycle()
    disparity = np.where(np.isfinite(disparity), disparity, np.nan)
    depth = 0.193001 * 994.978 / (disparity + 31.086)  # baseline (m), focal length (px), offset of the centres (px)
    return (left / 255).astype(np.float32), depth.astype(np.float32)
