from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture
def image() -> np.ndarray:
    """Noise of 8 bits: its contrast shows how much fog there is."""
    return np.random.default_rng(1).integers(0, 256, (48, 64, 3), dtype=np.uint8)


@pytest.fixture
def range_map() -> np.ndarray:
    """From 2 m at the left to 200 m at the right."""
    return np.tile(np.linspace(2, 200, 64, dtype=np.float32), (48, 1))
