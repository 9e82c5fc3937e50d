"""Range: the distance from the camera to what a pixel shows, along the ray of that pixel."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels import regions
from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.ports import Camera, Depth, Image, Length, Mask, Range, RelativeDepth, Unit
from fogpipe.stage import stage


@stage("range.from_depth")
def from_depth(depth: Depth, camera: Camera) -> Range:
    """Range of each pixel from its planar depth, by the length of its ray.

    Parameters
    ----------
    depth : (H, W) float, metres along the optical axis. NaN where unknown, +inf for sky.
    camera : (3, 3) float, intrinsic matrix in pixels; the centre of the first pixel is (0, 0).

    Returns
    -------
    (H, W) float32, or float64 for float64 depth, metres. NaN and +inf stay.
    """
    from fogpipe.kernels.rays import planar_to_radial

    return planar_to_radial(depth, camera)


@stage("range.farthest")
def farthest(range_map: Range, *, percentile: Annotated[float, Gt(0), Le(100)] = 100.0) -> Length:
    """Largest measured range of the scene, the Rmax of Hansard 2019.

    Parameters
    ----------
    range_map : (H, W) float, metres. Unknown (NaN) and sky (+inf) do not count.
    percentile : Share of the measured pixels, in percent, that lie no farther. Below 100 a few stray far
        returns do not decide; the paper takes 100.

    Returns
    -------
    One number, metres; NaN when nothing is measured.

    Notes
    -----
    One pass at the speed of memory at 100, about 3 ns per pixel below.
    """
    # fmax ignores NaN, so most scenes need no copy of the measured pixels.
    largest = np.fmax.reduce(range_map, axis=None)
    if percentile == 100 and np.isfinite(largest):
        return np.array(largest, np.float64)
    measured = range_map[np.isfinite(range_map)]
    return np.array(np.percentile(measured, percentile) if measured.size else np.nan, np.float64)


def _near_before_far(near: float | None, far: float | None) -> None:
    if near is not None and far is not None and far < near:
        raise ValueError(f"far ({far:g} m) must be beyond near ({near:g} m).")


@stage("range.to_relative", requires=_near_before_far)
def to_relative(
    range_map: Range,
    *,
    near: Annotated[float, Ge(0), Unit("m")] | None = None,
    far: Annotated[float, Gt(0), Unit("m")] | None = None,
) -> RelativeDepth:
    r"""Relative depth from a range, :math:`Z = (R - R_0) / (R_1 - R_0)`, for methods that count depth from 0 to 1.

    Parameters
    ----------
    range_map : (H, W) float, R, metres. NaN where unknown, +inf for sky.
    near : R₀, the range at and before which Z is 0; by default the least measured.
    far : R₁, the range at and beyond which Z is 1; by default the largest measured. Sky has Z = 1.

    Returns
    -------
    (H, W) float32, or float64 for float64 range, 0 near to 1 far. Unknown stays NaN. What has one range is near.

    Raises
    ------
    ValueError
        If R₁ is before R₀.
    """
    require_maps(range_map=(range_map, 1))
    (range_map,) = floats(range_map)
    measured = range_map[np.isfinite(range_map)]
    first = near if near is not None else float(measured.min(initial=np.inf))
    last = far if far is not None else float(measured.max(initial=first))
    if first < np.inf:
        _near_before_far(first, last)
    relative = np.full_like(range_map, np.nan)
    relative[np.isposinf(range_map)] = 1
    span = max(last - first, np.finfo(range_map.dtype).tiny)
    relative[np.isfinite(range_map)] = np.clip((measured - first) / span, 0, 1)
    return relative


def _is_dense(range_map: Range) -> str | None:
    """skipped where most measured pixels have four measured neighbours"""
    import cv2

    measured = (~np.isnan(range_map)).view(np.uint8)
    inner = cv2.erode(measured, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    return "the range is not sparse" if 2 * np.count_nonzero(inner) >= np.count_nonzero(measured) else None


@stage("range.densify", identity_when=_is_dense)
def densify(
    range_map: Range,
    image: Image,
    *,
    reach: Annotated[float, Gt(0), Unit("px")] | None = None,
    window: Annotated[int, Ge(1), Unit("px")] = 9,
    contrast: Annotated[float, Gt(0)] = 0.1,
) -> Range:
    """Spread the returns of a lidar over the pixels between them, along the edges of the image.

    Every unknown pixel takes the inverse range of the nearest measured one; a joint bilateral filter then averages
    inverse range over pixels of like colour, so that an edge of the range falls on an edge of the image; far from any
    measured pixel it is blurred as well, more with the distance. A map
    is sparse, and changed at all, when most of its measured pixels have an unknown one beside them.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    image : (H, W, 3) float, which guides the filter.
    reach : Distance in pixels from a measured one beyond which a pixel stays unknown; none fills the whole image,
        also what lies above the highest beam of a lidar.
    window : Width of the filter, which should span the gaps between beams.
    contrast : Difference of colour, on square roots of linear light, that halves the influence of a neighbour, nearly.

    Returns
    -------
    (H, W) float32, or float64 for float64 range. Measured pixels are the same to the last bit.

    Notes
    -----
    About 0.6 µs per pixel. Nothing of this is in the paper, whose laser scans are dense; the range between two beams
    is a guess, good on smooth surfaces (road, walls) and coarse at thin things that no beam has hit.
    """
    import cv2
    from scipy.ndimage import distance_transform_edt

    require_maps(range_map=(range_map, 1), image=(image, 3))
    (range_map,) = floats(range_map)
    if _is_dense(range_map):
        return range_map.copy()
    unknown = np.isnan(range_map)
    distance, (rows, columns) = distance_transform_edt(unknown, return_indices=True)  # type: ignore[misc]
    with np.errstate(divide="ignore"):
        nearness = (1 / range_map[rows, columns]).astype(np.float32)
    nearness = np.minimum(nearness, np.float32(1e6))  # a range of zero
    guide = np.sqrt(np.clip(image, 0, None)).astype(np.float32)
    smooth = cv2.ximgproc.jointBilateralFilter(guide, nearness, window, contrast, window / 2)
    for width in (window, 4 * window):
        # Far from any return the border between two nearest ones means nothing: no edge may show there.
        far = np.clip(distance / (2 * width) - 1, 0, 1).astype(np.float32)
        smooth += far * (cv2.GaussianBlur(smooth, (0, 0), width) - smooth)
    with np.errstate(divide="ignore"):
        dense = np.where(unknown, 1 / smooth, range_map).astype(range_map.dtype)
    dense[distance > (np.inf if reach is None else reach)] = np.nan
    return dense


def _no_holes(holes: Mask) -> str | None:
    """skipped where the range has no holes"""
    return None if holes.any() else "the range has no holes"


@stage("range.fill_holes", identity_when=_no_holes)
def fill_holes(
    range_map: Range,
    holes: Mask,
    image: Image | None = None,
    *,
    rng: np.random.Generator,
    samples: Annotated[int, Ge(1)] = 32,
    jump: Annotated[float, Gt(0)] = 0.05,
    largest: Annotated[float, Gt(0), Le(1)] = 0.5,
    at_edge: Literal["auto", "image", "nearest", "consensus"] = "auto",
) -> Range:
    r"""Give each hole inside the image one range, the one that fits most of its boundary.

    A hole is a connected region of ``holes``. Its boundary is the measured pixels that share an edge with it.
    As in RANSAC, values drawn from the boundary are tried for the whole hole, and the one with the smallest
    robust cost of the jumps across the boundary is kept,

    .. math:: \min_v \sum_q \frac{d_q^2}{d_q^2 + (s v)^2}, \qquad d_q = R_q - v.

    The cost of one jump is bounded (Geman and McClure), so a boundary between a near and a far surface
    gives the range of the surface that has more of it, never a mean of the two.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    holes : (H, W) bool. Only its unknown pixels are filled; a measured pixel never changes.
    image : (H, W, 3) float, linear light, optional.
    rng : Draws the values that are tried.
    samples : Values tried for each hole.
    jump : s, the jump that costs half of the most, as a share of the range that is tried.
    largest : Share of the image above which a hole is refused, since one range cannot stand for it.
    at_edge : What fills a hole that reaches the edge of the image, such as the frame around a registered depth map.
        ``"image"``: what it frames continues along the edges of the image, which must be wired (Laplace's equation for
        1/R, with little flow between unlike colours). ``"nearest"``: each pixel has the range of the nearest measured
        one. ``"consensus"``: one range as for every other hole. ``"auto"``: image where it is wired, else nearest.

    Returns
    -------
    (H, W) float32, or float64 for float64 range. Pixels outside the holes are the same to the last bit. A hole
    that borders no measured pixel stays NaN, unless it reaches the edge and there is a measured one anywhere.

    Raises
    ------
    ValueError
        If a hole is larger than ``largest``, as in a sparse range map (lidar), which is mostly one hole; or if
        ``at_edge`` is ``"image"`` without an image.

    Notes
    -----
    Time and memory grow with the pixels of all boundaries: ``samples`` passes over them, whatever the
    number of holes. By the image, 1 to 3 µs more for each pixel of a hole at the edge; in a large one, groups of up to
    4 × 4 pixels or so are solved for as one, and each pixel takes the range of the group that has its colour.

    Deviates from the paper: it names neither the robust cost nor the number of samples, and makes no difference
    for holes at the edge (``at_edge="consensus"``).

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, section 4.1; Fischler and Bolles 1981 (RANSAC).
    """
    require_maps(range_map=(range_map, 1), holes=(holes, 1))
    (range_map,) = floats(range_map)
    filled = range_map.copy()
    unknown = holes & np.isnan(range_map)
    labels, count = regions.label(unknown)
    _refuse_above(largest, regions.areas(labels, count) / unknown.size)
    inside, outside = regions.border_pairs(unknown, np.isfinite(range_map))
    if not inside.size:
        return filled
    hole_of_edge = labels.ravel()[inside]
    order = np.argsort(hole_of_edge, kind="stable")
    hole_of_edge, edge_range = hole_of_edge[order], range_map.ravel()[outside[order]].astype(np.float64)
    fill = np.full(count + 1, np.nan)
    fill[1:] = _consensus(hole_of_edge - 1, edge_range, count, rng, samples, jump)
    filled[unknown] = fill[labels[unknown]]
    if at_edge == "image" and image is None:
        raise ValueError('at_edge "image" needs the image: wire image, or set at_edge to "nearest".')
    if at_edge != "consensus":
        _continue_to_edge(filled, range_map, labels, None if at_edge == "nearest" else image)
    return filled


def _continue_to_edge(filled: np.ndarray, range_map: np.ndarray, labels: np.ndarray, image: Image | None) -> None:
    """Fill, in place, each region that reaches the edge of the image with the nearest measured range.

    With an image, that is the first guess from which what is measured flows along its edges.
    """
    edge = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    reaching = np.isin(labels, edge[edge > 0])
    if not reaching.any():
        return
    from scipy.ndimage import distance_transform_edt

    unmeasured = ~np.isfinite(range_map)
    rows, columns = distance_transform_edt(unmeasured, return_distances=False, return_indices=True)  # type: ignore[misc]
    filled[reaching] = range_map[rows[reaching], columns[reaching]]
    if image is not None:
        from fogpipe.kernels import edge_fill

        nearness = 1 / np.maximum(filled, np.finfo(filled.dtype).tiny)
        filled[reaching] = 1 / edge_fill.fill(nearness, reaching, image)[reaching]


def _refuse_above(largest: float, shares: np.ndarray) -> None:
    if shares.size and shares.max() > largest:
        raise ValueError(
            f"one hole covers {shares.max():.0%} of the image, and one range cannot stand for it."
            " Make a sparse map dense first, with range.densify; if it is sky, see the parameters of sky.identify."
        )


def _consensus(
    group: np.ndarray, values: np.ndarray, groups: int, rng: np.random.Generator, samples: int, jump: float
) -> np.ndarray:
    """Of ``samples`` values drawn from each group, the one of least robust cost; NaN for an empty group.

    ``group`` is sorted, and counts from 0.
    """
    sizes = np.bincount(group, minlength=groups)
    starts = np.cumsum(sizes) - sizes
    best, least = np.full(groups, np.nan), np.full(groups, np.inf)
    for _ in range(samples):
        drawn = starts + (rng.random(groups) * sizes).astype(np.intp)
        candidate = values[np.minimum(drawn, values.size - 1)]
        cost = np.bincount(group, _geman_mcclure(values - candidate[group], jump * candidate[group]), groups)
        better = (cost < least) & (sizes > 0)
        best[better], least[better] = candidate[better], cost[better]
    return best


def _geman_mcclure(difference: np.ndarray, scale: np.ndarray) -> np.ndarray:
    square = difference**2
    # The smallest number keeps 0/0, no jump at range zero, at cost 0.
    return square / (square + scale**2 + np.finfo(square.dtype).tiny)
