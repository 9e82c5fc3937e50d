"""The pipelines that take haze off, and the round trip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fogpipe
from fogpipe.errors import ExpectationError
from fogpipe.io.images import read_image
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.bands import set_threads, threads

DEHAZERS = ("dark-channel", "boundary-constraint")
every_dehazer = pytest.mark.parametrize("name", DEHAZERS)


@pytest.fixture(scope="module")
def street() -> dict[str, np.ndarray]:
    values = open_scene("sample:outdoor:4:320x200").load("srgb").values
    return {"image": np.clip(values["image"], 0, 1), "range_map": values["range_map"]}


@pytest.fixture(scope="module")
def round_trip(street) -> fogpipe.Result:
    return fogpipe.load("roundtrip-hansard-yan").run(**street)


def test_the_truth_brings_the_picture_back(round_trip):
    assert round_trip["psnr_exact"] > 100  # float32
    # Rounding to 8 bit, 1/√12 level, over t ≥ e^(-1): between 50 and 59 dB.
    assert 50 < round_trip["psnr_8_bit"] < 59


def test_blur_in_the_haze_is_lost_and_the_loss_is_told(round_trip):
    assert 20 < round_trip["psnr_through_blur"] < round_trip["psnr_8_bit"]


def test_noise_makes_the_way_back_hard(street):
    quiet = fogpipe.load("roundtrip-hansard-yan", set={"noise": 0}).run(to=["psnr_hazy", "t_error"], **street)
    noisy = fogpipe.load("roundtrip-hansard-yan").run(to=["psnr_hazy", "t_error"], **street)
    assert quiet["psnr_hazy"] > noisy["psnr_hazy"]
    assert 0 < noisy["t_error"] < 0.5


def test_a_round_trip_that_fails_its_expectation_fails_the_run(street):
    with pytest.raises(ExpectationError, match="psnr"):
        fogpipe.load("roundtrip-hansard-yan", set={"thickness": 6}).run(**street)


def test_no_error_at_all_meets_every_expectation(street, tmp_path):
    path = tmp_path / "equal.yaml"
    path.write_text("""
fogpipe: 1
inputs: {image: Image}
stages: {psnr: {use: metric.psnr, in: {image: image, reference: image}}}
outputs: {psnr: psnr}
expect: {psnr: ">= 40"}
""")
    assert fogpipe.load(path).run(image=street["image"])["psnr"] == np.inf


@every_dehazer
def test_contrast_comes_back_where_the_haze_was(name, street):
    hazy = fogpipe.load("roundtrip-hansard-yan", set={"noise": 0, "thickness": 6}).run(to=["hazy"], **street)["hazy"]
    result = fogpipe.load(name).run(image=hazy)
    # True transmissions: above 0.84 near by, 0.06 to 0.42 far away.
    far = (street["range_map"] > 60) & (street["range_map"] < 200)
    near = street["range_map"] < 12
    spread = {key: picture[far].std() for key, picture in (("hazy", hazy), ("clear", result["clear"]))}
    assert spread["clear"] > 1.5 * spread["hazy"]
    assert result["transmission"][far].mean() < result["transmission"][near].mean() - 0.2
    assert result["clear"].min() >= 0
    assert result["clear"].max() <= 1


@every_dehazer
def test_one_and_two_threads_give_the_same_bytes(name, street):
    before = threads()
    try:
        runs = []
        for count in (1, 2):
            set_threads(count)
            runs.append(fogpipe.load(name).run(image=street["image"], workers=count))
    finally:
        set_threads(before)
    for output in runs[0]:
        assert runs[0][output].tobytes() == runs[1][output].tobytes()


def named_images() -> dict[str, np.ndarray]:
    """Images that dehazers meet on a bad day."""
    some = np.random.default_rng(0).random((12, 17, 3)).astype(np.float32)
    return {
        "one pixel": some[:1, :1],
        "one row": some[:1],
        "one column": some[:, :1],
        "constant": np.full_like(some, 0.5),
        "grey": np.repeat(some[..., :1], 3, axis=2),
        "saturated": np.ones_like(some),
        "a channel of zeros": some * np.array([1, 1, 0], np.float32),
        "values above 1": 4 * some,
        "float64": some.astype(np.float64),
        "8 bit": np.rint(some * 255).astype(np.uint8),
    }


@every_dehazer
@pytest.mark.parametrize("case", named_images())
def test_hard_images_give_a_picture(name, case):
    result = fogpipe.load(name).run(image=named_images()[case])
    for output in result:
        assert np.isfinite(result[output]).all(), output


@every_dehazer
def test_real_pictures(name, shared_data: Path):
    for file in ("canyon.png", "house.jpg"):
        image = read_image(shared_data / "hazy" / file, color="srgb").pixels
        result = fogpipe.load(name).run(image=image)
        # Haze veils black: taken off, the darkest tenth gets darker.
        assert np.percentile(result["clear"], 10) < np.percentile(image, 10)
