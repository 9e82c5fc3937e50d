"""Sky: which pixels of unknown range are sky, and how the scene passes into it (Hansard 2019, section 4.1)."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels import regions
from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.ports import Image, Length, Mask, Range, Unit
from fogpipe.stage import stage


class Undefined(NamedTuple):
    """The pixels without a measured range, as two masks that do not overlap."""

    sky: Mask
    holes: Mask


@stage("sky.identify")
def identify(
    range_map: Range,
    *,
    min_area: Annotated[float, Gt(0), Le(1)] = 0.005,
    touching: Literal["top", "any"] = "top",
    gap: Annotated[int, Ge(0), Unit("px")] = 4,
) -> Undefined:
    """Tell sky from holes among the pixels without a measured range.

    Sky is every pixel marked as infinitely far, and the large connected regions of unknown range. All other
    unknown pixels are holes.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    min_area : Least size of a large region, as a share of the image.
    touching : ``"top"``: a large region is sky if it touches the top edge of the image, or if trees cut it off
        from the top: its middle lies higher than the lowest sky that touches the top. A region that
        reaches the bottom edge is not sky (the frame around a registered depth map, the gaps of a sparse lidar).
        ``"any"``: every large region is sky, as in the paper.
    gap : Where there is sky, small regions within this distance of it belong to it too, and what is so near to
        these: the sky between leaves. 0 takes the large regions only, as in the paper.

    Returns
    -------
    sky, holes : (H, W) bool. A region that borders no measured pixel is sky, since it has nothing to be
        filled from; so is the whole of an image in which nothing is measured.

    Notes
    -----
    One or two labellings, 12 ns per pixel each; 0.5 ns where nothing is unknown.

    Deviates from the paper: it takes the largest regions wherever they are (``touching="any"``), which makes sky
    of a large hole in an indoor scene, and only these, which leaves clear specks of sky in the crowns of foggy trees.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, section 4.1.
    """
    require_maps(range_map=(range_map, 1))
    unknown, infinite = np.isnan(range_map), np.isposinf(range_map)
    if not unknown.any():
        return Undefined(infinite, unknown)
    labels, count = regions.label(unknown)
    is_sky = regions.areas(labels, count) >= min_area * range_map.size
    if touching == "top":
        first, after = regions.row_spans(labels)
        is_sky &= after < len(range_map)
        horizon = after[is_sky & (first == 0)].max(initial=0)
        is_sky &= (first + after) / 2 < horizon
    borders_measured = np.zeros(count + 1, bool)
    borders_measured[labels[regions.border(unknown, np.isfinite(range_map))]] = True
    is_sky |= ~borders_measured[1:]
    sky = infinite | np.append(False, is_sky)[labels]
    if gap and sky.any():
        reached, count = regions.label(_widened(unknown | infinite, gap))
        belongs = np.zeros(count + 1, bool)
        belongs[reached[sky]] = True
        sky |= unknown & belongs[reached]
    return Undefined(sky, unknown & ~sky)


def _widened(mask: Mask, gap: int) -> Mask:
    """The mask and all pixels within half of ``gap`` of it, so that what is ``gap`` apart is connected."""
    import cv2

    size = gap // 2 * 2 + 1
    return cv2.dilate(mask.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))).view(bool)


def _no_sky(sky: Mask) -> str | None:
    """skipped where the scene has no sky"""
    return None if sky.any() else "the scene has no sky"


@stage("sky.matte", identity_when=_no_sky)
def matte(
    range_map: Range,
    sky: Mask,
    farthest: Length,
    image: Image | None = None,
    *,
    margin: Annotated[float, Ge(0), Unit("px")] = 4.0,
    beyond: Annotated[float, Ge(1)] = 1.5,
    solver: Literal["auto", "colour", "direct", "jacobi"] = "auto",
) -> Range:
    r"""Give the sky a range, and lead the range of the scene smoothly over into it.

    The sky gets one range beyond the scene, Smax. In a margin along the scene, the sky pixels no farther than µ from a
    measured one, the outlines of the range and of the image may disagree, and an edge of the haze shows where the image
    has none. An image tells by its colours the share α of the scene in each of these pixels; nearness is mixed,

    .. math:: 1/S = \alpha / R + (1 - \alpha) / S_\mathrm{max},

    with R of the nearest measured pixel. Otherwise, as published, S solves Laplace's equation

    .. math:: \nabla^2 S = 0, \quad S = R \text{ at the scene}, \quad S = S_\mathrm{max} \text{ at the sky}.

    Parameters
    ----------
    range_map : (H, W) float, metres. NaN where unknown, +inf for sky.
    sky : (H, W) bool. A pixel of it that has a measured range counts as scene and keeps it.
    farthest : Largest measured range Rmax, metres (:func:`fogpipe.stages.range.farthest`).
    image : (H, W, 3) float, linear light, optional.
    margin : Width µ of the margin in pixels; 0 leaves a hard edge.
    beyond : Smax / Rmax. The paper asks for more than 1 and names no value.
    solver : ``"colour"``: by the image, which must be wired. ``"direct"``: the exact solution of Laplace's equation, by
        sparse LU. ``"jacobi"``: 2µ sweeps of the four-neighbour mean, the published solver, which starts from Smax and
        stops well before it has converged. ``"auto"``: colour where there is an image, else direct.

    Returns
    -------
    (H, W) float32, or float64 for float64 range. Every pixel that is not sky is the same to the last bit.
    Where nothing is measured the sky is infinitely far (+inf).

    Raises
    ------
    ValueError
        If the solver is ``"colour"`` without an image, or the image is not finite or of another size.

    Notes
    -----
    Laplace's equation lets the sky in the margin be seen through less haze than beyond it: a halo where clouds or a
    blue sky differ from the airlight, and clear specks in the gaps between leaves, which are all margin. By colour
    there are none, as long as scene and sky differ in it. What is measured keeps its range in every case. Make the
    margin no wider than the outlines of range and image disagree: 2 to 4 px for exact range, more for lidar. At the
    border of the image, and at an unfilled hole, Laplace's S has no slope.

    After 2µ sweeps from Smax, the Jacobi solver is still 0.28 Rmax away from the solution for µ = 12 (root mean square,
    0.17 for µ = 4): about µ² sweeps are needed, since values walk through the margin at random. Its ramp is steeper.

    Costs a distance transform (7 ns per pixel) and, for each pixel of the margin, about 2 µs and 0.5 kB (direct) or
    0.15 µs (jacobi, µ = 12); by colour 70 ns per pixel of the image.

    Deviates from the paper where an image is wired. Nearness is mixed in place of transmissions, which depend on the
    density of the haze: at half a leaf the range is about twice as far.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, section 4.1.
    """
    from fogpipe.kernels import matting
    from fogpipe.kernels.sky_colour import share_of_scene

    if solver == "auto":
        solver = "direct" if image is None else "colour"
    require_maps(range_map=(range_map, 1), sky=(sky, 1))
    (range_map,) = floats(range_map)
    measured = np.isfinite(range_map)
    region = sky & ~measured
    matted = range_map.copy()
    matted[region] = beyond * farthest if np.isfinite(farthest) else np.inf
    distance = _distance_to(measured)
    band = region & (distance <= margin)
    if not band.any():
        return matted
    if solver == "colour":
        if image is None:
            raise ValueError('solver "colour" needs the image: wire image, or set solver to "direct".')
        beyond_margin = region & ~band
        certain = beyond_margin if beyond_margin.any() else region
        share = share_of_scene(image, band, measured, certain, distance, margin)
        near, far = (
            np.maximum(of, np.finfo(of.dtype).tiny) for of in (_nearest(range_map, measured)[band], matted[band])
        )
        matted[band] = 1 / (share / near + (1 - share) / far)
        return matted
    if solver == "jacobi":
        return matting.jacobi(matted, band, sweeps=round(2 * margin))
    return matting.direct(matted, band)


def _distance_to(mask: np.ndarray) -> np.ndarray:
    """Distance of each pixel to the nearest of the mask, px; infinite where there is none."""
    import cv2

    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    return cv2.distanceTransform(np.ascontiguousarray(~mask).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _nearest(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The value of the pixel of the mask that is nearest to each pixel."""
    import cv2

    away = np.ascontiguousarray(~mask).view(np.uint8)
    _, found = cv2.distanceTransformWithLabels(away, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    labels = np.asarray(found, np.intp)
    of_label = np.empty(labels.max() + 1, values.dtype)
    of_label[labels[mask]] = values[mask]
    return of_label[labels]
