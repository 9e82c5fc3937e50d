"""Perlin noise: its statistics, and that a value depends on nothing but its place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fogpipe.kernels import bands
from fogpipe.kernels.perlin import amplitude, density, field, octave_shift

PERIOD, SIZE, KEYS = 32, 512, 12
FOLDS = SIZE // PERIOD


def many(octaves, noise="gradient"):
    return [
        field(SIZE, SIZE, 7919 * key, period=PERIOD, octaves=octaves, noise=noise, tileable=True).astype(np.float64)
        for key in range(KEYS)
    ]


def band_power(fields, band, angles=(0, 45)):
    """Power in the frequencies of octave ``band``, in angles from the nearer axis; mean over the fields."""
    y, x = np.meshgrid(np.fft.fftfreq(SIZE), np.fft.fftfreq(SIZE), indexing="ij")
    frequency, angle = np.hypot(x, y) * PERIOD, np.degrees(np.arctan2(abs(y), abs(x)))
    from_axis = np.minimum(angle, 90 - angle)
    ring = (frequency >= 2.0 ** (band - 1)) & (frequency < 2.0**band)
    ring &= (from_axis >= angles[0]) & (from_axis <= angles[1])
    return float(np.mean([np.mean(abs(np.fft.fft2(noise))[ring] ** 2) for noise in fields]))


@pytest.mark.parametrize("noise", ["gradient", "value"])
@pytest.mark.parametrize("octaves", [1, 5])
def test_noise_has_mean_0_and_variance_1(noise, octaves):
    fields = np.array(many(octaves, noise))
    # 12 fields of 256 cells: values at corners have a standard error of √(2.26 / 3072) = 0.027 in the mean and less
    # than 0.04 in the variance; three of them.
    assert abs(fields.mean()) < 0.08
    assert fields.var() == pytest.approx(1, abs=0.12)


def test_each_octave_has_a_quarter_of_the_power_at_twice_the_frequency():
    fields = many(5)
    # Power per frequency: a quarter of the variance on four times the area is 1/16, 12 dB less. The bands of the
    # first and the last octave lack a neighbour that spills into them. Sampling error of a band is below 10 %.
    falls = [band_power(fields, band + 1) / band_power(fields, band) for band in (1, 2)]
    assert falls == pytest.approx([1 / 16, 1 / 16], rel=0.25)


@pytest.mark.parametrize("band", [0, 1, 2, 3])
def test_no_direction_of_the_lattice_has_more_power_than_stated(band):
    fields = many(5)
    ratio = band_power(fields, band, (0, 15)) / band_power(fields, band, (30, 45))
    assert 0.9 < ratio < 1.35  # stated: 30 %; the sampling error is about 3 %


def test_the_mean_shows_no_lattice():
    folded = sum(_fold(noise, key).mean(axis=(0, 2)) for key, noise in enumerate(many(5))) / KEYS
    # The mean over 12 · 256 cells of noise of variance 1: a standard error of 0.018 at most.
    assert np.abs(folded).max() < 4 * 0.018


def test_the_variance_shows_no_more_of_the_lattice_than_stated():
    folded = sum((_fold(noise, key) ** 2).mean(axis=(0, 2)) for key, noise in enumerate(many(5))) / KEYS
    # Stated: 0.26 to 1.4. The standard error is √(2 / 3072) = 2.6 %. A sum of octaves with common corners is at 0.
    assert 0.22 < folded.min() < 0.30
    assert folded.max() < 1.55


def _fold(noise, key):
    """The noise cut at the corners of the first octave's cells: (cell, row, cell, column)."""
    shift = [-round((1 - octave_shift(7919 * key, 0, axis)) * PERIOD) for axis in (0, 1)]
    return np.roll(noise, shift, (0, 1)).reshape(FOLDS, PERIOD, FOLDS, PERIOD)


@pytest.mark.parametrize("period", [0.7 * 64, 250.0, 3.0])
def test_a_larger_field_continues_a_smaller_one(period):
    large = field(300, 411, 5, period=period, octaves=4)
    assert np.array_equal(field(123, 77, 5, period=period, octaves=4), large[:123, :77])


def test_a_tileable_field_continues_at_the_opposite_border():
    noise = field(96, 160, 3, period=32, octaves=3, tileable=True)
    within = max(np.abs(np.diff(noise, axis=axis)).max() for axis in (0, 1))
    across = max(np.abs(noise[0] - noise[-1]).max(), np.abs(noise[:, 0] - noise[:, -1]).max())
    assert across <= within
    rough = field(96, 160, 3, period=32, octaves=3)
    assert max(np.abs(rough[0] - rough[-1]).max(), np.abs(rough[:, 0] - rough[:, -1]).max()) > 2 * within


def test_the_same_bytes_for_any_number_of_threads():
    fields = []
    for threads in (1, 2, 5):
        bands.set_threads(threads)
        fields.append(field(301, 407, 9, period=50, octaves=5).tobytes())
    bands.set_threads(2)
    assert len(set(fields)) == 1


def test_keys_draw_different_fields():
    one, other = (field(SIZE, SIZE, key, period=PERIOD, octaves=5) for key in (1, 2))
    correlation = np.corrcoef(one.ravel(), other.ravel())[0, 1]
    assert abs(correlation) < 4 / FOLDS  # a standard error of 1 / √(number of cells)


@pytest.mark.parametrize("period", [1e6, 1e30])
def test_a_period_larger_than_the_image_gives_nearly_one_value(period):
    noise = field(40, 50, 3, period=period, octaves=2)
    assert np.isfinite(noise).all()
    assert np.ptp(noise) < 1e-3


def test_no_octaves_are_no_noise():
    assert not field(4, 5, 1, period=10, octaves=0).any()


@pytest.mark.parametrize("contrast", [0.0, 0.3, 1.0])
def test_density_has_mean_1_and_the_standard_deviation_asked_for(contrast):
    normal = np.random.default_rng(1).standard_normal((1000, 1000), np.float32)
    rho = density(normal, contrast)
    # A million independent values: standard errors of 1e-3 in the mean, 2e-3 in the deviation; four of them.
    assert rho.mean() == pytest.approx(1, abs=4e-3)
    assert rho.std() == pytest.approx(contrast, abs=8e-3)
    assert rho.min() >= 0


def test_no_contrast_is_density_1():
    assert amplitude(0) == 0
    assert (density(np.full((2, 2), 3, np.float32), 0) == 1).all()
    assert math.isclose(amplitude(1), math.sqrt(math.sqrt(2) - 1))
