"""Relighting, extinction and airlight in hue, lightness and saturation."""

from __future__ import annotations

import colorsys
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.kernels import bands
from fogpipe.kernels.hls import highlight_threshold, lightness, pure_hue
from fogpipe.stages.participating import PRESETS, density, fog, highlights, medium, relight

NIGHT = 220.0
COLOURS = np.random.default_rng(3).random((30, 40, 3), np.float32)
PIXELS = hnp.arrays(np.float32, (3, 4, 3), elements=st.floats(0, 1e4, width=32))


def number(value):
    return np.array(float(value))


def hls(image):
    """Hue in degrees, lightness, saturation without an upper end."""
    flat = np.asarray(image, np.float64).reshape(-1, 3)
    hue = [360 * colorsys.rgb_to_hls(*(pixel / max(pixel.max(), 1e-30)))[0] for pixel in flat]
    most, least = flat.max(axis=1), flat.min(axis=1)
    saturation = np.divide(most - least, most + least, out=np.zeros_like(most), where=most > 0)
    return np.array(hue), (most + least) / 2, saturation


def foggy(image=COLOURS, depth=1.0, k=0.6, sigma=0.35, light=0.25, saturation=0.2, rho=None):
    depth_map = np.full(image.shape[:2], depth, np.float32)
    return fog(image, depth_map, number(k), number(sigma), number(light), number(saturation), rho)


class TestMedium:
    def test_the_nine_media_are_those_of_table_1_in_the_paper(self, shared_data):
        paper = (shared_data.parent / "papers" / "002_1fe63db4d00330e0.txt").read_text(encoding="utf-8")
        rows = re.findall(r"^(House|Forest|Statue) \((left|center|right)\)\t(.*)$", paper, flags=re.MULTILINE)
        table = {
            f"{picture.lower()}-{place.replace('center', 'centre')}": tuple(map(float, values.split()))
            for picture, place, values in rows
        }
        assert len(table) == 9
        assert table == PRESETS

    # Some rows of the table as the paper prints it, from the left to the right picture.
    @pytest.mark.parametrize(
        ("preset", "values"),
        [
            ("house-left", (1.2, 0.8, 0.6, 0.2, 5, 250)),
            ("forest-centre", (0.5, 0.35, 0.15, 0.35, 5, 400)),
            ("statue-right", (0.75, 0.5, 0.025, 0.04, 5, 750)),
        ],
    )
    def test_a_preset_is_a_row_of_table_1(self, preset, values):
        assert tuple(map(float, medium(preset=preset))) == values

    def test_single_values_replace_those_of_the_preset(self):
        changed = medium(preset="house-left", extinction=0.3, octaves=0)
        assert float(changed.extinction) == 0.3
        assert int(changed.octaves) == 0
        assert float(changed.scattering) == 0.8


class TestDensity:
    def test_octaves_and_period_come_from_the_medium(self):
        rng = np.random.default_rng
        rough = density(COLOURS, number(3), number(8), rng=rng(1))
        assert rough.std() > 2 * density(COLOURS, number(1), number(1000), rng=rng(1)).std()
        assert (density(COLOURS, number(0), number(8), rng=rng(1)) == 1).all()


class TestHighlights:
    # A scene with a lamp: a broad range of darker tones, and 2 % that are brighter by four to six f-stops.
    RNG = np.random.default_rng(0)
    SCENE = np.concatenate([RNG.lognormal(-2, 0.7, 9800), RNG.uniform(4, 16, 200)]).reshape(100, 100)
    LAMP = np.repeat(SCENE[..., None], 3, axis=2).astype(np.float32)

    def test_they_begin_between_the_scene_and_the_lamp(self):
        threshold = highlight_threshold(lightness(self.LAMP))
        assert np.quantile(self.SCENE, 0.6) < threshold < 4

    def test_the_scene_stays_and_the_lamp_gets_darker_but_keeps_its_order(self):
        threshold = highlight_threshold(lightness(self.LAMP))
        after = highlights(self.LAMP)
        below = threshold >= self.SCENE
        assert np.array_equal(after[below], self.LAMP[below])
        order = np.argsort(self.SCENE, axis=None)
        assert (np.diff(after[..., 0].ravel()[order]) >= 0).all()
        assert after.max() < 0.5 * self.LAMP.max()

    def test_hue_and_saturation_stay(self):
        coloured = self.LAMP * np.array([1, 0.6, 0.2], np.float32)
        hue, _, saturation = hls(highlights(coloured))
        # Rounding in single precision, in a ratio of differences.
        assert hue == pytest.approx(hls(coloured)[0], abs=1e-2)
        assert saturation == pytest.approx(hls(coloured)[2], abs=1e-5)

    def test_little_compression_is_none(self):
        # 1 + ln(1 + c x) / c = 1 + x − c x² / 2 …, relative to 1 + x at most c x / 2 with x below 250.
        assert highlights(self.LAMP, compression=1e-6) == pytest.approx(self.LAMP, rel=2e-4)

    @pytest.mark.parametrize("value", [0.0, 1.0, 1e4])
    def test_a_picture_of_one_lightness_has_none(self, value):
        image = np.full((6, 7, 3), value, np.float32)
        assert np.array_equal(highlights(image), image)

    def test_exposure_moves_the_threshold_along(self):
        usual = highlight_threshold(lightness(self.LAMP))
        assert highlight_threshold(lightness(self.LAMP * np.float32(1024))) == pytest.approx(1024 * usual)


