"""Density of the medium over the image and in the world."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels import bands
from fogpipe.kernels.rays import planar_to_radial
from fogpipe.stages.density import along_rays, perlin

HEIGHT, WIDTH = 60, 80
CAMERA = np.array([[70.0, 0, 40], [0, 70, 25], [0, 0, 1]])
SMALL = np.array([[7.0, 0, 4], [0, 7, 2.5], [0, 0, 1]])
WALL = planar_to_radial(np.full((HEIGHT, WIDTH), 60.0), CAMERA)


def rng():
    return np.random.default_rng(11)


def seen(range_map=WALL, **parameters):
    return along_rays(range_map, CAMERA, rng=rng(), **parameters)


def moved(x, y, z):
    return ((1.0, 0.0, 0.0, x), (0.0, 1.0, 0.0, y), (0.0, 0.0, 1.0, z))


class TestPerlin:
    def test_a_seed_gives_one_field(self):
        image = np.zeros((30, 40, 3), np.float32)
        assert np.array_equal(perlin(image, rng=rng()), perlin(image, rng=rng()))
        assert not np.array_equal(perlin(image, rng=rng()), perlin(image, rng=np.random.default_rng(12)))

    def test_the_mean_over_many_cells_is_1(self):
        rho = perlin(np.zeros((800, 800, 3), np.float32), period=20, rng=rng())
        assert rho.mean() == pytest.approx(1, abs=4 * 0.3 * 0.3 * 20 / 800)  # four times the deviation stated
        assert rho.std() == pytest.approx(0.3, rel=0.1)

    @pytest.mark.parametrize("parameters", [{"octaves": 0}, {"contrast": 0.0}])
    def test_no_octaves_or_no_contrast_is_a_homogeneous_medium(self, parameters):
        assert (perlin(np.zeros((5, 6, 3), np.float32), **parameters, rng=rng()) == 1).all()

    @pytest.mark.parametrize("noise", ["gradient", "value"])
    def test_full_contrast_is_never_negative(self, noise):
        rho = perlin(np.zeros((200, 200, 3), np.float32), period=20, contrast=1.0, noise=noise, rng=rng())
        assert rho.min() >= 0
        assert np.isfinite(rho).all()

    def test_one_row(self):
        assert perlin(np.zeros((1, 500, 3), np.float32), rng=rng()).shape == (1, 500)


class TestAlongRays:
    def test_another_viewpoint_sees_the_same_fog(self):
        # What lies between 0 and 60 m is what lies before 20 m and after it, on the axis of a camera that advances.
        axis = np.array([[0.0, 60.0], [20.0, 40.0]])
        camera = np.array([[1e9, 0, 0], [0, 1e9, 0], [0, 0, 1.0]])  # every ray is the axis
        whole, first = (along_rays(axis, camera, growth=0.01, rng=rng())[i] for i in ((0, 1), (1, 0)))
        rest = along_rays(axis, camera, growth=0.01, pose=moved(0, 0, 20), rng=rng())[1, 1]
        # Both integrals take steps of at most 1.25 m through cells of 2.5 m.
        assert 60 * whole == pytest.approx(20 * first + 40 * rest, abs=0.05)
        assert abs(first - rest) > 0.01  # it is no homogeneous fog

    def test_a_camera_that_moves_with_the_wind_sees_no_change(self):
        later = seen(wind=(3.0, 0.0, -1.0), time=2.0, pose=moved(6.0, 0.0, -2.0))
        assert later == pytest.approx(seen(), abs=1e-6)  # rounding of positions
        assert np.abs(seen(wind=(3.0, 0.0, -1.0), time=2.0) - seen()).max() > 0.01

    def test_a_turned_camera_sees_it_at_other_pixels(self):
        upside_down = ((-1.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
        centred = np.array([[70.0, 0, 39.5], [0, 70, 29.5], [0, 0, 1]])
        flat = np.full((HEIGHT, WIDTH), 30.0)
        turned = along_rays(flat, centred, pose=upside_down, rng=rng())
        # Between nodes, which begin at the left of the picture, noise is linear: within 3e-3 at 16 nodes per cell.
        assert turned[::-1, ::-1] == pytest.approx(along_rays(flat, centred, rng=rng()), abs=3e-3)

    def test_nothing_flickers_between_frames(self):
        frames = [seen(wind=(0.5, 0.0, 0.0), time=frame / 25) for frame in range(3)]
        change = np.abs(np.diff(frames, axis=0)).max()
        # 2 cm per frame in fog whose finest cells are 2.5 m: 1 % of a density that varies by 0.3.
        assert 0 < change < 0.01
        assert np.abs(np.diff(frames, n=2, axis=0)).max() < 0.1 * change  # and it goes on steadily

    def test_depth_that_grows_leaves_no_steps(self):
        ranges = np.linspace(1, 190, 4000)[None].astype(np.float64)
        thickness = along_rays(ranges, np.array([[1e9, 0, 0], [0, 1e9, 0], [0, 0, 1.0]]), rng=rng()) * ranges
        # The thickness grows by the density, 1 ± 0.3, times the distance between two columns.
        growth = np.diff(thickness) / np.diff(ranges)
        assert growth.min() > 0
        assert growth.max() < 3

    def test_finer_steps_converge(self):
        fine = seen(growth=0.02)
        errors = [np.sqrt(np.mean((seen(growth=growth) - fine) ** 2)) for growth in (0.4, 0.2, 0.1, 0.05)]
        assert errors == sorted(errors, reverse=True)
        assert errors[2] < 0.03

    def test_the_mean_over_many_worlds_is_1(self):
        coarse = planar_to_radial(np.full((6, 8), 60.0), SMALL)
        worlds = [along_rays(coarse, SMALL, rng=np.random.default_rng(seed)) for seed in range(100)]
        means = np.mean(worlds, axis=(1, 2))
        assert means.mean() == pytest.approx(1, abs=float(4 * means.std() / 10))  # four standard errors
        assert 0.03 < means.std() < 0.15  # or the mean would be 1 for want of fog

    def test_the_sky_and_the_unknown_have_the_mean_density(self):
        rho = along_rays(np.array([[np.inf, np.nan, 0.0, 1e30]]), CAMERA, rng=rng())
        assert rho == pytest.approx(1)

    @pytest.mark.parametrize("parameters", [{"octaves": 0}, {"contrast": 0.0}])
    def test_no_octaves_or_no_contrast_is_a_homogeneous_medium(self, parameters):
        assert (seen(**parameters) == 1).all()

    def test_the_same_bytes_for_any_number_of_threads(self):
        large = np.full((200, 300), 50, np.float32)
        maps = []
        for threads in (1, 2):
            bands.set_threads(threads)
            maps.append(along_rays(large, CAMERA, rng=rng()).tobytes())
        assert maps[0] == maps[1]

    def test_what_is_no_pose_or_range_is_refused(self):
        with pytest.raises(ValueError, match="pose must be three rows"):
            seen(pose=((2.0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0, 1.0, 0)))
        with pytest.raises(ValueError, match="wind and time must be finite"):
            seen(time=np.inf, wind=(1.0, 0, 0))
        with pytest.raises(ValueError, match="range_map is negative"):
            seen(-WALL)
