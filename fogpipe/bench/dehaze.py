"""Dehazing with noise, the experiment of Yan 2013 (Figure 6): every method on scenes whose truth is known.

Pictures are made hazy in display values (sRGB), as the paper's are, with a known airlight of 0.9 in each channel that
every method is given. No method is told the noise. The yardstick of time is OpenCV's non-local means with its
defaults on the same picture in 8 bit.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fogpipe.bench.hazy_scenes import NOISES, REPORTED, THICKNESSES, HazyScene, hazy_scenes
from fogpipe.bench.table import Row
from fogpipe.kernels.arrays import FloatArray
from fogpipe.stages import denoise, haze, metric, prior, refine, restore, structure

Method = Callable[[HazyScene], tuple[FloatArray, FloatArray | None]]
"""From a hazy scene, of which it may look at the picture and the airlight, to a clear picture and a transmission."""
YARDSTICK = "cv2.fastNlMeansDenoisingColored"


def untouched(scene: HazyScene) -> tuple[FloatArray, None]:
    """The hazy picture itself, which every method must beat."""
    return scene.hazy, None


def true_transmission(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """Plain inversion with the true transmission: what noise alone takes."""
    return restore.invert(scene.hazy, scene.airlight, scene.transmission), scene.transmission


def dark_channel(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """He 2009 with the guided filter."""
    t = prior.dark_channel(scene.hazy, scene.airlight)
    return restore.invert(scene.hazy, scene.airlight, t), t


def boundary_constraint(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """Meng 2013."""
    t = prior.boundary_constraint(scene.hazy, scene.airlight)
    return restore.invert(scene.hazy, scene.airlight, t), t


def local_tv(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """Total variation in both steps of Yan 2013 in place of the non-local terms."""
    t = prior.local_tv(scene.hazy, scene.airlight)
    noisy = restore.invert(scene.hazy, scene.airlight, t, clip=False)
    return denoise.total_variation(noisy, np.maximum(t, np.float32(0.1))), t


def denoise_before(denoiser: Callable[[FloatArray], FloatArray], scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """A denoiser, then dark channel and inversion."""
    quiet = denoiser(scene.hazy)
    t = prior.dark_channel(quiet, scene.airlight)
    return restore.invert(quiet, scene.airlight, t), t


def denoise_after(denoiser: Callable[[FloatArray], FloatArray], scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """Dark channel and inversion, then a denoiser."""
    noisy, t = dark_channel(scene)
    return denoiser(noisy), t


def non_local(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """Yan 2013 as the pipeline ``yan2013`` does it, but for what is due to an airlight that is not known."""
    smooth = structure.relative_total_variation(scene.hazy, tolerance=1e-2)
    darkness = haze.non_local(scene.hazy, scene.airlight, smooth)
    corrected = haze.contrast_corrected(scene.hazy, scene.airlight, darkness, smooth)
    t = refine.mean(corrected, prior.dark_channel(scene.hazy, scene.airlight))
    return restore.non_local(scene.hazy, scene.airlight, t), t


def without_contrast(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """The same without the correction by contrast and the mean with the dark channel."""
    smooth = structure.relative_total_variation(scene.hazy, tolerance=1e-2)
    t = haze.non_local(scene.hazy, scene.airlight, smooth)
    return restore.non_local(scene.hazy, scene.airlight, t), t


def non_local_as_published(scene: HazyScene) -> tuple[FloatArray, FloatArray]:
    """Yan 2013 with the bound of the noisy image, its own first guess, and medians."""
    smooth = structure.relative_total_variation(scene.hazy)
    t = haze.non_local(scene.hazy, scene.airlight, smooth, darkest=0.0, saturation=1.0, quantile=0.5, noise_sigma=0.0)
    return restore.non_local(scene.hazy, scene.airlight, t, solver="median", window=15), t


METHODS: dict[str, Method] = {
    "hazy input": untouched,
    "true transmission": true_transmission,
    "non-local": non_local,
    "non-local, without contrast": without_contrast,
    "non-local, as published": non_local_as_published,
    "dark channel": dark_channel,
    "boundary constraint": boundary_constraint,
    "local TV": local_tv,
    "non-local means before": partial(denoise_before, denoise.nonlocal_means),
    "non-local means after": partial(denoise_after, denoise.nonlocal_means),
    "TV before": partial(denoise_before, denoise.total_variation),
    "TV after": partial(denoise_after, denoise.total_variation),
}
"""Every method of the experiment by name."""
SLOW = ("non-local, as published",)
"""Methods that a quick run leaves out."""


def measure(quick: bool) -> Iterator[Row]:
    """Every method on every scene, thickness and noise, and the mean over scenes; fewer of all of these if quick."""
    scenes, methods = hazy_scenes(REPORTED), METHODS
    if quick:
        scenes = hazy_scenes(REPORTED[:2], THICKNESSES[::2], NOISES[::2], (320, 240))
        methods = {way: method for way, method in METHODS.items() if way not in SLOW}
    rows = []
    for row in compare(scenes, methods):
        rows.append(row)
        yield row
    yield from means(rows)


def compare(scenes: Iterator[HazyScene], methods: dict[str, Method] = METHODS) -> Iterator[Row]:
    """A row for each scene and method: time, and scores against the truth."""
    warm: set[str] = set()
    for scene in scenes:
        yardstick = _seconds(lambda scene=scene: _opencv_means(scene))
        for way, method in methods.items():
            if way not in warm:  # kernels are compiled by the first call
                method(scene)
                warm.add(way)
            started = time.perf_counter()
            restored, transmission = method(scene)
            seconds = time.perf_counter() - started
            case = f"{scene.name}, {_weather(scene.thickness, scene.noise)}"
            seconds, ratio = (0.0, None) if method is untouched else (seconds, seconds / yardstick)
            yield Row(case, way, seconds, ratio, YARDSTICK, scores=score(scene, restored, transmission))


def score(scene: HazyScene, restored: FloatArray, transmission: FloatArray | None) -> dict[str, float]:
    """Every score of a restored picture and its transmission."""
    scores = {
        "PSNR": metric.psnr(restored, scene.clear, color="srgb"),
        "SSIM": metric.ssim(restored, scene.clear, color="srgb"),
        "CIEDE2000": metric.ciede2000(restored, scene.clear, color="srgb"),
    }
    if transmission is not None:
        scores["t error"] = metric.transmission_error(transmission, scene.transmission).root_mean_square
    return {name: float(value) for name, value in scores.items()}


def means(rows: Sequence[Row]) -> Iterator[Row]:
    """The mean over scenes, for each thickness, noise and method: of scores and ratios; the median of times."""
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row.case.partition(", ")[2], row.way].append(row)
    for (weather, way), members in groups.items():
        ratios = [row.ratio for row in members if row.ratio is not None]
        yield Row(
            f"mean of {len(members)}, {weather}",
            way,
            statistics.median(row.seconds for row in members),
            statistics.median(ratios) if ratios else None,
            YARDSTICK,
            scores={name: statistics.fmean(row.scores[name] for row in members) for name in members[0].scores},
        )


def draw(folder: Path, quick: bool, rows: Sequence[Row]) -> None:
    """A sheet for each scene at η 2 and σ 10: truth, hazy input and what every method makes of it, with its scores."""
    from fogpipe.io.sheet import Tile, tile, write_sheet
    from fogpipe.ports import known_kinds

    image = known_kinds()["Image"]

    def picture(name: str, pixels: FloatArray, caption: str) -> Tile:
        return replace(tile(name, image, pixels, "srgb"), caption=caption, marks=())

    names, size = (REPORTED[:2], (320, 240)) if quick else (REPORTED, (640, 480))
    for scene in hazy_scenes(names, (2.0,), (10.0,), size):
        tiles = [picture("truth", scene.clear, "")]
        for way, method in METHODS.items():
            if quick and way in SLOW:
                continue
            restored, transmission = method(scene)
            scores = score(scene, restored, transmission)
            tiles.append(picture(way, restored, f"{scores['PSNR']:.1f} dB, SSIM {scores['SSIM']:.2f}"))
        title = f"{scene.name}, optical thickness {scene.thickness:g}, noise {scene.noise:g} of 255"
        write_sheet(folder / f"dehaze-{scene.name.replace(':', '-')}.png", title, tiles)


def _weather(thickness: float, noise: float) -> str:
    return f"η {thickness:g}, σ {noise:g}"


def _opencv_means(scene: HazyScene) -> object:
    import cv2

    return cv2.fastNlMeansDenoisingColored(np.rint(scene.hazy * 255).astype(np.uint8))


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started