class TestRelight:
    def test_saturation_falls_by_k(self):
        grey = relight(COLOURS, number(0.3), number(0), shadow_lift=0)
        assert hls(grey)[2] == pytest.approx(0.7 * hls(COLOURS)[2], abs=1e-5)  # single precision
        assert hls(grey)[1] == pytest.approx(hls(COLOURS)[1], abs=1e-6)

    @pytest.mark.parametrize("k", [1.0, 1.2])
    def test_from_k_of_1_on_everything_is_grey(self, k):
        assert np.ptp(relight(COLOURS, number(k), number(0.5)), axis=2).max() < 1e-6

    def test_no_medium_and_no_lift_change_nothing(self):
        assert relight(COLOURS, number(0), number(0), shadow_lift=0) == pytest.approx(COLOURS, abs=1e-6)

    def test_a_thing_at_no_distance_stays_as_it_is_in_any_medium(self):
        near = relight(COLOURS, number(1.2), number(0.8), np.zeros((30, 40), np.float32))
        assert near == pytest.approx(COLOURS, abs=1e-6)

    def test_with_depth_each_change_grows_in_proportion(self):
        halfway = np.full((30, 40), 0.5, np.float32)
        found = relight(COLOURS, number(1.2), number(0.8), halfway, shadow_lift=0.5)
        # Half of each share, all over the picture: single precision.
        assert found == pytest.approx(relight(COLOURS, number(0.6), number(0.4), shadow_lift=0.25), abs=1e-6)

    def test_as_published_depth_does_not_matter(self):
        depth = np.linspace(0, 1, 1200, dtype=np.float32).reshape(30, 40)
        everywhere = relight(COLOURS, number(1.2), number(0.8), depth, reach="everywhere")
        assert np.array_equal(everywhere, relight(COLOURS, number(1.2), number(0.8)))

    def test_hue_goes_over_to_that_of_the_airlight(self):
        towards = relight(COLOURS, number(0), number(1), shadow_lift=0, airlight_hue=NIGHT)
        coloured = hls(COLOURS)[2] > 0.05
        assert hls(towards)[0][coloured] == pytest.approx(NIGHT, abs=0.1)

    def test_hues_do_not_jump(self):
        """Around the circle of hues, and for any share of the airlight, near colours stay near."""
        circle = np.array([[pure_hue(angle) for angle in np.arange(0, 360, 0.5)]], np.float32)
        for sigma in np.linspace(0, 1, 21):
            after = relight(circle, number(0.2), number(sigma), shadow_lift=0, airlight_hue=NIGHT)
            # Half a degree changes a pure colour by 1/120 in one channel; the blend is no expansion of that, but for
            # the shift that keeps the lightness.
            assert np.abs(np.diff(after, axis=1)).max() < 1.5 / 120

    def test_a_hue_is_blended_the_short_way_round(self):
        red = np.array([[pure_hue(350.0)]], np.float32)
        blend = relight(red, number(0), number(0.5), shadow_lift=0, airlight_hue=30)
        hue = hls(blend)[0][0]
        assert hue < 30 or hue > 350

    def test_shadows_are_lifted_and_stay_in_order(self):
        ramp = np.repeat(np.linspace(0, 1, 500, dtype=np.float32)[None, :, None], 3, axis=2)
        lifted = relight(ramp, number(0), number(0))[0, :, 0]
        shadow = np.quantile(ramp, 0.999) / 5
        assert lifted[0] == pytest.approx(0.5 * shadow, rel=0.01)
        assert (np.diff(lifted) > 0).all()
        light = ramp[0, :, 0] > 1.01 * shadow
        assert lifted[light] == pytest.approx(ramp[0, light, 0], abs=1e-6)

    def test_as_published_the_lift_is_a_step(self):
        ramp = np.repeat(np.linspace(0, 1, 500, dtype=np.float32)[None, :, None], 3, axis=2)
        lifted = relight(ramp, number(0), number(0), shadows="published")[0, :, 0]
        assert np.diff(lifted).min() == pytest.approx(-0.5 / 5, abs=0.01)  # S_R T, down

    def test_one_pixel_does_not_decide_what_is_a_shadow(self):
        sun = np.full((100, 100, 3), 0.5, np.float32)
        sun[50, 50] = 1e4
        assert relight(sun, number(0), number(0))[0, 0] == pytest.approx(0.5, abs=1e-6)


