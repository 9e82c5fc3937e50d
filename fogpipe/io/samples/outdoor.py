"""A procedural outdoor scene: a country road in the evening sun, ray-cast, with exact range."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.camera import CameraFile
from fogpipe.io.samples import SampleFrame, houses, plants
from fogpipe.io.samples.scenery import Scenery, delineator, fence, speed_sign, street_lamp
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.daylight import BLOCK_ROWS, Daylight, Ground, ShadowMap, World, even_disc, render
from fogpipe.kernels.raycast import Solids, View, bounds, cast_solids, trace_profiles

EYE_HEIGHT = 2.0
FARTHEST = 420
"""Metres; the terrain ends here."""
LEFT = -320
"""x of the first terrain sample."""
FLAT_WIDTH, FLAT_LENGTH = 9.0, 100.0
"""Within this distance of the road's centre, and up to this depth, the ground is the exact plane y = 0."""
SAMPLES = 5
"""Samples per pixel and axis; odd, so that the middle one is the ray of the pixel's centre."""
TEXEL = 0.04
"""Side of a texel of the sun's shadow map (m)."""
MIN_SIZE, MAX_SIZE = 16, 8192
Place = Callable[[float, float], np.ndarray]
"""The point on the land at a distance to the right of the road's centre (m) and a depth z (m)."""


