"""The pipelines `lopez2008` and `layers-fog` on the photograph whose layers they hold."""

from __future__ import annotations

import numpy as np
import pytest

import fogpipe
from fogpipe.io.depth import read_depth
from fogpipe.io.images import read_image
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.bands import set_threads, threads
from fogpipe.runtime.inputs import Request, inputs_from_request
from fogpipe.stages.participating import PRESETS

ROCKET = np.s_[150:380, 315:329]  # the body of the rocket, a near layer
PAD = np.s_[405:425, 275:365]  # below the rocket, as near, of a brick red
MAST = np.s_[130:185, 200]  # behind it
TOWER = np.s_[150, 583:586]  # before it, a leg
ABOVE_GROUND = np.s_[130:330]  # rows where lattices stand before the sky
SKY = np.s_[20:120, 250:400]  # far behind
PANELS = {  # of the ball, at half size
    "red": np.s_[200:220, 20:40],
    "blue": np.s_[180:220, 120:160],
    "yellow": np.s_[210:230, 405:415],
    "cyan": np.s_[385:390, 345:355],
}
SOFT_EDGE = np.s_[200:220, 208:228]  # from the blue panel to the white one
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
    # Highlights are compressed, and fog of Z = 0.1 takes a tenth to a third; greyed and lifted everywhere it was 0.36.
    assert detail(foggy, ROCKET) / detail(photograph, ROCKET) > 0.38


@OUTPUTS
def test_the_near_layer_keeps_its_colour(pipeline, output, request, photograph):
    def saturation(image):
        red, _, blue = image[PAD].mean(axis=(0, 1))
        return (red - blue) / (red + blue)

    foggy = request.getfixturevalue(pipeline)[output]
    # In metres about half of its light is left: t = 0.52 at 63 m, and the rest is a grey of 0.33. Greyed everywhere it
    # was below 0.
    assert saturation(foggy) > 0.35 * saturation(photograph)


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


def test_measured_depth_takes_the_place_of_layers():
    scene = open_scene("sample:motorcycle").load("linear", ["image", "range_map"]).values
    image, range_map = scene["image"][::2, ::2], scene["range_map"][::2, ::2]
    result = fogpipe.load("lopez2008-measured").run(to=["foggy", "depth"], image=image, range_map=range_map)
    depth, foggy = result["depth"], result["foggy"]
    measured = np.isfinite(range_map)
    metres = range_map[measured]
    assert depth[measured] == pytest.approx((metres - metres.min()) / np.ptp(metres), abs=1e-6)
    steps = [np.abs(np.diff(picture.max(axis=2), axis=1)) for picture in (image, foggy)]
    near, far = (depth < 0.3)[:, 1:], (depth > 0.9)[:, 1:]
    left = [steps[1][region].mean() / steps[0][region].mean() for region in (near, far)]
    # From Z = 0.3 to 0.9, e^(−kZ) falls to 0.49, and the blur grows.
    assert left[1] < 0.49 * left[0]


@pytest.fixture(scope="module")
def render(shared_data) -> dict[str, np.ndarray]:
    """An EXR of a ball with pure colours before nothing, and its Z."""
    path = shared_data / "exr" / "beachball.exr"
    depth = read_depth(path, encoding="exr-z").values
    return {"image": read_image(path).pixels[::2, ::2], "range_map": depth[::2, ::2]}


def foggy_render(render, **changed) -> np.ndarray:
    """The ball is at Z = 0.1, and the empty space behind it at 1."""
    settings = {"depth.near": 0, "range.beyond": 8, "medium.preset": "forest-left", **changed}
    return fogpipe.load("lopez2008-measured", set=settings).run(to=["foggy"], **render)["foggy"]


@pytest.mark.parametrize("preset", ["house-left", "forest-left"])  # k = 1.2 and 1
def test_what_is_near_in_a_render_keeps_its_colours(render, preset):
    foggy = foggy_render(render, **{"medium.preset": preset})
    for panel in PANELS.values():
        before, after = (image[panel].mean(axis=(0, 1)) for image in (render["image"], foggy))
        away = [colour - colour.mean() for colour in (before, after)]
        # The same hue, within 10°, and at Z = 0.1 most of the difference from grey.
        assert np.dot(*away) / np.linalg.norm(away[0]) / np.linalg.norm(away[1]) > np.cos(np.radians(10))
        assert np.linalg.norm(away[1]) > 0.6 * np.linalg.norm(away[0])


def test_what_is_near_in_a_render_stays_crisp(render):
    foggy = foggy_render(render)
    assert detail(foggy, SOFT_EDGE) > 0.6 * detail(render["image"], SOFT_EDGE)
    ball = np.isfinite(render["range_map"])
    step = np.linalg.norm(np.diff(foggy, axis=1), axis=2)[200:220]
    outline = step[np.diff(ball, axis=1)[200:220]]
    # The blur of the far kernel leaves a glow, but the outline is from one pixel to the next: a red or yellow of 0.5
    # beside fog of 0.3 to 0.44.
    assert outline.min() > 0.15


def test_fog_thickens_with_distance(render):
    """The nearer the empty space behind it ends, the deeper in the fog the ball is."""
    contrasts = []
    for beyond in (8, 3, 1.5):
        panels = [
            foggy_render(render, **{"range.beyond": beyond})[panel].mean(axis=(0, 1)) for panel in PANELS.values()
        ]
        contrasts.append(np.std(panels))
    assert contrasts[0] > 1.5 * contrasts[1] > 2 * contrasts[2]


def test_the_empty_space_of_a_render_is_fog_and_nothing_else(render):
    fog = foggy_render(render, **{"medium.octaves": 0})[np.isinf(render["range_map"])]
    # σ InScat_L = 0.32, and a glow of the ball beside it; black is lifted by S_R T and dimmed by 1/e.
    assert np.median(fog.max(axis=1) + fog.min(axis=1)) / 2 == pytest.approx(0.32 + 0.5 * 0.1 / np.e, abs=0.02)


def test_layers_of_a_render_come_from_its_channels(shared_data, tmp_path):
    path = shared_data / "exr" / "beachball.exr"
    (tmp_path / "layers.yaml").write_text(
        """
        fogpipe: 1
        inputs: {image: Image, ball: Mask, panel: Mask}
        stages:
          air: {use: layers.backdrop, in: {image: image}}
          behind: {use: layers.flat, in: {below: air, mask: ball}, with: {depth: middle}}
          depth: {use: layers.flat, in: {below: behind, mask: panel}, with: {depth: close-up}}
        outputs: {depth: depth}
        """
    )
    files = {"image": path, "ball": f"{path}#Z", "panel": f"{path}#whitebarmask.right.mask"}
    pipeline = fogpipe.load(tmp_path / "layers.yaml")
    inputs = inputs_from_request(pipeline.plan(), Request(files={name: str(file) for name, file in files.items()}))
    depth = pipeline.run(**inputs.values)["depth"]
    assert depth[10, 10] == 1
    assert depth[300, 250] == np.float32(0.5)
    assert depth[300, 600] == np.float32(0.1)


def test_the_same_bytes_for_any_number_of_threads(photograph):
    usual, results = threads(), []
    for count in (1, 2):
        set_threads(count)
        results.append(fogpipe.load("lopez2008").run(to=["foggy"], image=photograph)["foggy"].tobytes())
    set_threads(usual)
    assert results[0] == results[1]