class TestFog:
    @given(image=PIXELS, depth=st.floats(0, 1), k=st.floats(0, 3), sigma=st.floats(0, 2), light=st.floats(0, 10))
    def test_lightness_is_that_of_equation_4(self, image, depth, k, sigma, light):
        after = foggy(image, depth, k, sigma, light)
        before, z = lightness(image.astype(np.float64)), float(np.float32(depth))
        expected = before * np.exp(-k * z) + sigma * z * light
        # Single precision, of the largest of the numbers that are added.
        assert lightness(after) == pytest.approx(
            expected, abs=1e-6 * (1 + float(image.max()) + light * sigma), rel=1e-5
        )

    @given(image=PIXELS, saturation=st.floats(0, 1))
    def test_no_colour_becomes_negative(self, image, saturation):
        assert foggy(image, saturation=saturation).min() >= 0

    def test_nothing_changes_at_no_distance(self):
        assert foggy(depth=0.0) == pytest.approx(COLOURS, abs=1e-7)

    def test_it_thickens_with_depth(self):
        depths = [foggy(depth=z, light=0.9) for z in (0, 0.3, 0.6, 1)]
        contrasts = [image.std() for image in depths]
        assert contrasts == sorted(contrasts, reverse=True)

    def test_density_thickens_it_as_depth_does(self):
        rho = np.full((30, 40), 0.5, np.float32)
        assert foggy(depth=1.0, rho=rho) == pytest.approx(foggy(depth=0.5), abs=1e-6)

    def test_black_takes_the_colour_of_the_airlight(self):
        colour = foggy(np.zeros((2, 2, 3), np.float32), saturation=0.4)
        hue, level, saturation = hls(colour)
        assert level == pytest.approx(0.35 * 0.25, rel=1e-5)
        assert saturation == pytest.approx(0.4, rel=1e-5)
        assert hue == pytest.approx(NIGHT, abs=0.01)

    def test_highlights_do_not_clip(self):
        bright = np.array([[[1e4, 5e3, 1e3], [2e4, 1e4, 2e3]]], np.float32)
        after = foggy(bright)
        assert after[0, 1] == pytest.approx(2 * after[0, 0], rel=1e-3)  # the airlight is small beside them
        assert hls(after)[0] == pytest.approx(hls(bright)[0], abs=0.1)

    def test_hues_do_not_jump(self):
        circle = np.array([[pure_hue(angle) for angle in np.arange(0, 360, 0.5)]], np.float32)
        for light in (0.2, 1.0, 1.9, 2.1):
            assert np.abs(np.diff(foggy(circle, light=light), axis=1)).max() < 1.5 / 120


class TestBadInput:
    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_a_picture_with_a_hole_is_refused_with_the_place(self, value):
        image = COLOURS.copy()
        image[4, 9, 1] = value
        for call in (lambda: highlights(image), lambda: relight(image, number(1), number(1)), lambda: foggy(image)):
            with pytest.raises(ValueError, match=r"image is .* at 1 of .* at index \(4, 9"):
                call()

    def test_unknown_depth_is_refused_with_the_place(self):
        unknown = np.full((30, 40), np.nan, np.float32)
        for call in (lambda: foggy(depth=np.nan), lambda: relight(COLOURS, number(1), number(1), unknown)):
            with pytest.raises(ValueError, match=r"depth is .* at 1200 of .* at index \(0, 0"):
                call()

    def test_depth_of_another_size_is_refused(self):
        with pytest.raises(ValueError, match="depth has 39 × 30 pixels but image has 40 × 30"):
            relight(COLOURS, number(1), number(1), np.ones((30, 39), np.float32))

    @pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
    def test_what_is_no_coefficient_is_refused(self, value):
        with pytest.raises(ValueError, match="scattering must be a finite number of 0 or more"):
            relight(COLOURS, number(0.5), number(value))

    def test_negative_light_counts_as_none(self):
        image = COLOURS.copy()
        image[0, 0] = -0.5
        assert np.array_equal(foggy(image)[0, 0], foggy(np.maximum(image, 0))[0, 0])


def test_the_same_bytes_for_any_number_of_threads():
    image = np.random.default_rng(8).random((200, 300, 3), np.float32)
    usual, results = bands.threads(), []
    for threads in (1, 2):
        bands.set_threads(threads)
        relit = relight(highlights(image), number(0.3), number(0.4))
        results.append(foggy(relit, depth=0.7).tobytes())
    bands.set_threads(usual)
    assert results[0] == results[1]
