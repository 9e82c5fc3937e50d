"""How well one map orders the pixels as another does."""

from __future__ import annotations

import numpy as np


def spearman(first: np.ndarray, second: np.ndarray) -> float:
    """Rank correlation with mean ranks for ties; NaN where one of the two is constant. O(n log n)."""
    from scipy.stats import rankdata

    ranks = [rankdata(values) for values in (first, second)]
    centred = [rank - rank.mean() for rank in ranks]
    scale = np.sqrt(np.prod([rank @ rank for rank in centred]))
    return float(centred[0] @ centred[1] / scale) if scale > 0 else np.nan


def pairwise(truth: np.ndarray, guess: np.ndarray, ratio: float, pairs: int, rng: np.random.Generator) -> float:
    """Share of pairs drawn at random, with true values more than ``ratio`` apart, that are in the true order.

    A pair with equal guesses counts half. NaN where no pair is that far apart.
    """
    one, other = rng.integers(0, truth.size, (2, pairs))
    near, far = np.minimum(truth[one], truth[other]), np.maximum(truth[one], truth[other])
    apart = far > ratio * near
    order = np.sign((guess[one] > guess[other]).astype(np.int8) - (guess[one] < guess[other]).astype(np.int8))
    right = order * np.where(truth[one] > truth[other], 1, -1)
    return float((1 + right[apart]).mean() / 2) if apart.any() else np.nan
