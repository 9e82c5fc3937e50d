"""Depth from layers, planes and shading."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from fogpipe.stages.depth import to_range
from fogpipe.stages.layers import backdrop, flat, plane, polygon, shading, structure

IMAGE = np.full((40, 60, 3), 0.2, np.float32)
FAR = backdrop(IMAGE)
LEFT = np.zeros((40, 60), bool)
LEFT[:, :30] = True
EVERYWHERE = np.ones((40, 60), bool)
NOWHERE = np.zeros((40, 60), bool)


class TestPolygon:
    def test_corners_are_shares_of_the_picture(self):
        assert np.array_equal(polygon(IMAGE, corners=((0, 0), (0.5, 0), (0.5, 1), (0, 1))), LEFT)

    def test_the_same_polygon_on_a_larger_picture_is_the_same_region(self):
        corners = ((0.1, 0.2), (0.8, 0.1), (0.6, 0.9))
        small = polygon(IMAGE, corners=corners)
        large = polygon(np.zeros((120, 180, 3)), corners=corners)
        assert np.array_equal(large[1::3, 1::3], small)  # the centres of the small pixels are centres of large ones

    def test_by_default_it_is_the_whole_picture(self):
        assert polygon(IMAGE).all()

    def test_it_may_reach_out_of_the_picture_or_be_outside_of_it(self):
        assert polygon(IMAGE, corners=((-5, -5), (9, -5), (9, 9), (-5, 9))).all()
        assert not polygon(IMAGE, corners=((2, 2), (3, 2), (3, 3))).any()

    def test_a_corner_that_is_no_place_is_refused(self):
        with pytest.raises(ValueError, match="corners must be finite"):
            polygon(IMAGE, corners=((0, 0), (1, 0), (np.nan, 1)))


class TestFlat:
    def test_layers_lie_over_each_other_in_order(self):
        top = np.zeros((40, 60), bool)
        top[:20] = True
        one = flat(flat(FAR, LEFT, depth="middle"), top, depth="close-up")
        other = flat(flat(FAR, top, depth="close-up"), LEFT, depth="middle")
        assert one[0, 0] == np.float32(0.1)
        assert other[0, 0] == np.float32(0.5)
        assert one[0, 59] == other[0, 59] == np.float32(0.1)
        assert one[39, 59] == other[39, 59] == 1

    @pytest.mark.parametrize(("name", "depth"), [("close-up", 0.1), ("middle", 0.5), ("background", 1)])
    def test_the_planes_of_a_composition_have_names(self, name, depth):
        assert (backdrop(IMAGE, depth=name) == np.float32(depth)).all()
        assert (flat(FAR, EVERYWHERE, depth=name) == np.float32(depth)).all()

    def test_an_empty_mask_changes_nothing(self):
        assert np.array_equal(flat(FAR, NOWHERE, IMAGE, depth=0.2, feather=5), FAR)

    def test_feather_follows_an_edge_that_the_mask_misses(self):
        image = IMAGE.copy()
        image[:, 33:] = 0.8  # the object ends 3 px farther to the right than the mask
        depth = flat(FAR, LEFT, image, depth=0.0, feather=5)
        assert depth[20, 31] < 0.5 < depth[20, 34]
        assert depth[20, 33:].min() > 0.9
        assert depth[20, 15] == 0

    def test_feather_in_a_plain_region_is_a_ramp(self):
        row = flat(FAR, LEFT, IMAGE, depth=0.0, feather=4)[20]
        assert (np.diff(row) >= 0).all()
        assert np.diff(row).max() < 0.3  # a hard edge jumps by 1

    def test_only_the_surroundings_of_the_mask_are_filtered_and_nobody_can_tell(self):
        noisy = np.random.default_rng(2).random((80, 120, 3), np.float32)
        below = backdrop(noisy)
        near = polygon(noisy, corners=((0.3, 0.3), (0.5, 0.3), (0.4, 0.6)))
        both = near.copy()
        both[78:, 115:] = True  # far from the first, so that everything in between is filtered
        alone, together = (flat(below, mask, noisy, depth=0.2, feather=3) for mask in (near, both))
        # The filter sums in an order that depends on the width of what it is given: single precision.
        assert alone[:70, :100] == pytest.approx(together[:70, :100], abs=1e-6)

    def test_feather_without_a_picture_is_refused(self):
        with pytest.raises(ValueError, match="wire image"):
            flat(FAR, LEFT, depth=0.0, feather=4)

    def test_a_mask_of_another_size_is_refused(self):
        with pytest.raises(ValueError, match="mask has 59 × 40 pixels but below has 60 × 40"):
            flat(FAR, LEFT[:, 1:], depth=0.5)

    def test_a_picture_with_a_hole_is_refused_with_the_place(self):
        image = IMAGE.copy()
        image[3, 7] = np.nan
        with pytest.raises(ValueError, match=r"at index \(3, 7"):
            flat(FAR, LEFT, image, depth=0.5, feather=2)

    def test_the_same_bytes_for_any_number_of_threads(self):
        noisy = np.random.default_rng(0).random((200, 300, 3), np.float32)
        mask = polygon(noisy, corners=((0.2, 0.1), (0.9, 0.5), (0.3, 0.9)))
        below, results = backdrop(noisy), []
        usual = cv2.getNumThreads()
        for threads in (1, 2):
            cv2.setNumThreads(threads)
            results.append(flat(below, mask, noisy, depth=0.3, feather=3).tobytes())
            results.append(shading(below, mask, noisy).tobytes())
            results.append(structure(below, mask, noisy).tobytes())
        cv2.setNumThreads(usual)
        assert results[:3] == results[3:]


class TestPlane:
    def test_a_receding_plane_has_an_inverse_distance_that_is_linear_in_the_image(self):
        # A camera 1.5 m above the ground sees row v below the horizon at 1.5 f / v: 5 m at the bottom, 100 m far up.
        rows = np.arange(40)
        distance = 1 / np.interp(rows, [9.5, 39.5], [1 / 100, 1 / 5])
        ground = plane(
            FAR,
            EVERYWHERE,
            near_point=(0.5, 1.0),
            far_point=(0.5, 0.25),
            near=0,
            far=1,
            nearest=0.05,
            form="perspective",
        )
        metres = to_range(ground, near=5, far=100, law="linear")
        # Rounding of depths in single precision.
        assert metres[10:, 7] == pytest.approx(distance[10:], rel=1e-5)
        assert metres[:10] == pytest.approx(100, rel=1e-6)

    def test_a_linear_plane_has_a_distance_that_is_linear_in_the_image(self):
        ramp = plane(FAR, EVERYWHERE, near_point=(0, 0.5), far_point=(1, 0.5), near=0.2, far=0.8, form="linear")
        assert ramp[5] == pytest.approx(0.2 + 0.6 * (np.arange(60) + 0.5) / 60, abs=1e-6)

    def test_a_line_at_a_slant_is_the_same_across_it(self):
        # In pixels: the line of 45° from the upper left corner; points of one antidiagonal have one depth.
        slant = plane(FAR, EVERYWHERE, near_point=(0, 0), far_point=(40 / 60, 1), form="linear")
        assert slant[10, 20] == pytest.approx(slant[20, 10], abs=1e-6)
        assert slant[10, 20] == pytest.approx(31 / 80, abs=1e-6)

    def test_depth_may_fall_along_the_line(self):
        wall = plane(FAR, EVERYWHERE, near_point=(0, 0), far_point=(1, 0), near=0.9, far=0.1)
        assert (np.diff(wall[0]) < 0).all()

    def test_it_stays_within_its_mask(self):
        depth = plane(FAR, LEFT, near=0, far=0.5)
        assert (depth[:, 30:] == 1).all()
        assert depth[:, :30].max() <= 0.5

    def test_two_points_in_one_place_are_refused(self):
        with pytest.raises(ValueError, match="a plane needs two points"):
            plane(FAR, LEFT, near_point=(0.5, 0.5), far_point=(0.5, 0.5))

    def test_a_plane_in_perspective_cannot_begin_at_the_camera(self):
        with pytest.raises(ValueError, match="cannot begin at a distance of 0"):
            plane(FAR, LEFT, near=0, far=1, nearest=0)


class TestShading:
    RAMP = np.repeat(np.geomspace(0.01, 1, 60, dtype=np.float32)[None, :, None], 3, axis=2).repeat(40, axis=0)

    def test_brighter_is_nearer(self):
        depth = shading(FAR, EVERYWHERE, self.RAMP, near=0.2, far=0.9, smooth=0)
        assert (np.diff(depth[0]) <= 0).all()
        assert depth[0, -1] == pytest.approx(0.2)
        assert depth[0, 0] == pytest.approx(0.9)

    def test_or_darker_is(self):
        depth = shading(FAR, EVERYWHERE, self.RAMP, near=0.9, far=0.2, smooth=0)
        assert (np.diff(depth[0]) >= 0).all()

    @pytest.mark.parametrize("exposure", [1e-3, 1e4])
    def test_exposure_does_not_matter(self, exposure):
        usual = shading(FAR, EVERYWHERE, self.RAMP)
        assert shading(FAR, EVERYWHERE, self.RAMP * np.float32(exposure)) == pytest.approx(usual, abs=1e-4)

    def test_only_the_region_counts(self):
        image = self.RAMP.copy()
        image[:, 30:] = 1e4
        inside = shading(FAR, LEFT, image, smooth=0)
        assert inside[:, :30].min() == pytest.approx(0)  # the brightest of the region, not of the picture
        assert (inside[:, 30:] == 1).all()

    def test_smoothing_keeps_edges(self):
        rng = np.random.default_rng(5)
        image = np.where(LEFT[..., None], 0.1, 0.8) * np.exp(rng.normal(0, 0.05, (40, 60, 1)))
        image = np.repeat(image, 3, axis=2).astype(np.float32)
        rough, smooth = (shading(FAR, EVERYWHERE, image, smooth=s) for s in (0, 4))
        assert smooth[:, 5:25].std() < 0.5 * rough[:, 5:25].std()
        assert smooth[:, 28].mean() - smooth[:, 31].mean() > 0.8  # of 1

    @pytest.mark.parametrize("value", [0.0, 1e4])
    def test_a_region_of_one_luminance_has_one_depth(self, value):
        depth = shading(FAR, EVERYWHERE, np.full((40, 60, 3), value, np.float32))
        assert np.ptp(depth) == 0

    def test_a_span_that_is_none_is_refused(self):
        with pytest.raises(ValueError, match="span must go from a lower"):
            shading(FAR, LEFT, IMAGE, span=(0.5, 0.5))


class TestStructure:
    SKY = np.array([0.02, 0.05, 0.15]) * np.linspace(1, 3, 120)[:, None, None] * np.ones((120, 160, 1))
    """A gradient of a factor of 3, as in a sky."""
    MASK = np.ones((120, 160), bool)
    BELOW = np.ones((120, 160))

    def lattice(self, colour):
        """Lines of 1 to 7 px over the sky."""
        image, lines = self.SKY.copy(), np.zeros((120, 160), bool)
        for x, wide in ((20, 1), (50, 2), (80, 3), (110, 5), (140, 7)):
            lines[:, x : x + wide] = True
        lines |= np.abs(np.subtract.outer(np.arange(120), np.arange(160) / 2)) < 1
        image[lines] = colour
        return image, lines

    @pytest.mark.parametrize(
        "colour",
        [(0, 0, 0), (0.03, 0.02, 0.01), (0.3, 0.25, 0.1), (1e4, 1e4, 1e4)],
        ids=["black", "rust", "lit", "lamp"],
    )
    def test_lines_are_whole_and_the_sky_between_them_stays(self, colour):
        image, lines = self.lattice(colour)
        depth = structure(self.BELOW, self.MASK, image, depth=0.0, width=10)
        assert depth[lines].max() < 0.05
        beside = cv2.dilate(lines.astype(np.uint8), np.ones((7, 7))) > 0  # the reach of the filter that joins lines
        assert depth[~beside].min() > 0.99

    def test_faint_lines_are_relative_to_what_is_near_them(self):
        image = self.SKY.copy()
        image[:, 30:32] *= 0.55  # differs by 0.29
        alone = structure(self.BELOW, self.MASK, image, depth=0.0, width=10, contrast=0.3)
        image[:, 38:40] *= 0.05
        beside_black = structure(self.BELOW, self.MASK, image, depth=0.0, width=10, contrast=0.3)
        assert alone[:, 30:32].max() < 0.05
        assert 0.05 < beside_black[60, 30] < 0.95
        assert beside_black[60, 38] < 0.05

    def test_a_smooth_picture_has_none_in_spite_of_noise(self):
        noisy = self.SKY * np.random.default_rng(4).normal(1, 0.05, self.SKY.shape)
        depth = structure(self.BELOW, self.MASK, noisy, depth=0.0)
        assert depth.mean() > 0.99

    def test_the_border_of_the_region_is_no_seam(self):
        image, _ = self.lattice((0, 0, 0))
        image[58:62] = 0  # crosses the border
        mask = self.MASK.copy()
        mask[:, 100:] = False
        depth = structure(self.BELOW, mask, image, depth=0.0, width=20)
        assert (depth[:, 100:] == 1).all()
        # It fades over half of the width, 10 px.
        assert np.abs(np.diff(depth[60, 85:105])).max() < 0.15

    @pytest.mark.parametrize("exposure", [1e-3, 1e4])
    def test_exposure_does_not_matter(self, exposure):
        image, _ = self.lattice((0.03, 0.02, 0.01))
        usual = structure(self.BELOW, self.MASK, image)
        assert structure(self.BELOW, self.MASK, image * exposure) == pytest.approx(usual, abs=1e-3)

    def test_only_the_surroundings_of_the_region_are_looked_at_and_nobody_can_tell(self):
        image, _ = self.lattice((0.03, 0.02, 0.01))
        near, both = np.zeros((2, 120, 160), bool)
        near[20:40, 10:25] = both[20:40, 10:25] = True
        both[100:, 150:] = True
        alone, together = (structure(self.BELOW, mask, image, width=3) for mask in (near, both))
        assert alone[:60, :60] == pytest.approx(together[:60, :60], abs=1e-6)  # sums in another order

    @pytest.mark.parametrize("value", [0.0, 1.0, 1e4])
    def test_a_picture_of_one_light_has_none(self, value):
        flat_image = np.full((40, 60, 3), value, np.float32)
        # One of 255 tones, as a share of the least contrast: far from a tenth.
        assert np.array_equal(structure(FAR, EVERYWHERE, flat_image, depth=0.0), FAR)


@pytest.mark.parametrize("shape", [(1, 50), (50, 1), (1, 1)])
def test_pictures_of_one_row_or_column(shape):
    image = np.random.default_rng(1).random((*shape, 3), np.float32)
    far, mask = backdrop(image), np.ones(shape, bool)
    for depth in (
        flat(far, mask, image, depth=0.3, feather=3),
        plane(far, mask, image, feather=3),
        shading(far, mask, image, feather=3),
        structure(far, mask, image, depth=0.3, width=3),
    ):
        assert depth.shape == shape
        assert ((depth >= 0) & (depth <= 1)).all()
