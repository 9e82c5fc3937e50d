"""What of a photograph is sky, and what stands in front of its background."""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray, over_channels

THICKEST = 5
"""Objects thinner than this, in pixels of the coarse grid, do not part one piece of sky from another."""

SPANNED = (0.6, 0.8)
"""Share of the upper eighth of a photo at which grey sky counts as a wall, and at which as sky for certain."""


def lab(display: FloatArray) -> FloatArray:
    """CIE L*a*b* of display values in [0, 1]."""
    import cv2

    return np.asarray(cv2.cvtColor(np.ascontiguousarray(display, np.float32), cv2.COLOR_RGB2Lab), np.float32)


def reduced(picture: np.ndarray, longest: int) -> np.ndarray:
    """The picture with the longer side at most ``longest`` pixels, and its dtype."""
    import cv2

    shrink = min(1.0, longest / max(picture.shape[:2]))
    size = [max(1, round(shrink * side)) for side in picture.shape[1::-1]]
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if shrink < 1 else picture


def smoothed(colour: FloatArray) -> FloatArray:
    """Texture and noise removed, edges kept: what borders of objects are measured on."""
    import cv2

    return np.asarray(cv2.bilateralFilter(colour, 5, 12, 3), np.float32)


def sky_likelihood(colour: FloatArray, flat: FloatArray, lowest: float) -> FloatArray:
    """How likely each pixel is sky, 0 to 1: like sky in colour, and joined to the upper edge without a border.

    Sky is neither warm nor green, it is smooth, and brighter than half of the photo unless it is a deep blue.

    Parameters
    ----------
    colour, flat : (H, W, 3) L*a*b* of the photo, and the same :func:`smoothed`.
    lowest : how low sky may reach, as a share of the height.
    """
    import cv2

    lightness, red, yellow = np.moveaxis(colour, -1, 0)
    hue = _above(8 - yellow, 3) * _above(red + 14, 3)
    bright = np.maximum(_above(lightness - max(float(np.median(lightness)), 45), 6), _above(-14 - yellow, 3))
    grain = cv2.GaussianBlur(np.abs(lightness - cv2.GaussianBlur(lightness, (0, 0), 2)), (0, 0), 2)
    seeds = np.zeros(lightness.shape, bool)
    alike = hue * bright
    seeds[0] = (alike * np.exp(-((grain / 4) ** 2)))[0] > 0.5
    if not seeds.any():
        return np.zeros_like(lightness)
    rows = (np.arange(len(lightness), dtype=np.float32)[:, None] + np.float32(0.5)) / len(lightness)
    joined = np.exp(-((geodesic(flat, seeds, noise=2) / 18) ** 2))
    # At dusk and at night the sky is darker than other photos' walls, and yet brightens towards the horizon.
    above = float(np.median(lightness[seeds]))
    as_bright = _above(lightness - (above - 4), 2) * _above(np.array(40 - above, np.float32), 3)
    likely = hue * np.maximum(bright, as_bright) * joined
    return behind_thin_objects(likely, colour) * _above(np.float32(lowest) - rows, 0.02)