def outdoor(seed: int = 1, width: int = 960, height: int = 600, *, holes: bool = False) -> SampleFrame:
    """A country road with houses, trees, posts and lamps, hills with woods, and open sky.

    Parameters
    ----------
    seed : another seed, another scene; the same seed gives the same bytes.
    width, height : size in pixels, 16 to 8192 each.
    holes : leave the range of window panes undefined, as a lidar does.

    Returns
    -------
    SampleFrame : the image (H, W, 3) float32 in linear light, in clear air, lamps above 1; the range (H, W) float32 in
        metres along the ray, NaN in the sky (and in the panes); the camera.

    Raises
    ------
    InputError
        If the size is out of bounds.

    Notes
    -----
    The colour of a pixel is the mean of 25 rays, so an edge pixel is a mixture. Its range is that of the one ray
    through its centre, never a mean of two surfaces. Time goes with the number of pixels.
    """
    if not (MIN_SIZE <= width <= MAX_SIZE and MIN_SIZE <= height <= MAX_SIZE):
        raise InputError(f"sample:outdoor is {MIN_SIZE} to {MAX_SIZE} pixels wide and high, not {width}×{height}.")
    focal_length = 0.95 * width
    camera = np.array([[focal_length, 0, (width - 1) / 2], [0, focal_length, 0.56 * height], [0, 0, 1]])
    view = _sample_view(camera)
    rng = np.random.default_rng(seed)
    road, heights, sun = _land(rng)
    patches, shapes, capsules, material, tint = _furnish(rng, road, heights, focal_length).arrays()
    patches[:, 0, 1] -= EYE_HEIGHT
    capsules[:, [1, 4]] -= EYE_HEIGHT
    solids = Solids(patches, shapes, capsules, bounds(patches, capsules, view, height * SAMPLES, width * SAMPLES))
    image, range_map = np.empty((height, width, 3), np.float32), np.empty((height, width), np.float32)
    ground = _trace_ground(view, width * SAMPLES, heights, road)
    light = _light(sun, rng.uniform(0, 50, 2), solids)
    blocks = -(-height // BLOCK_ROWS)
    order = np.argsort(np.arange(blocks) * 0.618034 % 1)  # spreads dear and cheap rows over the threads
    world = World(solids, material, tint, ground, light)
    disc = even_disc(SAMPLES**2)
    in_bands(render, blocks, width * BLOCK_ROWS, order, view, SAMPLES, world, disc, holes, image, range_map)
    note = f"sample:outdoor, seed {seed}: procedural, in clear air; range of a pixel is that of its centre ray"
    return SampleFrame(image, range_map, CameraFile(camera, size=(width, height), source="sample:outdoor"), (note,))


def _sample_view(camera: np.ndarray) -> View:
    """The camera over the grid of samples; sample (S·r + S//2) is the centre of pixel r."""
    fx, fy, (cx, cy) = camera[0, 0], camera[1, 1], camera[:2, 2]
    return View(fx * SAMPLES, fy * SAMPLES, cx * SAMPLES + SAMPLES // 2, cy * SAMPLES + SAMPLES // 2)


def _land(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The road's centre x for each metre of z, terrain heights on a 1 m grid, and the direction to the sun."""
    from scipy.ndimage import gaussian_filter

    z, x = np.arange(FARTHEST + 2.0), np.arange(LEFT, -LEFT + 1.0)
    bend = rng.choice([-1, 1]) * rng.uniform(7, 11)
    road = -1.5 + bend * (1 - np.cos(z / rng.uniform(62, 75))) * np.minimum(z / 120, 1)
    rough = [gaussian_filter(rng.normal(size=(z.size, x.size)), s, mode="nearest") * s for s in (9, 22, 60)]
    waves = sum(weight * layer / layer.std() for weight, layer in zip((0.25, 0.8, 2.2), rough, strict=True))
    off_road = np.abs(x - road[:, None]) - FLAT_WIDTH
    aside = _smooth_step(off_road / 70)
    beyond = _smooth_step((z[:, None] - FLAT_LENGTH) / 260)
    heights = aside * (1.2 + 0.55 * waves) * _smooth_step((z[:, None] + 40) / 120) + beyond * (27 + 5.5 * waves)
    azimuth, elevation = np.radians(rng.uniform(-128, -112)), np.radians(rng.uniform(25, 31))
    sun = np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])
    return road, np.maximum(heights, 0), sun


def _smooth_step(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def _furnish(rng: np.random.Generator, road: np.ndarray, heights: np.ndarray, focal_length: float) -> Scenery:
    """Everything that stands on the land."""
    scenery = Scenery()

    def at(side: float, z: float) -> np.ndarray:
        return _on_land(heights, np.array([[_centre(road, z) + side, z]]))[0]

    for z in np.arange(17, 135, 22.0):
        street_lamp(scenery, at(4.6, z), over_road=-1.7)
    for z in np.arange(9, 150, 18.0):
        delineator(scenery, at(-4.1, z))
    speed_sign(scenery, at(4.3, 12.5))
    fence(scenery, rng, np.array([at(-6.2, z) for z in np.arange(5, 80, 2.6)]))
    _avenue(scenery, rng, at)
    _village(scenery, rng, at)
    _woods(scenery, rng, road, heights, focal_length)
    feet = np.stack([rng.uniform(-9, 9, 50000), 4 + 16 * rng.random(50000) ** 1.5], axis=1)
    off_road = np.abs(feet[:, 0] - _centre(road, feet[:, 1]))
    plants.grass(scenery, rng, _on_land(heights, feet[off_road > 3.55 + 0.3 * rng.random(len(feet))]))
    return scenery


def _avenue(scenery: Scenery, rng: np.random.Generator, at: Place) -> None:
    """Poplars along the left, one broad tree near by, a few more behind the houses, and hedges."""
    for z in np.arange(27, 140, 10):
        leaf = max(0.10, 0.0036 * z)
        place = at(-11.5 + rng.normal(0, 0.4), z + rng.normal(0, 0.5))
        plants.tree(scenery, rng, place, rng.uniform(11, 14.5), 1.5, leaf=leaf, slender=True)
    plants.tree(scenery, rng, at(-9.8, 17.5), rng.uniform(8.2, 9.6), 3.6, leaf=0.085)
    plants.tree(scenery, rng, at(-9.0, 3.0), 9.5, 3.4, leaf=0.13)  # out of view, for its shadow on the road
    plants.tree(scenery, rng, at(8.6, 18), rng.uniform(4.0, 4.8), 1.9, leaf=0.085, tint=(0.10, 0.145, 0.04))
    for side, z in ((17, 33), (27, 60), (15, 84), (-27, 52), (-34, 75), (-24, 96), (19, 118), (-17, 150), (12, 146)):
        tint = np.array([0.085, 0.13, 0.032]) * rng.uniform(0.7, 1.3)
        place = at(side + rng.normal(0, 1), z + rng.normal(0, 2))
        plants.tree(scenery, rng, place, rng.uniform(6, 10), rng.uniform(2.6, 4), leaf=max(0.1, 0.0036 * z), tint=tint)
    hedges = ((-14, 68, -75, 78), (-16, 112, -90, 128), (24, 132, 95, 140), (7.6, 23, 7.9, 35))
    for start, end in ((hedge[:2], hedge[2:]) for hedge in hedges):
        way = np.linspace(start, end, int(np.hypot(end[0] - start[0], end[1] - start[1]) / 0.8))
        plants.hedge(scenery, rng, np.array([at(side, z) for side, z in way]), leaf=max(0.09, 0.0036 * start[1]))


def _village(scenery: Scenery, rng: np.random.Generator, at: Place) -> None:
    """Houses along the right side of the road."""
    walls = [(0.66, 0.60, 0.48), (0.70, 0.68, 0.62), (0.62, 0.44, 0.27), (0.60, 0.36, 0.28), (0.50, 0.54, 0.56)]
    roofs = [(0.30, 0.105, 0.062), (0.25, 0.10, 0.07), (0.14, 0.125, 0.12), (0.33, 0.13, 0.075)]
    shutters = [(0.05, 0.12, 0.08), (0.22, 0.045, 0.035), (0.06, 0.12, 0.2), (0.30, 0.24, 0.16)]
    for number, z in enumerate((31, 48, 67, 90, 114)):
        yaw = rng.normal(0, 0.06)
        houses.house(
            scenery,
            rng,
            at(9.2 + rng.uniform(0, 1.5), z + rng.uniform(9, 11)),
            np.array([np.sin(yaw), 0, -np.cos(yaw)]),
            length=rng.uniform(8.5, 11),
            depth=rng.uniform(6.5, 8),
            eaves=rng.choice([3.0, 5.4]),
            wall=walls[(number + rng.integers(2)) % 5],
            roof=roofs[rng.integers(4)],
            shutters=shutters[rng.integers(4)],
        )


def _woods(
    scenery: Scenery, rng: np.random.Generator, road: np.ndarray, heights: np.ndarray, focal_length: float
) -> None:
    """Woods on the hills, up to the ridge, with clearings, and hedgerow trees in the fields."""
    from scipy.ndimage import gaussian_filter

    z = 145 + (FARTHEST - 151) * np.sqrt(rng.random(3600))
    feet = np.stack([rng.uniform(-0.55, 0.55, z.size) * z, z], axis=1)
    density = gaussian_filter(rng.normal(size=heights.shape), 16)
    density /= density.std()
    least = np.interp(z, (145, 260, 360, 395), (1.2, 0.5, -0.3, -9))
    wooded = density[feet[:, 1].astype(int), (feet[:, 0] - LEFT).astype(int)] > least
    clear_of_road = np.abs(feet[:, 0] - _centre(road, z)) > 8
    feet = feet[wooded & clear_of_road]
    plants.woods(scenery, rng, _on_land(heights, feet), 2.4 * feet[:, 1] / focal_length)


def _centre(road: np.ndarray, z: np.ndarray | float) -> np.ndarray:
    """x of the road's centre at depth z."""
    return np.asarray(np.interp(z, np.arange(road.size), road))


def _on_land(heights: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Points (N, 3) on the terrain at places (N, 2), x and z."""
    from scipy.ndimage import map_coordinates

    height = map_coordinates(heights, [places[:, 1], places[:, 0] - LEFT], order=1, mode="nearest")
    return np.stack([places[:, 0], height, places[:, 1]], axis=1)


def _trace_ground(view: View, columns: int, heights: np.ndarray, road: np.ndarray) -> Ground:
    depths = np.geomspace(1, FARTHEST, 560)
    lowest, profile = np.empty((columns, depths.size), np.float32), np.empty((columns, depths.size), np.float32)
    in_bands(trace_profiles, columns, depths.size, view, EYE_HEIGHT, heights, LEFT, depths, lowest, profile)
    return Ground(heights, LEFT, EYE_HEIGHT, road, depths, lowest, profile)


def _light(sun: np.ndarray, clouds: np.ndarray, solids: Solids) -> Daylight:
    """Shadows are cast up to 150 m away; beyond, the trees carry their own shading."""
    corners = np.array([[x, y, z] for x in (-40, 40) for y in (-EYE_HEIGHT, 16) for z in (4, 150)], np.float64)
    near = solids.patches[:, 0, 2] < 150
    solids = solids._replace(patches=solids.patches[near], shapes=solids.shapes[near])
    zenith = np.array([0.0, 1.0, 0.0])
    return Daylight(sun, clouds, _shadow_map(sun, corners, solids, TEXEL), _shadow_map(zenith, corners, solids, 0.2))


def _shadow_map(toward: np.ndarray, corners: np.ndarray, solids: Solids, texel: float) -> ShadowMap:
    """Depths of the solids from a light so far away (20 km) that its rays are parallel, over the box of ``corners``."""
    distance = 20_000.0
    right = np.cross(toward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    basis = np.stack([right, np.cross(-toward, right), -toward])
    position = corners.mean(axis=0) + distance * toward
    seen = (corners - position) @ basis.T
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    columns, rows = np.ceil((high - low) / texel).astype(int)
    view = View(distance / texel, distance / texel, -low[0] / texel, high[1] / texel)
    patches = solids.patches @ basis.T
    patches[:, 0] -= position @ basis.T
    capsules = solids.capsules.copy()
    for end in (slice(0, 3), slice(3, 6)):
        capsules[:, end] = (capsules[:, end] - position) @ basis.T
    turned = Solids(patches, solids.shapes, capsules, bounds(patches, capsules, view, rows, columns))
    depth = np.full((rows, columns), np.inf, np.float32)
    owner = np.zeros((rows, columns), np.int32)
    in_bands(cast_solids, rows, columns, 0, view, turned, depth, owner)
    return ShadowMap(basis, position, view, depth)
