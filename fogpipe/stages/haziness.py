"""Haziness of one photo, as the labels of a Markov random field (Guo 2014)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps
from fogpipe.ports import Image, Number, Transmission, Unit
from fogpipe.stage import stage

if TYPE_CHECKING:
    from fogpipe.kernels.mrf import Field

GREY = (0.299, 0.587, 0.114)
"""Weights of display red, green and blue in grey: ITU-R BT.601, those of Matlab's ``rgb2gray``."""

Reading = Literal["vertical-order", "all-edges", "site-order"]
Scale = Literal["grey-levels", "unit"]


class Labelling(NamedTuple):
    """The transmission that the labels stand for, and how good the labelling is."""

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
    scale: Scale = "grey-levels",
    reading: Reading = "vertical-order",
    solver: Literal["chains", "columns", "trws", "icm"] = "chains",
    target_gap: Annotated[float, Ge(0)] = 1e-3,
    passes: Annotated[int, Ge(1)] = 6,
    cap: Annotated[float, Gt(0), Unit("MP")] = 0.5,
) -> Labelling:
    r"""Pseudo-transmission of one photo, from the labels of least energy of a Markov random field.

    .. math:: E(x) = \sum_i |\omega g_i - h(x_i)| + \sum_{(i, j)} w_{ij} V(x_i, x_j), \qquad
              V(x_i, x_j) = \begin{cases} s & x_i < x_j \\ g\, (x_i - x_j) & x_i \ge x_j \end{cases}

    The label x of 0 … l is the haziness h = x / l, and the transmission is 1 − h: bright pixels are taken for hazy,
    so far, ones, and a pixel (i) is to be at least as hazy as the one below it (j). What comes out follows the
    brightness of the photo; as a depth map it can be poor however low its energy is.

    Parameters
    ----------
    image : (H, W, 3) float, the photo or its mean-shift segments, in display values where 1 is white.
    labels : l + 1, the number of labels. One label is the transmission 1 everywhere.
    omega : ω, by which the grey value is multiplied.
    smoothness : g, the cost of a difference of one label. With another number of labels, g (l + 1) / 32 or so keeps the
        smoothness.
    violation : s, the cost of a pixel that is less hazy than the one below it.
    edge_weight : w of an edge between similar greys; every other edge has 1.
    threshold : Greys are similar if they differ by less than this many of 255 grey levels.
    scale : ``grey-levels`` has gᵢ and h in 0 … 255, as the pseudocode of the paper, to which its g, s and edge weight
        belong; ``unit`` has them in 0 … 1, as its eq. 3.
    reading : ``vertical-order`` asks for the order on vertical edges only, since the paper argues with "directly
        above"; horizontal ones cost g |xᵢ − xⱼ|. ``all-edges`` uses V for both, with the left pixel as i, as the
        library that the paper used does with its table of costs. ``site-order`` has the edges of the printed pseudocode
        only, from each pixel to the one below and only between similar greys: a set of independent chains.
    solver : ``chains``, dual ascent over columns and rows; ``columns``, each column exactly and without its
        neighbours; ``trws``, Kolmogorov's tree-reweighted messages; ``icm``, iterated conditional modes.
        α-expansion, the paper's own, is in the package fogpipe-graphcut.
    target_gap : Certified gap at which a solver stops.
    passes : Largest number of passes of an iterating solver.
    cap : Largest size at which the field is solved, megapixels. A larger photo is reduced to it by area averages, and
        the transmission is brought back by a guided filter, whose guide is the photo.

    Returns
    -------
    transmission : (H, W) float32, or float64 for a float64 image, in [0, 1]: 1 − h, one of ``labels`` values, or in
        between where the photo is above the cap.
    energy : E of the labels, in units of ``scale``, at the size at which the field was solved.
    bound : A number that E is proven not to fall below, whatever the labels, up to the rounding of float64.
    gap : (energy − bound) / energy, 0 where the energy is 0: how far from the least energy it may be.

    Raises
    ------
    ValueError
        If a value of the image is not finite.

    Notes
    -----
    Deviates from the paper: eq. 3 to 6 disagree about whether a high label is much transmission or little; here it is
    little, so that the order of eq. 5 and the sign of eq. 6 both hold. Eq. 6 as printed ends at 7/255, not at 0.

    Costs in O(pixels × labels) time per pass, and memory for ``chains``: two numbers per pixel and label, 79 MB at
    640 × 480 with 32 labels, and about 30 MB more. The labels are the same to the bit for any number of threads.
    Messages are computed in the precision of the image, energy and bound in float64.

    References
    ----------
    Guo, Tang, Xiao 2014, *Foggy scene rendering based on transmission map estimation*, eq. 2–6 and pseudocode 1.
    Shekhovtsov, Reinbacher, Graber, Pock 2016, *Solving dense image matching in real-time using discrete-continuous
    optimization* (dual minorise-maximise).
    Kolmogorov 2006, *Convergent tree-reweighted message passing for energy minimization*.
    He, Sun 2015, *Fast guided filter*.
    """
    from fogpipe.kernels.mrf import SOLVERS

    require_maps(image=(image, 3))
    (image,) = floats(image)
    small = _reduced(image, cap * 1e6)
    field = field_of(small, labels, omega, smoothness, violation, edge_weight, threshold, scale, reading)
    found = SOLVERS[solver](field, target_gap, passes)
    transmission = (1 - found.labels / max(1, labels - 1)).astype(image.dtype)
    if small is not image:
        transmission = _enlarged(transmission, image)
    return Labelling(transmission, *map(np.array, (found.energy, found.bound, found.gap)))


