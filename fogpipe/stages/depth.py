"""Depth of a photograph without any: a guess from its rows, lines, sky and objects, and how good the guess is."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps
from fogpipe.ports import Image, Mask, Number, Range, RelativeDepth, Transmission, Unit
from fogpipe.stage import stage

SOLVED_AT = 240
"""Longer side at which cues are found, pixels."""

CERTAIN_SKY = 0.6
"""Likelihood from which a pixel counts as sky altogether."""
LOWEST_SKY = 0.93
"""How low sky may reach where there is no vanishing point, as a share of the height."""


class PhotoDepth(NamedTuple):
    """Depth that a photograph suggests, and the part of it that is sky."""

    depth: RelativeDepth
    sky: Mask


class Agreement(NamedTuple):
    """How well a depth map orders the pixels as the true range does."""

    spearman: Number
    pairwise: Number


@stage("depth.from_photo")
def from_photo(
    image: Image,
    *,
    encoding: Literal["display", "linear"] = "display",
    walls: tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)]] = (8.0, 1.75),
    ceiling: Annotated[float, Gt(0)] = 4.0,
    prominence: Annotated[float, Ge(0)] = 0.6,
    detail: Annotated[float, Gt(0), Le(1)] = 0.02,
    edge: Annotated[float, Gt(0)] = 0.03,
    cap: Annotated[float, Gt(0), Unit("MP")] = 0.5,
) -> PhotoDepth:
    r"""Relative depth of one photograph, from its vanishing point, its sky and what stands out in it.

    Where slanted lines meet in a point (x₀, y₀), the scene is a box seen along its axis: ground, ceiling and two
    walls, whose inverse depth grows linearly from 0 at that point,

    .. math:: n_\mathrm{box} = \frac{1}{1 - y_0}
              \max\!\Big(y - y_0,\; \frac{y_0 - y}{c},\; \frac{|x - x_0|}{w}\Big).

    Where they do not, the row is the prior, lower is nearer, and objects that stand out from the edge of the image
    are nearer than what is behind them, :math:`n_\mathrm{row} \propto y + p\,o`. Where sky spans the upper edge, it
    ends at a horizon :math:`y_1`, and the ground is :math:`n_\mathrm{row} \propto (y - y_1)(1 + p\,o)`; what hides the
    sky is an object c camera heights tall, all of it at the range at which that looks as long. The confidence γ in the
    vanishing point mixes the two, and sky, of likelihood s, is far:
    :math:`d = 1 - (1 - s)(\gamma n_\mathrm{box} + (1 - \gamma) n_\mathrm{row})`. A guided
    filter brings the edges of the depth to those of the photo.

    Parameters
    ----------
    image : (H, W, 3) float. Values outside [0, 1] count as the nearest bound.
    encoding : What the numbers mean: ``"display"`` values as in an sRGB file, or ``"linear"`` light, as in a
        pipeline with ``color: linear``.
    walls : w, distance of the side walls from the line of sight in camera heights: with sky above the vanishing
        point (a road), and without (a corridor).
    ceiling : c, the height to which objects beside the road and before the sky reach above the camera, in camera
        heights.
    prominence : p, weight of the objects against the row.
    detail : Radius of the guided filter, as a share of the longer side.
    edge : Contrast in display values of an edge that the depth follows.
    cap : Size at which the guided filter is solved, megapixels; its solution is applied to the full photo.

    Returns
    -------
    depth : (H, W) float32, or float64 for a float64 image, 0 near to 1 far, sky 1. One minus a relative inverse depth;
        :func:`to_range` makes metres of it.
    sky : (H, W) bool.

    Raises
    ------
    ValueError
        If the image holds NaN or infinity.

    Notes
    -----
    Cues are found on at most 240 pixels a side; only edges are sought on all pixels: in all about 0.2 µs and 90 B
    per pixel, and 0.1 s for the cues. No learning is involved: people, animals and furniture have the depth of their
    row, and what the photo leaves open (a wall of one colour from the upper edge down) may be taken for sky. For a
    learned depth see the plugin pack ``fogpipe-onnx``.

    Deviates from the paper, whose depth is the grey value (``haziness.mrf``): bright is not far.

    References
    ----------
    Guo, Tang and Xiao 2014, section 4.2, for the prior of the row; Wei, Wen, Zhu and Sun 2012, *Geodesic saliency
    using background priors*; He, Sun and Tang 2013, *Guided image filtering*.
    """
    import cv2

    from fogpipe.kernels.photo import cues, horizon, vanishing

    display = _display_values(image, encoding)
    rows, columns = display.shape[:2]
    levels = np.rint(cv2.cvtColor(display, cv2.COLOR_RGB2GRAY) * 255).astype(np.uint8)
    point = vanishing.vanishing_point(levels)
    colour = cues.lab(cues.reduced(display, SOLVED_AT))
    flat = cues.smoothed(colour)
    lowest = point.confidence * (point.y + 0.03) + (1 - point.confidence) * LOWEST_SKY
    sky = cues.sky_likelihood(colour, flat, lowest)
    openness = max(_openness(sky, point), horizon.horizon_of(sky).confidence)
    sky *= 1 - point.confidence * (1 - openness)
    sky *= cues.trust(sky, colour, point.confidence * _openness(sky, point))
    width = walls[0] ** openness * walls[1] ** (1 - openness)
    box = vanishing.box_nearness(sky.shape, point, width, ceiling)
    objects = cues.prominence(flat)
    standing = _unit(_row_nearness(*sky.shape) + np.float32(prominence) * objects)
    matte = cues.sky_matte(display, np.minimum(sky / np.float32(CERTAIN_SKY), 1))
    level = horizon.horizon_of(sky)
    hidden = cues.hiding_sky(matte, sky.shape)
    standing += level.confidence * (horizon.ground_nearness(hidden, level, objects, prominence, ceiling) - standing)
    nearness = cv2.resize(point.confidence * box + (1 - point.confidence) * standing, (columns, rows))
    radius = max(1, round(detail * max(rows, columns)))
    scale = min(1.0, (cap * 1e6 / (rows * columns)) ** 0.5)
    nearness = np.clip(cv2.ximgproc.guidedFilter(display, nearness, radius, edge**2, scale=scale), 0, 1)
    return PhotoDepth((1 - (1 - matte) * nearness).astype(np.result_type(image, np.float32)), matte > 0.5)


@stage("depth.row_prior")
def row_prior(image: Image, *, horizon: Annotated[float, Ge(0), Le(1)] = 0.0) -> RelativeDepth:
    """Relative depth from the row alone: what is higher in the image is farther.

    Parameters
    ----------
    image : (H, W, 3) float; only its size counts.
    horizon : Row of the horizon as a share of the height; what is above it is far.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image: 0 at the lower edge, 1 from the horizon up. One minus the inverse
    depth of a plane ground.

    References
    ----------
    Guo, Tang and Xiao 2014, *Foggy scene rendering based on transmission map estimation*, section 4.2.2.
    """
    require_maps(image=(image, 3))
    y = 1 - _row_nearness(*image.shape[:2]).astype(np.result_type(image, np.float32))
    return np.minimum(y / (1 - horizon), 1) if horizon < 1 else np.ones_like(y)


@stage("depth.from_transmission")
def from_transmission(transmission: Transmission, *, least: Annotated[float, Gt(0), Le(1)] = 0.01) -> RelativeDepth:
    """Relative depth from a transmission, d = ln t / ln t_least.

    Parameters
    ----------
    transmission : (H, W) float, t in [0, 1]. NaN where unknown.
    least : Transmission, at and below which a point counts as farthest.

    Returns
    -------
    (H, W) float32, or float64 for float64 transmission, 0 near to 1 far. Unknown stays NaN.

    References
    ----------
    Guo, Tang and Xiao 2014, eq. 9, solved for β d.
    """
    require_maps(transmission=(transmission, 1))
    (t,) = floats(transmission)
    if least == 1:
        return np.where(np.isnan(t), t, 1 - (t == 1))
    return np.clip(np.log(np.maximum(t, t.dtype.type(least))) / t.dtype.type(math.log(least)), 0, 1)


@stage("depth.to_range")
def to_range(
    depth: RelativeDepth,
    *,
    near: Annotated[float, Gt(0), Unit("m")] = 4.0,
    far: Annotated[float, Gt(0), Unit("m")] = 500.0,
    law: Literal["inverse", "linear", "logarithmic"] = "inverse",
) -> Range:
    r"""Range in metres from a relative depth, by the ranges that 0 and 1 stand for.

    Parameters
    ----------
    depth : (H, W) float, d from 0 near to 1 far. NaN where unknown.
    near : R₀, range at d = 0. A camera at eye height sees the ground at the lower edge of the image at about 4 m.
    far : R₁, range at d = 1.
    law : What d is proportional to: ``"inverse"``, :math:`1/R = (1 - d)/R_0 + d/R_1`, for a depth from perspective or
        disparity (:func:`from_photo`); ``"linear"``, :math:`R = (1 - d) R_0 + d R_1`, for one from a transmission;
        ``"logarithmic"``, :math:`R = R_0^{1-d} R_1^d`.

    Returns
    -------
    (H, W) float32, or float64 for float64 depth, metres. Unknown stays NaN.

    Raises
    ------
    ValueError
        If ``far`` is not beyond ``near``.
    """
    if not near < far < math.inf:
        raise ValueError(f"far ({far:g} m) must be finite and beyond near ({near:g} m).")
    require_maps(depth=(depth, 1))
    (d,) = floats(depth)
    if law == "linear":
        return near + d * d.dtype.type(far - near)
    if law == "logarithmic":
        return near * np.exp(d * d.dtype.type(math.log(far / near)))
    return 1 / (1 / near + d * d.dtype.type(1 / far - 1 / near))


@stage("depth.agreement")
def agreement(
    range_map: Range,
    depth: RelativeDepth,
    *,
    rng: np.random.Generator,
    ratio: Annotated[float, Ge(1)] = 1.1,
    pairs: Annotated[int, Ge(1)] = 200_000,
) -> Agreement:
    """How well a guessed depth orders the pixels as the true range does.

    Parameters
    ----------
    range_map : (H, W) float, true range. Unknown pixels (NaN) do not count; sky (+inf) is farther than all else.
    depth : (H, W) float, guessed, in any unit that grows with distance. NaN does not count.
    rng : Draws the pairs.
    ratio : Pairs count whose true ranges differ by more than this factor.
    pairs : Pairs that are drawn.

    Returns
    -------
    spearman : Rank correlation, −1 to 1; 1 is the true order. NaN where one of the two is constant.
    pairwise : Share of the pairs in the true order, 0 to 1; chance, and a constant depth, have 0.5. NaN where no pair
        differs by the ratio.

    Notes
    -----
    Two sorts, 0.3 µs per pixel. The standard error of ``pairwise`` is at most 0.5/√pairs, 0.001.
    """
    from fogpipe.kernels.photo import agreement as score

    require_maps(range_map=(range_map, 1), depth=(depth, 1))
    known = ~(np.isnan(range_map) | np.isnan(depth))
    truth, guess = range_map[known].astype(np.float64), depth[known].astype(np.float64)
    if not truth.size:
        return Agreement(np.array(np.nan), np.array(np.nan))
    return Agreement(np.array(score.spearman(truth, guess)), np.array(score.pairwise(truth, guess, ratio, pairs, rng)))


def _display_values(image: Image, encoding: str) -> FloatArray:
    """(H, W, 3) float32 display values in [0, 1]."""
    require_maps(image=(image, 3))
    require_finite(image=image)
    if encoding == "linear":
        from fogpipe.kernels.srgb import srgb_from_linear

        image = srgb_from_linear(np.clip(image, 0, 1))
    return np.ascontiguousarray(np.clip(image, 0, 1), np.float32)


def _openness(sky: FloatArray, point: tuple[float, float, float]) -> float:
    """Whether there is sky above the vanishing point, 0 to 1."""
    rows, columns = sky.shape
    above = slice(max(0, int((point[1] - 0.3) * rows)), max(1, int((point[1] - 0.1) * rows)))
    beside = slice(max(0, int((point[0] - 0.1) * columns)), max(1, math.ceil((point[0] + 0.1) * columns)))
    return float(np.clip((sky[above, beside].mean() - 0.2) / 0.4, 0, 1))


def _row_nearness(rows: int, columns: int) -> FloatArray:
    """0 at the upper edge of the image, 1 at the lower one."""
    y = (np.arange(rows, dtype=np.float32) + np.float32(0.5)) / rows
    return np.repeat(y[:, None], columns, axis=1)


def _unit(values: FloatArray) -> FloatArray:
    """Scaled to [0, 1]."""
    least, most = values.min(), values.max()
    return (values - least) / (most - least) if most > least else np.zeros_like(values)
