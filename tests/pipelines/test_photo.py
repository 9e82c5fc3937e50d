"""The pipelines for one photograph: `guo2014-paper`, `guo2014` and `photo-fog`."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import skimage.data

import fogpipe
from fogpipe.stages.medium import VISIBILITY

GRADES = list(VISIBILITY)[::-1]  # from clear to dense
PHOTOS = ("astronaut", "camera", "chelsea", "coffee", "coins", "rocket")


def photo(name: str) -> np.ndarray:
    """A photograph that scikit-image ships, at most 240 pixels wide."""
    import cv2

    pixels = getattr(skimage.data, name)()
    pixels = np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels
    return cv2.resize(pixels, (240, 160), interpolation=cv2.INTER_AREA)


@pytest.fixture(scope="module", params=["guo2014-paper", "guo2014", "photo-fog"])
def pipeline(request) -> str:
    return request.param


def test_one_photo_is_all_that_it_needs(pipeline: str):
    result = fogpipe.load(pipeline).run(image=photo("rocket"))
    for name, value in result.items():
        assert np.isfinite(value).all(), name


@pytest.mark.parametrize("name", PHOTOS)
@pytest.mark.parametrize("pipeline", ["guo2014", "guo2014-paper"])
def test_every_grade_of_weather_has_less_contrast_and_more_airlight_than_the_clearer_one(pipeline: str, name: str):
    """Guo 2014, Table 1 and Figure 8, without the floor t₀, at which dense fogs are alike.

    Contrast is measured twice: Koschmieder's, |J − A| / A against the airlight, which hardly can rise, and the mean
    gradient of the photo's own texture, away from the borders of the depth. At those it may grow, where a dark
    surface stands before the white of a night sky in fog.
    """
    import cv2

    contrasts, textures, shares = [], [], []
    even = None
    for weather in GRADES:
        settings = {"t.weather": weather, "t.floor": 0, "t.factor": None}
        result = fogpipe.load(pipeline, set=settings).run(image=photo(name), to=["homogeneous", "transmission"])
        foggy = result["homogeneous"].astype(np.float64)
        if even is None:  # the clearest: where its optical thickness hardly changes from pixel to pixel, depth is even
            thickness = -np.log(np.maximum(result["transmission"], 1e-6))
            change = cv2.morphologyEx(thickness, cv2.MORPH_GRADIENT, np.ones((3, 3)))
            even = change <= np.median(change)
        contrasts.append(np.abs(1 - foggy).mean())
        textures.append(np.hypot(*np.gradient(foggy.mean(axis=2)))[even].mean())
        shares.append(1 - result["transmission"].mean(dtype=np.float64))
    assert all(more < less for less, more in itertools.pairwise(contrasts))
    if pipeline == "guo2014":  # the published map follows the texture itself, and on one photo sharpens it
        assert all(more <= less for less, more in itertools.pairwise(textures))  # sky may have none left
        assert textures[-1] < 0.5 * textures[0]
    assert all(more > less for less, more in itertools.pairwise(shares))


def test_visibility_is_where_contrast_falls_to_the_threshold():
    result = fogpipe.load("photo-fog", set={"fog.visibility": 200, "density.contrast": 0}).run(image=photo("rocket"))
    # An exponential in float32 of an exponent up to 7.5.
    np.testing.assert_allclose(result["transmission"], 0.05 ** (result["range"] / 200), rtol=1e-5)


def test_the_visibility_that_was_used_is_an_output():
    settings = {"fog.visibility": None, "fog.weather": "thick-fog"}
    visibility = fogpipe.load("photo-fog", set=settings).run(image=photo("coffee"), to=["visibility"])["visibility"]
    assert visibility == pytest.approx(100)  # metres, the geometric mean of 50 and 200


def test_less_visibility_is_more_fog():
    transmissions = [
        fogpipe.load("photo-fog", set={"fog.visibility": v}).run(image=photo("coffee"), to=["transmission"])
        for v in (1000, 200, 50)
    ]
    means = [float(result["transmission"].mean()) for result in transmissions]
    assert means[0] > means[1] > means[2]


def test_the_paper_has_white_airlight_and_noise_of_k_on_top():
    result = fogpipe.load("guo2014-paper").run(image=photo("rocket"))
    assert result["homogeneous"].max() <= 1 + 1e-6  # a mean of display values and white, in float32
    noise = result["heterogeneous"] - result["homogeneous"]
    np.testing.assert_allclose(noise[..., 0], noise[..., 2], atol=1e-6)  # the same in each channel, float32
    assert 0.01 < noise.std() < 0.15


def test_same_bytes_on_one_thread_and_on_two(pipeline: str):
    from fogpipe.kernels import bands

    before = bands.threads()
    image = photo("rocket")
    try:
        results = []
        for count in (1, 2):
            bands.set_threads(count)
            results.append(fogpipe.load(pipeline).run(image=image))
    finally:
        bands.set_threads(before)
    for name, value in results[0].items():
        assert value.tobytes() == results[1][name].tobytes(), name


def test_grey_and_16_bit_photos_are_taken_as_they_are(tmp_path, pipeline: str):
    import cv2

    from fogpipe.io.scenes import scene_from_files

    picture = photo("coffee")
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    for name, pixels in (("grey.png", grey), ("deep.png", picture[..., ::-1].astype(np.uint16) * 257)):
        cv2.imwrite(str(tmp_path / name), pixels)
        loaded = fogpipe.load(pipeline)
        color = "linear" if pipeline == "photo-fog" else "srgb"
        values = scene_from_files(tmp_path / name).load(color, ["image"]).values
        assert np.isfinite(next(iter(loaded.run(image=values["image"]).values()))).all()
