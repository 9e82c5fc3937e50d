"""Depth by a person: layers, receding planes, shading, thin structure (Lopez-Moreno 2008, section 3.4.1)."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Len, Lt

from fogpipe.kernels import layering
from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps
from fogpipe.ports import Image, Mask, RelativeDepth, Unit
from fogpipe.stage import stage
from fogpipe.stages.airlight import LUMINANCE

Share = Annotated[float, Ge(0), Le(1)]
Point = tuple[float, float]
Plane = Literal["close-up", "middle", "background"]
Feather = Annotated[float, Ge(0), Unit("px")]

PLANES: dict[str, float] = {"close-up": 0.1, "middle": 0.5, "background": 1.0}
"""Depths of the three planes of a composition."""


@stage("layers.backdrop")
def backdrop(image: Image, *, depth: Share | Plane = "background") -> RelativeDepth:
    """One depth for the whole picture, to lay nearer things over.

    Parameters
    ----------
    image : (H, W, 3) float. Only its size is used.
    depth : From 0, near, to 1, far, or one of close-up (0.1), middle (0.5) and background (1).

    Returns
    -------
    (H, W) float32.
    """
    require_maps(image=(image, 3))
    return np.full(image.shape[:2], _depth(depth), np.float32)


def _finite_corners(corners: tuple[Point, ...]) -> None:
    if not np.isfinite(corners).all():
        raise ValueError(f"corners must be finite, not {corners}.")


@stage("layers.polygon", requires=_finite_corners)
def polygon(image: Image, *, corners: Annotated[tuple[Point, ...], Len(3)] = ((0, 0), (1, 0), (1, 1), (0, 1))) -> Mask:
    """Region inside a polygon.

    Parameters
    ----------
    image : (H, W, 3) float. Only its size is used.
    corners : (x, y) in shares of the width and the height, from (0, 0), upper left, to (1, 1); beyond is allowed. By
        default the whole picture.

    Returns
    -------
    (H, W) bool, the pixels whose centre is inside. It may be empty.

    Raises
    ------
    ValueError
        If a corner is not finite.
    """
    require_maps(image=(image, 3))
    _finite_corners(corners)
    return layering.polygon(image.shape[:2], corners)


def _no_region(mask: Mask) -> str | None:
    """skipped where the mask is empty"""
    return None if mask.any() else "the mask is empty"


@stage("layers.flat", identity_when=_no_region)
def flat(
    below: RelativeDepth,
    mask: Mask,
    image: Image | None = None,
    *,
    depth: Share | Plane = "middle",
    feather: Feather = 0.0,
) -> RelativeDepth:
    """Lay one depth over what is below.

    Parameters
    ----------
    below : (H, W) float, the depth so far.
    mask : (H, W) bool, the region of the layer.
    image : (H, W, 3) float, optional; the mask follows its edges where there is feather.
    depth : From 0, near, to 1, far, or one of close-up (0.1), middle (0.5) and background (1).
    feather : Standard deviation of the joint bilateral filter that makes the mask soft and lets it follow the edges of
        the image; as wide as the mask is inaccurate. About feather² · 90 ns per pixel around the mask.

    Returns
    -------
    (H, W) float32, or float64 for float64 depth below.

    Raises
    ------
    ValueError
        If there is feather but no image, the image is not finite somewhere, or the sizes differ.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, section 3.4.1.
    """
    return _laid_over(below, np.array(_depth(depth), np.float32), mask, image, feather)


def _plane_recedes(
    near_point: Point, far_point: Point, near: float | str, far: float | str, form: str, nearest: float
) -> None:
    if near_point == far_point:
        raise ValueError(f"a plane needs two points, but near_point and far_point are both {near_point}.")
    if form == "perspective" and nearest == 0 and min(_depth(near), _depth(far)) == 0:
        raise ValueError("a plane in perspective cannot begin at a distance of 0: raise near, far or nearest.")


@stage("layers.plane", identity_when=_no_region, requires=_plane_recedes)
def plane(
    below: RelativeDepth,
    mask: Mask,
    image: Image | None = None,
    *,
    near_point: Point = (0.5, 1.0),
    far_point: Point = (0.5, 0.0),
    near: Share | Plane = 0.0,
    far: Share | Plane = 1.0,
    form: Literal["perspective", "linear"] = "perspective",
    nearest: Annotated[float, Ge(0), Lt(1)] = 0.05,
    feather: Feather = 0.0,
) -> RelativeDepth:
    r"""Lay a plane over what is below: depth along a line from a near to a far point.

    .. math:: \frac1{D(s)} = \frac{1 - s}{D(0)} + \frac{s}{D(1)}, \quad D = r + (1 - r) Z
              \qquad\text{or}\qquad Z(s) = (1 - s)\, Z(0) + s\, Z(1)

    In perspective the inverse of the distance D is linear in the image, as on the ground or along a wall.

    Parameters
    ----------
    below : (H, W) float, the depth so far.
    mask : (H, W) bool, the region of the layer.
    image : (H, W, 3) float, optional; the mask follows its edges where there is feather.
    near_point, far_point : (x, y) in shares of the width and the height. Before and beyond the line, depth stays what
        it is at its ends; across it, depth is the same.
    near, far : Depth at the two points, as numbers or by name.
    form : ``"perspective"`` or ``"linear"``.
    nearest : r, the distance at depth 0 as a share of that at depth 1.
    feather : as in :func:`flat`.

    Returns
    -------
    (H, W) float32, or float64 for float64 depth below.

    Raises
    ------
    ValueError
        As :func:`flat`; if both points are the same; if a plane in perspective begins at a distance of 0.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, section 3.4.1, after Oh et al. 2001, *Image-based modeling and
    photo editing*.
    """
    require_maps(below=(below, 1), mask=(mask, 1))
    _plane_recedes(near_point, far_point, near, far, form, nearest)
    along = layering.along_line(mask.shape, near_point, far_point)
    start, end = _depth(near), _depth(far)
    if form == "linear":
        depth = start + along * np.float32(end - start)
    else:
        first, last = (nearest + (1 - nearest) * depth for depth in (start, end))
        distance = 1 / ((1 - along) / np.float32(first) + along / np.float32(last))
        depth = np.clip((distance - np.float32(nearest)) / np.float32(1 - nearest), 0, 1)
    return _laid_over(below, depth, mask, image, feather)


def _span_rises(span: tuple[float, float]) -> None:
    if not span[0] < span[1]:
        raise ValueError(f"span must go from a lower to a higher quantile, not {span[0]:g} to {span[1]:g}.")


@stage("layers.shading", identity_when=_no_region, requires=_span_rises)
def shading(
    below: RelativeDepth,
    mask: Mask,
    image: Image,
    *,
    near: Share | Plane = 0.0,
    far: Share | Plane = 1.0,
    span: tuple[Share, Share] = (0.02, 0.98),
    smooth: Annotated[float, Ge(0), Le(50), Unit("px")] = 4.0,
    feather: Feather = 0.0,
) -> RelativeDepth:
    """Lay depth from shading over what is below: the brighter, the nearer.

    Parameters
    ----------
    below : (H, W) float, the depth so far.
    mask : (H, W) bool, the region of the layer.
    image : (H, W, 3) float, linear light.
    near, far : Depth of the brightest and of the darkest. With near above far, the darker is the nearer.
    span : Quantiles of the luminance in the region, in f-stops, that are the darkest and the brightest.
    smooth : Standard deviation of the bilateral filter in space; 0 for none.
    feather : as in :func:`flat`.

    Returns
    -------
    (H, W) float32, or float64 for float64 depth below.

    Raises
    ------
    ValueError
        If the image is not finite somewhere, the span is empty, or the sizes differ.

    Notes
    -----
    A region of one luminance lies halfway. The bilateral filter costs about smooth² · 30 ns per pixel.

    Deviates from the source, which compresses the luminance by a sigmoid: here it is counted in f-stops between two
    quantiles, so that exposure does not matter.

    References
    ----------
    Khan 2006, *Image-based material editing*; Lopez-Moreno 2008, *Image-based participating media*, section 3.4.1.
    """
    require_maps(below=(below, 1), mask=(mask, 1), image=(image, 3))
    require_finite(image=image)
    _span_rises(span)
    if _no_region(mask):
        return floats(below)[0].copy()
    level = layering.brightness(image @ np.array(LUMINANCE, image.dtype), mask, span, smooth)
    start, end = _depth(near), _depth(far)
    return _laid_over(below, end + level * np.float32(start - end), mask, image, feather)


@stage("layers.structure", identity_when=_no_region)
def structure(
    below: RelativeDepth,
    mask: Mask,
    image: Image,
    *,
    depth: Share | Plane = "middle",
    width: Annotated[int, Ge(1), Le(100), Unit("px")] = 15,
    contrast: Annotated[float, Gt(0), Le(1)] = 0.5,
) -> RelativeDepth:
    r"""Lay one depth over what is below, where something thin stands out: a lattice, branches, wires.

    .. math:: d = \frac{\sum|I - B|}{\sum(I + B)}, \qquad Z' = Z + s\left(\frac{d}{\max(d_\mathrm{most}, c)}\right)
              (Z_\mathrm{thin} - Z)

    The share s is smooth, 0 up to a tenth and 1 from a half. So what is dark stands out as what is bright does, or has
    another colour, and each line relative to what else there is near it. Draw the region loosely: background in it
    stays what it is below.

    Parameters
    ----------
    below : (H, W) float, Z, the depth so far.
    mask : (H, W) bool, the region of the layer. The layer fades out towards its border, over half of the width.
    image : (H, W, 3) float, I, linear light. The background B is the median of each channel over a square of twice the
        width; sums go over the channels.
    depth : From 0, near, to 1, far, or one of close-up (0.1), middle (0.5) and background (1).
    width : Of the widest part that is to stand out. The most that anything differs, d_most, is looked for as far away.
    contrast : c, from 0 to 1. Where nothing differs by so much, clouds and noise count for less.

    Returns
    -------
    (H, W) float32, or float64 for float64 depth below.

    Raises
    ------
    ValueError
        If the image is not finite somewhere, or the sizes differ.

    Notes
    -----
    Things may fill less than half of any square, or they are taken for background. Where the background has an edge of
    its own, such as that of a cloud, choose a small width.
    About 0.4 µs per pixel around the region, at any width.
    """
    require_maps(below=(below, 1), mask=(mask, 1), image=(image, 3))
    require_finite(image=image)
    (below,) = floats(below)
    share = layering.standing_out(mask, image, width, contrast)
    return below + share * (np.float32(_depth(depth)) - below)


def _depth(depth: float | str) -> float:
    return PLANES[depth] if isinstance(depth, str) else depth


def _laid_over(below: RelativeDepth, depth: FloatArray, mask: Mask, image: Image | None, feather: float) -> FloatArray:
    """The depth where the mask is, what is below elsewhere, and their mean by shares where the mask is soft."""
    require_maps(below=(below, 1), mask=(mask, 1), **({} if image is None else {"image": (image, 3)}))
    (below,) = floats(below)
    if feather == 0:
        return np.where(mask, depth, below).astype(below.dtype)
    if image is None:
        raise ValueError("feathering follows the edges of the image: wire image, or set feather to 0.")
    require_finite(image=image)
    share = layering.soft(mask, image, feather)
    return np.where(share > 0, below + share * (depth - below), below).astype(below.dtype)
