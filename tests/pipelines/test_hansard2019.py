"""The pipelines `hansard2019` and `hansard2019-paper`, from inputs to picture."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

import fogpipe
from fogpipe.errors import StageError
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.bands import set_threads, threads


def scene(name: str, color: str = "linear") -> dict[str, np.ndarray]:
    values = open_scene(f"sample:{name}").load(color).values  # type: ignore[arg-type]
    return {key: values[key] for key in ("image", "range_map")}


@pytest.fixture(scope="module")
def motorcycle() -> dict[str, np.ndarray]:
    return scene("motorcycle")


@pytest.fixture(scope="module")
def outdoor() -> dict[str, np.ndarray]:
    return scene("outdoor")


def statuses(result: fogpipe.Result) -> dict[str, str]:
    return {report.name: report.status for report in result.reports}


def test_a_scene_without_sky_skips_the_matting_and_says_so(motorcycle):
    result = fogpipe.load("hansard2019").run(**motorcycle)
    assert statuses(result)["range"] == "skipped"
    assert statuses(result)["filled"] == "ran"
    assert {report.name: report.reason for report in result.reports}["range"] == "the scene has no sky"


def test_a_scene_with_sky_is_matted_and_a_full_range_is_not_filled(outdoor):
    full = outdoor | {"range_map": np.nan_to_num(outdoor["range_map"], nan=50.0)}
    assert statuses(fogpipe.load("hansard2019").run(**outdoor))["range"] == "ran"
    assert statuses(fogpipe.load("hansard2019").run(**full))["filled"] == "skipped"


@pytest.mark.parametrize("name", ["motorcycle", "outdoor"])
def test_measured_range_is_untouched_and_nothing_is_unknown_any_more(name: str, request):
    inputs = request.getfixturevalue(name)
    after = fogpipe.load("hansard2019").run(to=["range"], **inputs)["range"]
    measured = np.isfinite(inputs["range_map"])
    np.testing.assert_array_equal(after[measured], inputs["range_map"][measured])
    assert np.isfinite(after).all()


def test_the_farthest_measured_point_has_the_optical_thickness_asked_for(motorcycle):
    farthest = np.nanmax(motorcycle["range_map"])
    for thickness in (0.5, 1.0, 3.0):
        result = fogpipe.load("hansard2019", set={"fog.optical_thickness": thickness}).run(
            to=["transmission", "extinction", "range"], **motorcycle
        )
        # float32 exponential of a float32 product: a few units in the last place.
        assert result["transmission"][result["range"] == farthest].min() == pytest.approx(np.exp(-thickness), rel=1e-5)
        assert result["extinction"] * farthest == pytest.approx(thickness, rel=1e-6)


def test_fog_by_visibility_does_not_ask_for_the_size_of_the_scene(outdoor):
    result = fogpipe.load("hansard2019", set={"fog.visibility": 200}).run(to=["extinction"], **outdoor)
    assert result["extinction"] == pytest.approx(-np.log(0.05) / 200)


def test_haze_takes_more_contrast_away_the_farther_the_scene(outdoor):
    result = fogpipe.load("hansard2019", set={"scale.strength": 0}).run(**outdoor)
    range_map, clear = outdoor["range_map"], outdoor["image"]
    kept = []
    for nearest, farthest in ((0, 15), (40, 80), (200, 1e9)):
        zone = (range_map >= nearest) & (range_map < farthest)
        kept.append(result["hazy"][zone].std(axis=0) / clear[zone].std(axis=0))
    assert (np.diff(kept, axis=0) < 0).all()
    assert (np.array(kept) < 1).all()


def test_a_layer_without_blur_is_skipped_and_exactly_the_beer_lambert_composite(motorcycle):
    result = fogpipe.load("hansard2019", set={"scale.strength": 0}).run(**motorcycle)
    assert statuses(result)["blurred"] == "skipped"
    t = result["transmission"][..., None].astype(np.float64)
    expected = t * motorcycle["image"] + (1 - t) * result["airlight"]
    # Three float32 operations on values below 1.
    np.testing.assert_allclose(result["hazy"], expected, atol=3e-7)


@pytest.mark.parametrize("name", ["hansard2019", "hansard2019-paper"])
def test_one_and_two_threads_and_a_second_run_give_the_same_bytes(name: str, motorcycle):
    inputs = {key: value[:200, :300] for key, value in motorcycle.items()}
    before = threads()
    try:
        runs = []
        for count in (1, 2, 2):
            set_threads(count)
            runs.append(fogpipe.load(name).run(workers=count, **inputs))
    finally:
        set_threads(before)
    for output in runs[0]:
        assert runs[0][output].tobytes() == runs[1][output].tobytes() == runs[2][output].tobytes()


def test_the_papers_three_parameter_sets(motorcycle):
    inputs = scene("motorcycle", "srgb")
    result = fogpipe.load("hansard2019-paper").run(**inputs)
    assert statuses(result)["t_1"] == "ran"
    detail = {name: np.abs(np.diff(result[name], axis=1)).mean() for name in ("absorbed", "scattered", "extreme")}
    # The same attenuation, then blurred, then blurred twice as much and attenuated more (Figure 4).
    assert detail["absorbed"] > 1.5 * detail["scattered"] > 1.5 * detail["extreme"]


def named_cases() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Images and ranges that pipelines meet on a bad day."""
    rng = np.random.default_rng(0)
    image = rng.random((12, 17, 3)).astype(np.float32)
    near = rng.uniform(1, 9, (12, 17)).astype(np.float32)
    half = near.copy()
    half[:6] = np.nan
    holes = near.copy()
    holes[4:6, 3:8] = np.nan
    return {
        "no sky, no holes": (image, near),
        "sky": (image, half),
        "sky marked as infinite": (image, np.nan_to_num(half, nan=np.inf)),
        "holes": (image, holes),
        "one pixel": (image[:1, :1], near[:1, :1]),
        "one row": (image[:1], near[:1]),
        "one column": (image[:, :1], half[:, :1]),
        "zero range": (image, near * 0 + np.where(near > 5, 1, 0)),
        "constant image": (image * 0 + 0.4, near),
        "black image": (image * 0, near),
        "HDR": (image * 1e4, near),
        "float64": (image.astype(np.float64), near.astype(np.float64)),
        "float16": (image.astype(np.float16), near.astype(np.float16)),
        "not contiguous": (image[::-1, ::2], near[::-1, ::2]),
        "tiny and huge ranges": (image, np.where(near > 5, 1e-30, 1e30).astype(np.float32)),
    }


