"""Haziness of a photo without depth, as labels of a Markov random field (Guo 2014)."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, require_maps
from fogpipe.ports import Image, Number, Transmission, Unit
from fogpipe.stage import stage

GREY = (0.299, 0.587, 0.114)
"""Weights of display red, green and blue in grey (ITU-R BT.601, which the paper's Matlab uses)."""

Reading = Literal["vertical-order", "all-edges", "site-order"]
Solver = Literal["columns"]


class Labelling(NamedTuple):
    """The transmission of the labels, and how good the labelling is."""

    transmission: Transmission
    energy: Number
    bound: Number
    gap: Number


@stage("haziness.mrf")
def mrf(
    image: Image,
    *,
    labels: Annotated[int, Ge(1), Le(256)] = 32,
    omega: Annotated[float, Ge(0)] = 1.0,
    smoothness: Annotated[float, Ge(0)] = 0.01,
    violation: Annotated[float, Ge(0)] = 100.0,
    edge_weight: Annotated[float, Ge(0)] = 15.0,
    threshold: Annotated[float, Ge(0)] = 15.0,
    scale: Literal["grey-levels", "unit"] = "grey-levels",
    reading: Reading = "vertical-order",
    solver: Solver = "columns",
    target_gap: Annotated[float, Ge(0)] = 1e-3,
    cap: Annotated[float, Gt(0), Unit("MP")] = 0.5,
) -> Labelling:
    r"""Transmission of one photo from the labels of least energy of a Markov random field.

    .. math:: E(x) = \sum_i |\omega\, g_i - h(x_i)| + \sum_{i, j} w_{ij} V(x_i, x_j), \qquad
              V(x_i, x_j) = \begin{cases} s & x_i < x_j \\ g\, |x_i - x_j| & \text{otherwise} \end{cases}

    Parameters
    ----------
    image : (H, W, 3) float, display values in [0, 1]; the photo, or its mean-shift segments.
    labels : Number of labels; label x of l + 1 is the haziness h = x / l.
    omega : ω, the factor of the grey value.
    smoothness : g, cost of a difference of one label.
    violation : s, cost of a pixel less hazy than the one below it.
    edge_weight : Weight of an edge between similar greys; others weigh 1.
    threshold : Greys that differ by less are similar, in grey levels of 255.
    scale : Units of the data cost: ``grey-levels`` 0 to 255, as the paper's pseudocode has it, or ``unit`` 0 to 1.
    reading : Which edges there are and which of them keep the order.
    solver : How the labels are found.
    target_gap : Certified gap at which the solver may stop.
    cap : Size at which the field is solved, megapixels. A larger photo is reduced to it.

    Returns
    -------
    transmission : (H, W) float, 1 − h (eq. 6), a pseudo-transmission: bright is far.
    energy, bound, gap : The energy, a lower bound of it, and their difference as a share of the energy.

    Raises
    ------
    ValueError
        If the image holds NaN or infinity.
    """
    from fogpipe.kernels.mrf import SOLVERS, Cost, Field

    require_maps(image=(image, 3))
    (image,) = floats(image)
    if not np.isfinite(image).all():
        raise ValueError("image holds NaN or infinite values; fill them first.")
    grey = image @ np.array(GREY, image.dtype) * image.dtype.type(255)
    down, right = np.zeros_like(grey), np.zeros_like(grey)
    down[:-1] = np.where(np.abs(np.diff(grey, axis=0)) < threshold, edge_weight, 1)
    right[:, :-1] = np.where(np.abs(np.diff(grey, axis=1)) < threshold, edge_weight, 1)
    top = 255.0 if scale == "grey-levels" else 1.0
    ordered = Cost(smoothness, 0.0, violation)
    field = Field(
        grey * grey.dtype.type(omega * top / 255),
        down,
        right,
        top / max(1, labels - 1),
        labels,
        ordered,
        Cost(smoothness, smoothness, 0.0),
    )
    found = SOLVERS[solver](field)
    transmission = (1 - found.labels / max(1, labels - 1)).astype(image.dtype)
    return Labelling(transmission, *map(np.array, (found.energy, found.bound, found.gap)))