def trust(sky: FloatArray, colour: FloatArray, road: float) -> float:
    """How surely what looks like sky is sky, 0 to 1: a white wall looks like a cloudy day.

    Sky is blue, or spans the upper part of the photo, or stands above the end of a road. A backdrop, a wall beside a
    window or the floor above a desk does none of it.

    Parameters
    ----------
    sky : (H, W) likelihood of sky.
    colour : (H, W, 3) L*a*b* of the photo.
    road : how surely the photo shows a road that ends below the sky, 0 to 1.
    """
    found = sky > 0.5
    if not found.any():
        return 0.0
    blue = float(_above(np.asarray(-6 - np.median(colour[..., 2][found])), 1.5))
    none, certain = SPANNED
    span = float(np.clip((found[: max(1, len(sky) // 8)].mean() - none) / (certain - none), 0, 1))
    return 1 - (1 - blue) * (1 - span) * (1 - road)


def behind_thin_objects(sky: FloatArray, colour: FloatArray) -> FloatArray:
    """The sky without thin objects before it, and with what is parted from it by thin objects only.

    The meshes of a lattice tower and the gaps between its legs are closed regions: no way without a border leads
    there from the upper edge.

    Parameters
    ----------
    sky : (H, W) likelihood of sky that is joined to the upper edge.
    colour : (H, W, 3) L*a*b* of the photo.
    """
    import cv2

    certain = (sky > 0.5).astype(np.float32)
    known = np.dstack([colour * certain[..., None], certain])
    near = np.asarray(cv2.GaussianBlur(known, (0, 0), 0.1 * sky.shape[1], sigmaY=3))
    beside = near[..., :3] / np.maximum(near[..., 3:], 1e-6)
    difference = np.linalg.norm(colour - beside, axis=2)
    spans = np.minimum(near[..., 3] / 0.1, 1)  # a few pixels of sky say little about its colour
    alike = np.exp(-((difference / 9) ** 2)) * spans
    gap = np.ones((THICKEST, THICKEST), np.uint8)
    regions = cv2.morphologyEx(((alike > 0.5) | (certain > 0)).astype(np.uint8), cv2.MORPH_CLOSE, gap)
    number, found = cv2.connectedComponents(regions, connectivity=4)
    labels = np.asarray(found, np.intp)
    kept = np.zeros(number, bool)
    kept[np.unique(labels[certain > 0])] = True
    kept[0] = False
    thin = thin_objects(colour, THICKEST + 2)
    return np.maximum(sky * (1 - thin), alike * kept[labels])


def thin_objects(colour: FloatArray, width: int) -> FloatArray:
    """How surely each pixel is part of something upright and thinner than ``width`` pixels, 0 to 1.

    Masts are brighter or darker, redder or yellower, than what is left and right of them: top hats of L*a*b* along
    the rows. Thin clouds lie along the rows, and do not count.
    """
    import cv2

    window = np.ones((1, width | 1), np.uint8)
    bright, dark = (cv2.morphologyEx(colour, way, window) for way in (cv2.MORPH_TOPHAT, cv2.MORPH_BLACKHAT))
    contrast = over_channels(np.maximum, np.maximum(bright, dark))
    return 1 - np.exp(-((np.maximum(contrast - 2, 0) / 4) ** 2))


def sky_matte(display: FloatArray, sky: FloatArray) -> FloatArray:
    """Share of sky in each pixel, 0 to 1, at the size of the photo: sharp at leaves and masts.

    Near what is sky for certain, a pixel is sky as far as its colour is that of the sky beside it.

    Parameters
    ----------
    display : (H, W, 3) display values in [0, 1].
    sky : (h, w) likelihood of sky, on a coarser grid.
    """
    import cv2

    rows, columns = display.shape[:2]
    coarse = lab(np.asarray(cv2.resize(display, sky.shape[::-1], interpolation=cv2.INTER_AREA), np.float32))
    certain = cv2.erode(np.where(sky > 0.5, sky, 0).astype(np.float32), np.ones((3, 3), np.uint8))
    known = np.dstack([coarse * certain[..., None], certain])
    near, wide = (cv2.GaussianBlur(known, (0, 0), max(1.0, share * max(sky.shape))) for share in (0.01, 0.03))
    near += np.float32(0.5) * wide  # what is nearer weighs more: clouds change within a few pixels
    beside = near[..., :3] / np.maximum(near[..., 3:], 1e-6)
    inner = cv2.erode(sky, np.ones((5, 5), np.uint8))
    outer = cv2.GaussianBlur(cv2.dilate(sky, np.ones((13, 13), np.uint8)), (0, 0), 2)
    fields = cv2.resize(np.dstack([beside, inner, outer]), (columns, rows))
    difference = lab(display)
    width = max(3, round(THICKEST * max(rows, columns) / max(sky.shape)))
    solid = 1 - thin_objects(difference, width)
    difference -= fields[..., :3]
    beyond_noise = np.maximum(np.sqrt(np.einsum("ijk,ijk->ij", difference, difference)) - 6, 0)
    alike = np.exp(-((beyond_noise / 9) ** 2))
    return np.clip(np.maximum(alike * fields[..., 4], fields[..., 3] * solid), 0, 1)


def hiding_sky(matte: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Share of each pixel of a coarser grid, of rows and columns ``shape``, that hides the sky, 0 to 1.

    Lattices are closed: a third of a pixel hides all of it, and so does what surrounds a gap of less than
    :data:`THICKEST` pixels.

    Parameters
    ----------
    matte : (H, W) share of sky, at the size of the photo.
    """
    import cv2

    share = cv2.resize(1 - matte, shape[::-1], interpolation=cv2.INTER_AREA)
    closed = cv2.morphologyEx(np.minimum(3 * share, 1), cv2.MORPH_CLOSE, np.ones((THICKEST, THICKEST), np.uint8))
    return np.asarray(closed, np.float32)


def prominence(flat: FloatArray) -> FloatArray:
    """How many borders lie between each pixel and the edge of the image, 0 to 1: what stands out is an object.

    The geodesic saliency of Wei et al. 2012.
    """
    seeds = np.zeros(flat.shape[:2], bool)
    seeds[[0, -1]] = True
    seeds[:, [0, -1]] = True
    distance = geodesic(flat, seeds, noise=3)
    largest = max(float(np.percentile(distance, 95)), 20.0)  # less is a plain photo, in which nothing stands out
    return np.minimum(distance / np.float32(largest), 1)


def geodesic(flat: FloatArray, seeds: np.ndarray, noise: float) -> FloatArray:
    """Least sum of steps in colour above ``noise`` on a way from a seed to each pixel. O(n log n)."""
    from skimage.graph import MCP_Geometric

    step = np.zeros(flat.shape[:2], np.float32)
    across = np.linalg.norm(np.diff(flat, axis=1), axis=2) if flat.shape[1] > 1 else np.zeros((len(flat), 0))
    down = np.linalg.norm(np.diff(flat, axis=0), axis=2)
    step[:, 1:] += np.maximum(across - noise, 0)
    step[1:] += np.maximum(down - noise, 0)
    distance, _ = MCP_Geometric(step + np.float32(0.02)).find_costs(np.argwhere(seeds))
    return distance.astype(np.float32)


def _above(value: FloatArray, width: float) -> FloatArray:
    """A soft step from 0 to 1 where ``value`` passes 0."""
    from scipy.special import expit

    return expit(value / np.float32(width))
