"""The noise of an image, from its smooth parts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from fogpipe.io.images import read_image
from fogpipe.kernels.dehazing.noise import deviation, deviation_of_smooth_parts


def leaves_and_sky(height: int = 256, width: int = 320) -> np.ndarray:
    """A smooth sky over a random texture that fills two thirds of the picture."""
    rng = np.random.default_rng(0)
    image = np.repeat(np.linspace(0.4, 0.8, width)[None, :, None], height, axis=0).repeat(3, axis=2)
    image[height // 3 :] = rng.uniform(0.1, 0.6, (height - height // 3, width, 1))
    return image.astype(np.float32)


@pytest.mark.parametrize("sigma", [2 / 255, 10 / 255])
def test_texture_is_not_noise(sigma):
    image = leaves_and_sky()
    noisy = image + np.random.default_rng(1).normal(0, sigma, image.shape).astype(np.float32)
    # A region has 3 × 1024 details: 1.3 % of standard error, of which the tenth percentile lies below the mean.
    assert deviation_of_smooth_parts(noisy) == pytest.approx(sigma, rel=0.05)
    assert deviation(noisy) > 2 * sigma


def test_what_is_black_or_white_is_passed_over():
    noisy = 0.5 + np.random.default_rng(1).normal(0, 0.02, (256, 256, 3))
    noisy[:, :128] = 1
    assert deviation_of_smooth_parts(noisy) == pytest.approx(0.02, rel=0.05)  # as above


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (7, 500), (40, 50)])
def test_nothing_is_found_in_constant_and_tiny_images(shape):
    assert deviation_of_smooth_parts(np.full((*shape, 3), 0.7, np.float32)) == 0
    if min(shape) < 8:
        assert deviation_of_smooth_parts(np.random.default_rng(0).random((*shape, 3))) == 0


def grain(coloured: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of 2/255 in each channel, blurred over two pixels; that share of its power is of one channel alone."""
    shared, own = rng.normal(size=(512, 512, 1)), rng.normal(size=(512, 512, 3))
    blurred = gaussian_filter(np.sqrt(1 - coloured) * shared + np.sqrt(coloured) * own, (1, 1, 0))
    return 2 / 255 * blurred / blurred.std()


def test_grain_larger_than_a_pixel_is_noise_if_it_is_even_and_coloured():
    rng = np.random.default_rng(5)
    fine = grain(0.5, rng)
    assert deviation(fine) < 0.5 / 255
    # Not all of it is in details of one size: 0.88 to 0.91 of it with four seeds.
    assert deviation_of_smooth_parts(0.5 + fine) == pytest.approx(2 / 255, rel=0.15)
    assert deviation_of_smooth_parts(0.5 + grain(0, rng)) < 0.2 / 255  # as texture is: alike in all channels
    fading = np.linspace(1, 0.1, 512)[:, None, None]  # as haze does it to what is far away
    assert deviation_of_smooth_parts(0.5 + fading * fine) < 0.2 / 255


def test_the_grain_of_a_photograph_is_found_and_its_bricks_are_not(shared_data):
    foggy, bricks = (
        read_image(shared_data / "hazy" / name, color="srgb").pixels for name in ("foggy_house.jpg", "house.jpg")
    )
    # In levels of 8 bit. What of the sky is finer than 6 px has 2.0 to 2.5; 1.9 were found.
    assert 1.5 / 255 < deviation_of_smooth_parts(foggy) < 2.5 / 255
    assert deviation_of_smooth_parts(bricks) < 0.5 / 255


def test_a_picture_without_a_smooth_part_holds_less_noise_than_it_has_details():
    """Bricks and leaves to every side: details twice as large are stronger there, in noise they are alike."""
    rng = np.random.default_rng(3)
    frequency = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256))
    # A spectrum in which the power of details grows by 6 from one scale to the next, as in photographs.
    texture = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(256, 256))) / np.maximum(frequency, 1 / 256) ** 1.3)
    image = 0.5 + 0.08 * (texture / texture.std())[..., None].repeat(3, axis=2)
    assert deviation(image) > 2.5 / 255
    # Sixteen regions say only about how it grows: 0 to 0.37 of it were left with four seeds.
    assert deviation_of_smooth_parts(image) < 0.5 * deviation(image)
    noisy = image + rng.normal(0, 5 / 255, image.shape)
    assert deviation(noisy) > 1.1 * 5 / 255
    assert deviation_of_smooth_parts(noisy) == pytest.approx(5 / 255, rel=0.05)  # seen: 0.987 to 1.014
