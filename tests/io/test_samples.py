"""The sample scenes: known metres, exact range, one scene per seed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fogpipe.io.camera import read_camera
from fogpipe.io.samples import SAMPLES, sample_named
from fogpipe.io.samples.motorcycle import CAMERA, motorcycle
from fogpipe.io.samples.outdoor import EYE_HEIGHT, FLAT_LENGTH, outdoor
from fogpipe.kernels import bands
from fogpipe.kernels.rays import radial_to_planar

SIZE = {"width": 480, "height": 300}


@pytest.fixture(scope="module")
def road():
    return outdoor(**SIZE)


def test_every_sample_can_be_made_by_its_name():
    for name in SAMPLES:
        options = ("64x40",) if name == "outdoor" else ()
        frame = sample_named(name).make(*options)
        assert frame.pixels.ndim == 3
        assert frame.range_map is None or frame.range_map.shape == frame.pixels.shape[:2]


class TestMotorcycle:
    def test_planar_depth_is_that_of_the_calibration(self):
        frame = motorcycle()
        depth = radial_to_planar(frame.range_map, CAMERA.matrix)
        # Z = 0.193001·994.978/(d + 31.086) for the largest and smallest d of the file, 59.909 and 7.1914 px.
        assert np.nanmin(depth) == pytest.approx(2.1104, abs=1e-4)
        assert np.nanmax(depth) == pytest.approx(5.0168, abs=1e-4)

    def test_undefined_disparities_are_holes(self):
        frame = motorcycle()
        assert frame.pixels.shape == (500, 741, 3)
        assert np.isnan(frame.range_map).sum() == 27226  # counted in the file: +inf
        assert not np.isinf(frame.range_map).any()

    def test_its_camera_is_what_a_calibration_file_would_give(self, tmp_path):
        calib = "cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]\ndoffs=31.086\nbaseline=193.001\n"
        (tmp_path / "calib.txt").write_text(calib + "width=741\nheight=500\n")
        read = read_camera(tmp_path / "calib.txt")
        np.testing.assert_array_equal(read.matrix, CAMERA.matrix)
        assert (read.baseline, read.doffs, read.size) == (pytest.approx(CAMERA.baseline), CAMERA.doffs, CAMERA.size)


class TestOutdoor:
    def test_ground_pixels_are_on_the_plane(self, road):
        """On the road the range is eye height over the fall of the ray, for every pixel on the plane y = 0."""
        camera = road.camera.matrix
        depth = radial_to_planar(road.range_map.astype(np.float64), camera)
        rows, columns = np.mgrid[: SIZE["height"], : SIZE["width"]]
        fall = (rows - camera[1, 2]) / camera[1, 1]
        with np.errstate(divide="ignore"):
            plane = np.where(fall > 0, EYE_HEIGHT / fall, np.inf)
        x = (columns - camera[0, 2]) / camera[0, 0] * plane
        asphalt = (np.abs(x + 1.5) < 2.8) & (plane < 25) & np.isfinite(plane)
        on_plane = np.isclose(depth, plane, rtol=1e-6)  # range and image are float32
        # Nothing stands on the road, which is straight and 1.5 m to the left of the eye up to here.
        assert asphalt.sum() > 5000
        assert on_plane[asphalt].mean() == 1
        assert depth[on_plane].max() < FLAT_LENGTH + 60
        assert plane[on_plane].max() > 60

    def test_surfaces_are_from_a_few_to_some_hundred_metres_away(self, road):
        assert 5 < np.nanmin(road.range_map) < 10
        assert 300 < np.nanmax(road.range_map) < 500
        assert not np.isinf(road.range_map).any()

    def test_the_sky_is_one_undefined_region_that_touches_the_top(self, road):
        undefined, count = ndimage.label(np.isnan(road.range_map))
        sizes = ndimage.sum_labels(np.ones_like(undefined), undefined, np.arange(1, count + 1))
        sky = 1 + np.argmax(sizes)
        assert (undefined[0] == sky).mean() > 0.7
        assert 0.2 < (undefined == sky).mean() < 0.5
        assert not np.isnan(road.range_map[-1]).any()

    def test_foliage_leaves_many_small_gaps_to_the_sky(self, road):
        undefined, count = ndimage.label(np.isnan(road.range_map))
        sizes = ndimage.sum_labels(np.ones_like(undefined), undefined, np.arange(1, count + 1))
        assert (sizes < 30).sum() > 50

    def test_poles_one_or_two_pixels_wide_have_their_range(self, road):
        """Runs of one or two pixels, much nearer than what is on either side, that go on for a dozen rows."""
        range_map = np.where(np.isnan(road.range_map), np.inf, road.range_map)
        here, after = range_map[:, 1:-2], range_map[:, 2:-1]
        beyond = np.minimum(range_map[:, :-3], range_map[:, 3:]) > 1.2 * here
        one, two = beyond & (after > 1.2 * here), beyond & np.isclose(after, here, rtol=0.01)
        tall = ndimage.uniform_filter1d((one | two).astype(float), 12, axis=0) > 0.99
        columns = np.flatnonzero(tall.any(axis=0))
        assert len(columns) >= 5
        assert here[tall].min() > 10
        assert 60 < here[tall].max() < 160

    def test_the_lamp_is_brighter_than_white(self, road):
        assert road.pixels.max() > 4
        assert 1e-5 < (road.pixels.max(axis=2) > 3).mean() < 0.01

    def test_the_image_is_linear_light_without_gaps(self, road):
        assert road.pixels.dtype == np.float32
        assert np.isfinite(road.pixels).all()
        assert road.pixels.min() >= 0
        # An evening exposure: mean sRGB level around 120 of 255.
        assert 0.12 < road.pixels.mean() < 0.4

    def test_the_same_seed_gives_the_same_bytes_for_any_number_of_threads(self):
        before = bands.threads()
        try:
            made = []
            for count in (1, 2):
                bands.set_threads(count)
                frame = outdoor(7, 96, 60)
                made.append((frame.pixels.tobytes(), frame.range_map.tobytes()))
        finally:
            bands.set_threads(before)
        assert len(set(made)) == 1

    def test_another_seed_gives_another_scene(self, road):
        one, other = road, outdoor(8, **SIZE)
        differ = ~np.isclose(one.range_map, other.range_map, rtol=1e-3, equal_nan=True)
        assert differ.mean() > 0.1

    def test_window_panes_may_be_holes(self, road):
        """Only the range of the panes changes; the image does not."""
        closed, open_ = road, outdoor(**SIZE, holes=True)
        np.testing.assert_array_equal(closed.pixels, open_.pixels)
        gone = np.isnan(open_.range_map) & ~np.isnan(closed.range_map)
        assert 100 < gone.sum() < 0.05 * gone.size
        np.testing.assert_array_equal(open_.range_map[~gone], closed.range_map[~gone])

    def test_any_aspect(self):
        for width, height in ((16, 200), (200, 16)):
            assert outdoor(1, width, height).range_map.shape == (height, width)