def field_of(
    image: FloatArray,
    labels: int,
    omega: float,
    smoothness: float,
    violation: float,
    edge_weight: float,
    threshold: float,
    scale: Scale,
    reading: Reading,
) -> Field:
    """The field of an image; parameters as in :func:`mrf`.

    Raises
    ------
    ValueError
        If a value of the image is not finite.
    """
    from fogpipe.kernels.mrf import Cost, Field

    require_finite(image=image)
    grey = image @ np.array(GREY, image.dtype)
    top = 255.0 if scale == "grey-levels" else 1.0
    others = 0.0 if reading == "site-order" else 1.0
    down, right = np.zeros_like(grey), np.zeros_like(grey)
    down[:-1] = np.where(np.abs(np.diff(grey, axis=0)) * 255 < threshold, edge_weight, others)
    if reading != "site-order":
        right[:, :-1] = np.where(np.abs(np.diff(grey, axis=1)) * 255 < threshold, edge_weight, others)
    g, s = float(smoothness), float(violation)  # whole numbers would have the kernels compiled once more
    ordered, even = Cost(g, 0.0, s), Cost(g, g, 0.0)
    target, step = grey * grey.dtype.type(omega * top), top / max(1, labels - 1)
    return Field(target, down, right, step, labels, ordered, ordered if reading == "all-edges" else even)


def _reduced(image: FloatArray, pixels: float) -> FloatArray:
    """The image itself, or area averages of it with at most so many pixels."""
    import cv2

    height, width = image.shape[:2]
    if height * width <= pixels:
        return image
    ratio = math.sqrt(pixels / (height * width))
    size = max(1, math.floor(width * ratio)), max(1, math.floor(height * ratio))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), image.dtype)


def _enlarged(transmission: FloatArray, image: FloatArray) -> FloatArray:
    """The map at the size of the image, with its edges where those of the image are (He & Sun 2015)."""
    import cv2

    height, width = image.shape[:2]
    coarse = cv2.resize(transmission.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    cell = max(height / transmission.shape[0], width / transmission.shape[1])
    guide = np.clip(image, 0, 1).astype(np.float32)
    # The radius counts cells, since the filter works on a grid of them. A variance of (0.01 of white)² is no edge.
    smooth = cv2.ximgproc.guidedFilter(guide, coarse, 2, 1e-4, scale=1 / cell)
    return np.clip(smooth, 0, 1).astype(image.dtype)
