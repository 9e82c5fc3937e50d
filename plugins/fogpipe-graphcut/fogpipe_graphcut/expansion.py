"""α-expansion: one cut after another lets every pixel keep its label or take label α, whichever is best for all."""

from __future__ import annotations

from typing import Annotated

import maxflow  # pyright: ignore[reportMissingImports]
import numpy as np
from annotated_types import Ge, Le
from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.kernels.mrf import SOLVERS, Cost, Field, Solution, energy
from fogpipe.ports import Image
from fogpipe.stage import stage
from fogpipe.stages.haziness import Labelling, Reading, Scale, field_of

BELOW = np.array([[0, 0, 0], [0, 0, 0], [0, 1, 0]])
BESIDE = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0]])


@stage("graphcut.expansion")
def expansion(
    image: Image,
    *,
    labels: Annotated[int, Ge(1), Le(256)] = 32,
    omega: Annotated[float, Ge(0)] = 1.0,
    smoothness: Annotated[float, Ge(0)] = 0.01,
    violation: Annotated[float, Ge(0)] = 100.0,
    edge_weight: Annotated[float, Ge(0)] = 15.0,
    threshold: Annotated[float, Ge(0)] = 15.0,
    scale: Scale = "grey-levels",
    reading: Reading = "vertical-order",
    passes: Annotated[int, Ge(1)] = 5,
) -> Labelling:
    """Pseudo-transmission of one photo, by the energy of ``haziness.mrf`` and the solver of the paper.

    Parameters
    ----------
    image : (H, W, 3) float, the photo or its mean-shift segments, in display values where 1 is white.
    labels, omega, smoothness, violation, edge_weight, threshold, scale, reading : as in ``haziness.mrf``.
    passes : Largest number of rounds over all labels; it ends sooner when a round changes nothing.

    Returns
    -------
    transmission, energy, bound, gap : as from ``haziness.mrf``; the bound is that of the columns alone.

    Raises
    ------
    ValueError
        If a value of the image is not finite.

    Notes
    -----
    Slow: about 0.15 s for each label and round at 640 × 480. Reduce large photos first. One thread.

    References
    ----------
    Guo, Tang, Xiao 2014, *Foggy scene rendering based on transmission map estimation*, pseudocode 1; Boykov, Veksler,
    Zabih 2001, *Fast approximate energy minimization via graph cuts*; Kolmogorov, Zabih 2004, *What energy functions
    can be minimized via graph cuts?*
    """
    require_maps(image=(image, 3))
    (image,) = floats(image)
    field = field_of(image, labels, omega, smoothness, violation, edge_weight, threshold, scale, reading)
    found = expand_all(field, passes)
    transmission = (1 - found.labels / max(1, labels - 1)).astype(image.dtype)
    return Labelling(transmission, *map(np.array, (found.energy, found.bound, found.gap)))


def expand_all(field: Field, passes: int) -> Solution:
    """Expansions of every label in turn, from the labels of the exact columns, until a round changes nothing."""
    best = SOLVERS["columns"](field, 0.0, 1)
    for _ in range(passes):
        before = best.energy
        for alpha in range(field.labels):
            labels = expand(field, best.labels, alpha)
            if (reached := energy(field, labels)) < best.energy:
                best = best._replace(labels=labels, energy=reached)
        if best.energy == before:
            break
    return best


def expand(field: Field, labels: np.ndarray, alpha: int) -> np.ndarray:
    """The labelling of least energy in which each pixel keeps its label or has ``alpha``.

    Exact, since V(a, c) ≤ V(a, b) + V(b, c) for all labels, with the costs of both directions of eq. 5.
    """
    height, width = labels.shape
    graph = maxflow.GraphFloat(height * width, 2 * height * width)
    nodes = graph.add_grid_nodes((height, width))
    here = labels.astype(np.int64)
    keep = np.abs(field.target - here * field.step, dtype=np.float64)
    take = np.abs(field.target - alpha * field.step, dtype=np.float64)
    for first, second, weight, cost, towards in (
        (np.s_[:-1], np.s_[1:], field.down, field.vertical, BELOW),
        (np.s_[:, :-1], np.s_[:, 1:], field.right, field.horizontal, BESIDE),
    ):
        weight = weight[first].astype(np.float64)
        both_keep = weight * _differ(cost, here[first] - here[second])
        second_takes = weight * _differ(cost, here[first] - alpha)
        first_takes = weight * _differ(cost, alpha - here[second])
        # With x = 1 for "takes": E = E₀₀ + (E₁₀ − E₀₀) x₁ − E₁₀ x₂ + (E₀₁ + E₁₀ − E₀₀) (1 − x₁) x₂, and E₁₁ = 0.
        take[first] += first_takes - both_keep
        take[second] -= first_takes
        capacity = np.zeros((height, width))
        capacity[first] = np.maximum(second_takes + first_takes - both_keep, 0)  # below 0 only by rounding
        graph.add_grid_edges(nodes, weights=capacity, structure=towards, symmetric=False)
    graph.add_grid_tedges(nodes, take, keep)
    graph.maxflow()
    return np.where(graph.get_grid_segments(nodes), np.uint8(alpha), labels)


def _differ(cost: Cost, fallen: np.ndarray) -> np.ndarray:
    return np.where(fallen >= 0, cost.fall * fallen, cost.jump - cost.rise * fallen)