@pytest.mark.parametrize("case", named_cases())
@pytest.mark.parametrize("name", ["hansard2019", "hansard2019-paper"])
def test_hard_cases_give_finite_pictures_between_scene_and_airlight(name: str, case: str):
    image, range_map = named_cases()[case]
    result = fogpipe.load(name).run(image=image, range_map=range_map)
    for output in result:
        if result[output].ndim == 3:
            assert np.isfinite(result[output]).all(), output
            # Every step is a weighted mean of scene and airlight; float32 rounding only.
            assert result[output].min() >= -1e-6 * image.max()
            assert result[output].max() <= max(float(image.max()), 1) * (1 + 1e-5)


def test_all_sky_is_airlight_once_the_fog_is_given_in_metres():
    image = np.full((8, 9, 3), 0.25, np.float32)
    nothing = np.full((8, 9), np.nan, np.float32)
    with pytest.raises(StageError, match="set visibility"):
        fogpipe.load("hansard2019").run(image=image, range_map=nothing)
    result = fogpipe.load("hansard2019", set={"fog.visibility": 100}).run(image=image, range_map=nothing)
    np.testing.assert_array_equal(result["transmission"], 0)
    np.testing.assert_allclose(result["hazy"], 0.25, rtol=1e-6)  # float32


def test_no_fog_at_all_returns_the_image(motorcycle):
    result = fogpipe.load("hansard2019", set={"fog.extinction": 0}).run(**motorcycle)
    np.testing.assert_array_equal(result["hazy"], motorcycle["image"])


def test_thick_fog_hides_everything(motorcycle):
    result = fogpipe.load("hansard2019", set={"fog.extinction": 1e6, "scale.strength": 0}).run(**motorcycle)
    np.testing.assert_array_equal(result["hazy"], np.broadcast_to(result["airlight"], result["hazy"].shape))


def test_an_airlight_may_be_given_in_the_pipeline(motorcycle):
    result = fogpipe.load("hansard2019", set={"airlight.colour": [0.5, 0.6, 0.7]}).run(to=["airlight"], **motorcycle)
    np.testing.assert_allclose(result["airlight"], [0.5, 0.6, 0.7], rtol=1e-6)  # float32


def test_real_street_with_sparse_lidar(shared_data: Path):
    from fogpipe.io.depth import read_depth, to_range
    from fogpipe.io.images import read_image

    image = read_image(shared_data / "kitti" / "rgb.png").pixels
    depth = read_depth(shared_data / "kitti" / "depth.png", encoding="kitti", camera=None)
    result = fogpipe.load("hansard2019", set={"fog.visibility": 60}).run(
        image=image, range_map=to_range(depth, None)[0]
    )
    assert np.isfinite(result["hazy"]).all()
    assert result["hazy"].shape == image.shape


@pytest.mark.slow
def test_a_picture_of_40_megapixels_stays_within_seven_times_its_inputs():
    program = dedent("""
        import resource, numpy as np, fogpipe
        small = fogpipe.load("hansard2019")
        small.run(image=np.ones((64, 64, 3), np.float32), range_map=np.ones((64, 64), np.float32))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        height, width = 5200, 7700
        ramp = np.linspace(1, 100, height, dtype=np.float32)
        range_map = np.repeat(ramp[:, None], width, axis=1)
        image = np.full((height, width, 3), 0.5, np.float32)
        given = range_map.nbytes + image.nbytes
        result = fogpipe.load("hansard2019", set={"scale.strength": 1}).run(image=image, range_map=range_map)
        assert result["hazy"].shape == image.shape
        print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before) / given)
    """)
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    # At the blur live: inputs (1), transmission, scale and rates (1), and four layers of 4 channels (4).
    assert float(output) <= 7
