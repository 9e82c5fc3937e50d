"""Density of the medium: fog that is not the same everywhere, as Perlin noise (Lopez-Moreno 2008, section 3.4.2)."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.ports import Camera, Density, Image, Range, Unit
from fogpipe.stage import stage

Octaves = Annotated[int, Ge(0), Le(16)]
Share = Annotated[float, Ge(0), Le(1)]
Vector = tuple[float, float, float]
Pose = tuple[tuple[float, float, float, float], tuple[float, float, float, float], tuple[float, float, float, float]]
"""Camera to world as three rows (R | position), the position in metres; the first three columns are a rotation."""


_FARTHEST = 1e30  # metres, a number in single precision that stands for infinity


@stage("density.perlin")
def perlin(
    image: Image,
    *,
    period: Annotated[float, Ge(1), Unit("px")] = 250.0,
    octaves: Octaves = 5,
    contrast: Share = 0.3,
    persistence: Share = 0.5,
    noise: Literal["gradient", "value"] = "gradient",
    tileable: bool = False,
    rng: np.random.Generator,
) -> Density:
    r"""Density that varies over the image, as a sum of octaves of Perlin noise n.

    .. math:: \rho = \frac{(1 + a n)^2}{1 + a^2}, \qquad
              n \propto \sum_o g^{\,o}\, \mathrm{noise}\!\left(\frac{2^o x}{P}\right), \qquad E n = 0,\ E n^2 = 1

    The density is never negative, and its mean over all seeds is 1 at every contrast.

    Parameters
    ----------
    image : (H, W, 3) float. Only its size is used.
    period : P, size of the cells of the first octave. Each octave halves it. Below 2 px an octave is grain.
    octaves : How many; with none the density is 1.
    contrast : Standard deviation of the density; from 0.5 on, holes in the fog. It gives a, by
        :math:`a^2 = \sqrt{2 / (2 - c^2)} - 1`.
    persistence : g, amplitude of an octave over that of the one before.
    noise : ``"gradient"``, as Perlin's, or ``"value"``, as the paper describes it: blotches with straight edges.
    tileable : Whether the image continues at its opposite border. The period is then changed to the nearest that
        divides each side.
    rng : Draws the noise. A larger image continues a smaller one of the same seed, unless it is tileable. The fog
        sticks to the picture: for video take :func:`along_rays`.

    Returns
    -------
    (H, W) float32, relative to the mean.

    Raises
    ------
    ValueError
        If the image has not three channels.

    Notes
    -----
    About 1 ns per pixel and octave on two cores, more where cells are smaller than 4 px; no other array. One image
    holds few cells, so its own mean deviates from 1; with side L, the standard deviation is about 0.3 c P / L.

    The lattice leaves traces. Of five octaves of gradient noise, the variance is 0.26 times its mean at the
    corners of the first cells and 1.4 times at most; in every band of an octave the power along the axes is within 30 %
    of that along the diagonals.

    Deviates from the paper, which gives no amplitudes (Figure 9 shows smaller ones for finer octaves) and takes the sum
    as the density: here octaves are shifted against each other, because gradient noise would vanish at the corners of
    the coarse cells in every octave, and the density has a mean and a bound.

    References
    ----------
    Lopez-Moreno 2008, *Image-based participating media*, section 3.4.2 and Figure 9; Perlin 2002, *Improving noise*.
    """
    from fogpipe.kernels.perlin import density, field

    require_maps(image=(image, 3))
    height, width = image.shape[:2]
    shape = {"period": period, "octaves": octaves, "persistence": persistence, "noise": noise, "tileable": tileable}
    return density(field(height, width, _key(rng), **shape), contrast if octaves else 0.0)


def _moves(pose: Pose | None, wind: Vector, time: float) -> None:
    _pose_matrix(pose)
    if not np.isfinite([speed * time for speed in wind]).all():
        raise ValueError(f"wind and time must be finite, not {wind} m/s and {time} s.")


@stage("density.along_rays", requires=_moves)
def along_rays(
    range_map: Range,
    camera: Camera,
    *,
    period: Annotated[float, Ge(0.1), Unit("m")] = 20.0,
    octaves: Octaves = 4,
    contrast: Share = 0.3,
    persistence: Share = 0.5,
    pose: Pose | None = None,
    wind: Annotated[Vector, Unit("m/s")] = (0.0, 0.0, 0.0),
    time: Annotated[float, Unit("s")] = 0.0,
    growth: Annotated[float, Ge(0.005), Le(1)] = 0.1,
    rng: np.random.Generator,
) -> Density:
    r"""Mean density along the ray of each pixel, through noise that is fixed in the world and drifts with the wind.

    .. math:: \bar\rho = \frac1R \int_0^R \rho(p + s\,e - t\,v)\, ds

    so that :math:`\beta \bar\rho R` is the optical thickness of the ray, as :func:`medium.transmission` takes it.
    From another viewpoint and at another time the same fog is seen, as long as the seed is the same.

    Parameters
    ----------
    range_map : (H, W) float, R, metres. NaN where unknown, +inf for sky.
    camera : (3, 3) float, intrinsic matrix in pixels.
    period : Size of the cells of the first octave. Each octave halves it.
    octaves, contrast, persistence : as in :func:`perlin`, of the density at a point of the world.
    pose : Camera to world, three rows of four numbers: the rotation R, and the position p. By default the camera is at
        the origin and looks along z, with x to the right and y down.
    wind : v, the velocity of the fog in the world (Taylor's frozen turbulence).
    time : t, when the picture is taken.
    growth : Length of a step along the ray over its distance. Smaller is more accurate and slower.
    rng : Draws the noise. In a pipeline its seed and the name of the stage decide: keep both for all frames of a video.

    Returns
    -------
    (H, W) float32, relative to the mean. An infinite or unknown range, and a range of 0, give 1.

    Raises
    ------
    ValueError
        If a range is negative, the pose is no rotation with a position, or a number is not finite.

    Notes
    -----
    Steps begin and end at the same distances for all pixels and are no shorter than half the finest period. An octave
    fades out where a step is as long as its period, and keeps its share of the mean. So nothing aliases or flickers,
    and beyond period / growth, 200 m, the density is 1. At the default growth it takes about 0.2 µs per pixel on two
    cores, and on a street at an extinction of 0.03 per metre the error of the transmission is 1e-3 (root mean
    square); at 0.05, 3 times the time and 3e-4. One array.

    References
    ----------
    Own extension of Lopez-Moreno 2008, *Image-based participating media*, section 3.4.2; Taylor 1938, *The spectrum of
    turbulence*.
    """
    from fogpipe.kernels.perlin_rays import mean_density

    require_maps(range_map=(range_map, 1))
    if np.fmin.reduce(range_map, axis=None) < 0:
        raise ValueError("range_map is negative at some pixels; mark unknown ones as NaN.")
    _moves(pose, wind, time)
    to_world = _pose_matrix(pose)
    drift = [speed * time for speed in wind]
    (reach,) = floats(np.minimum(range_map, _FARTHEST).astype(np.float32))
    rays = to_world[:, :3] @ np.linalg.inv(camera)
    noise = {"period": period, "octaves": octaves, "persistence": persistence, "contrast": contrast}
    return mean_density(reach, rays, to_world[:, 3] - drift, _key(rng), growth=growth, **noise)


def _key(rng: np.random.Generator) -> int:
    return int(rng.integers(2**64, dtype=np.uint64))


def _pose_matrix(pose: Pose | None) -> np.ndarray:
    """(R | p) as an array, after a check that R is a rotation."""
    if pose is None:
        return np.eye(3, 4)
    matrix = np.array(pose, np.float64)
    rotation = matrix[:, :3]
    # Files give a rotation with six decimals or so.
    if not np.isfinite(matrix).all() or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4):
        raise ValueError("pose must be three rows of four finite numbers, a rotation and a position in metres.")
    return matrix
