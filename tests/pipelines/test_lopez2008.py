"""The pipelines `lopez2008` and `layers-fog` on the photograph whose layers they hold."""

from __future__ import annotations

import numpy as np
import pytest

import fogpipe
from fogpipe.io.images import read_image
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.bands import set_threads, threads
from fogpipe.stages.participating import PRESETS

ROCKET = np.s_[150:380, 315:329]  # the body of the rocket, a near layer
MAST = np.s_[130:185, 200]  # behind it
TOWER = np.s_[150, 583:586]  # before it, a leg
ABOVE_GROUND = np.s_[130:330]  # rows where lattices stand before the sky
SKY = np.s_[20:120, 250:400]  # far behind
OUTPUTS = pytest.mark.parametrize(
    ("pipeline", "output"), [("published", "foggy"), ("physical", "hazy"), ("physical", "scattered")]
)


@pytest.fixture(scope="module")
def photograph() -> np.ndarray:
    return open_scene("sample:rocket").load("linear", ["image"]).values["image"]


@pytest.fixture(scope="module")
def published(photograph) -> fogpipe.Result:
    return fogpipe.load("lopez2008").run(image=photograph)


@pytest.fixture(scope="module")
def physical(photograph) -> fogpipe.Result:
    return fogpipe.load("layers-fog").run(image=photograph)


def detail(image: np.ndarray, part: tuple[slice, slice]) -> float:
    """Root mean square of the differences between neighbours, of the lightest channel."""
    values = image[part].max(axis=2)
    return float(np.sqrt(np.mean(np.diff(values, axis=0) ** 2) + np.mean(np.diff(values, axis=1) ** 2)))


def test_depth_orders_the_layers(published):
    depth = published["depth"]
    assert depth[TOWER].max() < depth[ROCKET].max() < depth[MAST].max() < depth[SKY].min()


@OUTPUTS
def test_the_near_layer_stays_crisp(pipeline, output, request, photograph):
    foggy = request.getfixturevalue(pipeline)[output]
    assert detail(foggy, ROCKET) / detail(photograph, ROCKET) > 0.25  # Table 1's thickest fog greys it as well


@OUTPUTS
def test_fog_thickens_with_depth(pipeline, output, request, published):
    """Steel lattices stand out from the fog by less, the farther they are."""
    foggy = request.getfixturevalue(pipeline)[output][ABOVE_GROUND]
    depth = published["depth"][ABOVE_GROUND]
    sky = foggy[depth == 1].mean(axis=0)
    near, middle = (np.abs(foggy[np.abs(depth - at) < 0.01] - sky).mean() for at in (0.05, 0.4))
    assert middle < 0.6 * near


@OUTPUTS
def test_no_layer_has_a_hard_seam_in_the_sky(pipeline, output, request, photograph):
    """Where the photograph is smooth, the fog is smooth, though the polygons have their borders there."""
    foggy = request.getfixturevalue(pipeline)[output]
    smooth = np.ones(photograph.shape[:2], bool)
    for axis in (0, 1):
        step = np.abs(np.diff(photograph, axis=axis, append=photograph[-1:] if axis == 0 else photograph[:, -1:]))
        smooth &= step.max(axis=2) < 0.004
    steps = np.abs(np.diff(foggy, axis=1))[:-1].max(axis=2)
    # One step in 8-bit display values at this lightness is about 0.007 in linear light; ten of them are an edge.
    assert np.quantile(steps[smooth[:-1, :-1]], 0.999) < 0.07


def test_highlights_do_not_clip(photograph):
    """In HDR, the fog follows the light: lamps of another strength give other pixels."""
    lamps = photograph > 0.9
    foggy = [
        fogpipe.load("lopez2008").run(to=["fog"], image=np.where(lamps, strength * photograph, photograph))["fog"]
        for strength in (1, 30)
    ]
    lamp = lamps.all(axis=2)
    assert np.isfinite(foggy[1]).all()
    assert (foggy[1][lamp] > foggy[0][lamp]).mean() > 0.95


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_runs(preset, photograph):
    small = photograph[::4, ::4]
    foggy = fogpipe.load("lopez2008", set={"medium.preset": preset}).run(to=["foggy"], image=small)["foggy"]
    assert np.isfinite(foggy).all()
    assert foggy.min() >= 0
    assert not np.array_equal(foggy, small)


def test_more_fog_is_thicker(photograph):
    small = photograph[::2, ::2]
    thin, thick = (
        fogpipe.load("layers-fog", set={"fog.visibility": visibility}).run(to=["transmission"], image=small)[
            "transmission"
        ]
        for visibility in (1000, 100)
    )
    assert (thick < thin).all()


def test_only_the_blur_that_is_asked_for_is_computed(photograph):
    result = fogpipe.load("layers-fog").run(to=["hazy"], image=photograph[::4, ::4])
    assert not {"forward", "light", "scattered"} & {report.name for report in result.reports}


def test_a_measured_scene_is_linear(shared_data):
    """An EXR of saturated colours on black: no hue jumps, nothing negative, and black becomes fog."""
    image = read_image(shared_data / "exr" / "beachball.exr").pixels[::2, ::2]
    foggy = fogpipe.load("lopez2008", set={"medium.preset": "house-centre"}).run(to=["fog"], image=image)["fog"]
    assert np.isfinite(foggy).all()
    assert foggy.min() >= 0
    black = (image == 0).all(axis=2)
    assert foggy[black].min() > 0.01


def test_the_same_bytes_for_any_number_of_threads(photograph):
    usual, results = threads(), []
    for count in (1, 2):
        set_threads(count)
        results.append(fogpipe.load("lopez2008").run(to=["foggy"], image=photograph)["foggy"].tobytes())
    set_threads(usual)
    assert results[0] == results[1]
