"""Makes the pictures of the README and the docs: ``python docs/pictures.py``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

import fogpipe
from fogpipe.bench.chart import curves
from fogpipe.bench.dehaze import draw
from fogpipe.io.images import write_image
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.perlin import field
from fogpipe.kernels.scattering import measured, pixels, profiles
from fogpipe.stages.composite import attenuate, naive, over_airlight
from fogpipe.stages.density import along_rays
from fogpipe.stages.depth import from_photo, from_transmission
from fogpipe.stages.haziness import mrf
from fogpipe.stages.medium import thicken
from fogpipe.stages.medium import transmission as beer_lambert
from fogpipe.stages.refine import bilateral
from fogpipe.stages.scattering import apsf, glow
from fogpipe.stages.segments import mean_shift

FOLDER = Path(__file__).parent / "pictures"


def outdoor(visibilities: tuple[float, ...] = (300, 150, 60)) -> None:
    """The street in clear air and in ever thicker haze, two by two."""
    values = open_scene("sample:outdoor").load("linear").values
    inputs = {name: values[name] for name in ("image", "range_map")}
    pictures = [np.asarray(inputs["image"])]
    for visibility in visibilities:
        pipeline = fogpipe.load("hansard2019", set={"fog.visibility": visibility})
        pictures.append(pipeline.run(to=["hazy"], **inputs)["hazy"])
    rows = [np.hstack(pictures[:2]), np.hstack(pictures[2:])]
    write_image(FOLDER / "outdoor.jpg", cv2.resize(np.vstack(rows), (1200, 750), interpolation=cv2.INTER_AREA))


def layers() -> None:
    """A photograph, the depth of its layers, and fog as published and as physics has it."""
    image = _photograph("rocket")
    published = fogpipe.load("lopez2008").run(to=["foggy", "depth"], image=image)
    physical = fogpipe.load("layers-fog").run(to=["scattered"], image=image)["scattered"]
    depth = np.repeat(published["depth"][..., None], 3, axis=2)
    rows = [np.hstack([image, depth]), np.hstack([published["foggy"], physical])]
    write_image(FOLDER / "layers.jpg", cv2.resize(np.vstack(rows), None, fx=0.9, fy=0.9, interpolation=cv2.INTER_AREA))


def measured_depth() -> None:
    """A photograph with measured depth, and the fog of Lopez-Moreno 2008 on it: forest-left."""
    values = open_scene("sample:motorcycle").load("linear", ["image", "range_map"]).values
    pipeline = fogpipe.load("lopez2008-measured", set={"medium.preset": "forest-left"})
    both = np.hstack([values["image"], pipeline.run(to=["foggy"], **values)["foggy"]])
    write_image(FOLDER / "measured-depth.jpg", cv2.resize(both, (1200, 420), interpolation=cv2.INTER_AREA))


def coefficients(pairs: tuple[tuple[float, float], ...] = ((0.2, 0.2), (0.44, 0.5), (0.75, 0.9))) -> None:
    """Lopez-Moreno 2008, Figure 6: ever more scattering σ and extinction k, from left to right."""
    image = _photograph("rocket")
    pictures = []
    for scattering, extinction in pairs:
        medium = {"medium.scattering": scattering, "medium.extinction": extinction, "medium.octaves": 0}
        pictures.append(fogpipe.load("lopez2008", set=medium).run(to=["foggy"], image=image)["foggy"])
    write_image(FOLDER / "coefficients.jpg", np.hstack([picture[:, 120:520] for picture in pictures]))


def octaves(count: int = 5, size: int = 240, period: float = 120.0) -> None:
    """Lopez-Moreno 2008, Figure 9: octaves of noise, each half as strong, and their sum at the right."""
    sums = [np.zeros((size, size), np.float32)]
    for octave in range(1, count + 1):
        strength = np.sqrt(np.sum(0.25 ** np.arange(octave)))  # of octaves of 1, 1/2, 1/4 …
        sums.append(strength * field(size, size, 5, period=period, octaves=octave, persistence=0.5))
    noise = np.hstack([*np.diff(sums, axis=0), sums[-1]])
    write_image(FOLDER / "octaves.jpg", np.repeat(0.5 + 0.2 * noise[..., None], 3, axis=2), color="srgb")


def drifting(times: tuple[float, ...] = (0.0, 4.0, 8.0)) -> None:
    """Fog that is fixed in the world and drifts with a wind of 3 m/s from the left, in three frames."""
    values = open_scene("sample:outdoor:640x400").load("linear").values
    image, range_map, camera = (values[name] for name in ("image", "range_map", "camera"))
    range_map = np.where(np.isnan(range_map), np.inf, range_map)
    frames = []
    for time in times:
        fog = {"contrast": 0.9, "period": 30.0, "wind": (3.0, 0.0, 0.0), "time": time}
        density = along_rays(range_map, camera, rng=np.random.default_rng(3), **fog)
        transmission = beer_lambert(range_map, np.array(0.03), density)
        frames.append(over_airlight(attenuate(image, transmission), np.array([0.75, 0.78, 0.82], np.float32)))
    write_image(FOLDER / "drifting.jpg", np.hstack(frames))


def kernels_by_angle() -> None:
    """Lopez-Moreno 2008, Figure 7: kernels for several T and q, of photons (solid) and of the series (dashed)."""
    shown = np.abs(profiles.ANGLES - np.radians(40)) < np.radians(39.7)
    angles = profiles.ANGLES[shown]
    degrees = list(np.degrees(angles))
    by_thickness = {f"T = {thickness:g}": (0.9, thickness) for thickness in (1.2, 2.0, 4.0, 8.0)}
    by_asymmetry = {f"q = {q:g}": (q, 1.2) for q in (0.2, 0.75, 0.9, 0.95)}
    for name, title, kernels in (
        ("kernels-by-thickness", "q = 0.9: photons, and the series (dashed)", by_thickness),
        ("kernels-by-asymmetry", "T = 1.2: photons, and the series (dashed)", by_asymmetry),
    ):
        lines: dict[str, list[float]] = {}
        for label, (q, thickness) in kernels.items():
            for suffix, profile in (
                ("", measured.profiles(q, np.array(thickness))[0]),
                (" *", profiles.legendre(q, thickness)),
            ):
                lines[label + suffix] = list(profile[shown] / np.sin(angles))
        svg = curves(title, ("angle from the source, degrees", degrees), "radiance per energy, 1/sr", lines)
        (FOLDER / f"{name}.svg").write_text(svg, encoding="utf-8")


def kernels_on_screen(size: int = 121, focal: float = 400.0) -> None:
    """Lopez-Moreno 2008, Figure 8: a kernel that is projected ever smaller with depth, and, below, kernels of photons.

    Above, the series in the sizes 1/5, 1/10 and 1/20; below, what fog of the thickness 0.5, 2 and 8 does. Five
    decades from black to white.
    """
    series = profiles.legendre(0.9, 1.2)
    above = [(series, focal * share) for share in (0.2, 0.1, 0.05)]
    below = [(profile, focal) for profile in measured.profiles(0.9, np.array([0.5, 2.0, 8.0]))]
    rows = []
    for kernels in (above, below):
        drawn = []
        for profile, f in kernels:
            quadrant, _ = pixels.weights(profile, f, size, size)
            half = np.log10(np.pad(quadrant[:size, :size], ((size - 1, 0), (size - 1, 0)), mode="reflect"))
            drawn.append(np.clip(1.3 + half / 5, 0, 1))
        rows.append(np.hstack(drawn))
    write_image(FOLDER / "kernels-on-screen.jpg", np.repeat(np.vstack(rows)[..., None], 3, axis=2), color="srgb")


def lamps(thicknesses: tuple[float, ...] = (1.2, 2.0, 4.0)) -> None:
    """A night scene of one depth behind ever thicker fog that adds no airlight: by photons, and below by the series."""
    image = _photograph("rocket")
    image = image * (1 + 20 * (image.min(axis=2, keepdims=True) > 0.8))  # lamps as bright as they are
    flat = np.ones(image.shape[:2], np.float32)
    photons, series = [], []
    for thickness in thicknesses:
        t = np.exp(-thickness)
        photons.append(glow(image, t * flat))
        wide = {"near": 1.0, "middle": 1.0, "far": 1.0, "channels": "all"}
        series.append(t * image + (1 - t) * apsf(image, flat, optical_thickness=thickness, **wide))
    rows = np.vstack([np.hstack(photons), np.hstack(series)])
    write_image(FOLDER / "lamps.jpg", cv2.resize(rows, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA))


def _photograph(name: str) -> np.ndarray:
    return open_scene(f"sample:{name}").load("linear", ["image"]).values["image"]


def photo_fog(visibilities: tuple[float, ...] = (1000, 300, 100)) -> None:
    """A night photograph without depth, and fog on it by visibility, in the light of street lamps."""
    values = open_scene("sample:rocket").load("linear").values
    pictures = [np.asarray(values["image"])]
    for visibility in visibilities:
        settings = {"fog.visibility": visibility, "airlight.colour": (0.12, 0.12, 0.13)}
        pictures.append(fogpipe.load("photo-fog", set=settings).run(image=values["image"], to=["foggy"])["foggy"])
    _write("photo-fog.jpg", [pictures[:2], pictures[2:]], 600)


def guo_figures() -> None:
    """Figures 4 to 8 of Guo 2014 on the sample photo, as published and with the depth of fogpipe."""
    rocket = _display("sample:rocket")
    paper = fogpipe.load("guo2014-paper").run(image=rocket)
    _write("guo-figure-4.jpg", [[rocket, paper["segments"]]], 500)
    steps = (np.arange(5) / 4 * 0.8 + 0.1).repeat(80).astype(np.float32)
    grey = np.repeat(np.broadcast_to(steps, (200, 400))[..., None], 3, axis=2).copy()
    _write("guo-figure-5.jpg", [[grey, _grey(1 - mrf(grey).transmission)]], 400)
    initial = mrf(paper["segments"]).transmission
    refined = bilateral(initial)
    foggy = [naive(rocket, thicken(t), np.ones(3, np.float32)) for t in (initial, refined)]
    _write("guo-figure-6.jpg", [[rocket, _grey(initial), foggy[0]], [rocket, _grey(refined), foggy[1]]], 400)
    road = _display("sample:outdoor:4:640x400")
    rows = []
    for name, wanted in (
        ("guo2014-paper", ("transmission", "homogeneous", "heterogeneous")),
        ("guo2014", ("transmission", "homogeneous", "foggy")),
    ):
        result = fogpipe.load(name).run(image=road)
        rows.append([road, _grey(result[wanted[0]]), result[wanted[1]], result[wanted[2]]])
    _write("guo-figure-7.jpg", rows, 380)
    pictures = [road]
    for factor in (0.4, 1, 2, 5, 20):
        settings = {"t.weather": None, "t.factor": factor}
        pictures.append(fogpipe.load("guo2014", set=settings).run(image=road, to=["homogeneous"])["homogeneous"])
    _write("guo-figure-8.jpg", [pictures[:3], pictures[3:]], 380)


def photo_depth() -> None:
    """Photographs, the depth of `depth.from_photo`, and the published map read as depth: near is dark."""
    rows = []
    for name in ("motorcycle", "outdoor:1:640x400", "rocket"):
        image = _display(f"sample:{name}")
        published = from_transmission(mrf(mean_shift(image)).transmission)
        rows.append([image, _grey(from_photo(image).depth), _grey(published)])
    _write("photo-depth.jpg", rows, 400)


def _display(scene: str) -> np.ndarray:
    return np.clip(open_scene(scene).load("srgb").values["image"], 0, 1).astype(np.float32)


def _grey(values: np.ndarray) -> np.ndarray:
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=2)


def _write(name: str, rows: list[list[np.ndarray]], width: int) -> None:
    """Pictures in rows, all ``width`` pixels wide, with the height of the first."""
    height = round(width * rows[0][0].shape[0] / rows[0][0].shape[1])
    small = [[cv2.resize(np.asarray(p), (width, height), interpolation=cv2.INTER_AREA) for p in row] for row in rows]
    color = "linear" if name == "photo-fog.jpg" else "srgb"
    write_image(FOLDER / name, np.vstack([np.hstack(row) for row in small]), color=color)


def dehazing() -> None:
    """A hazy, noisy street and what every method makes of it, as `fogpipe bench dehaze` draws it."""
    with TemporaryDirectory() as folder:
        draw(Path(folder), quick=True, rows=[])
        sheet = cv2.imread(str(Path(folder) / "dehaze-outdoor-1.png"))
    cv2.imwrite(str(FOLDER / "dehazing-experiment.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 75])


if __name__ == "__main__":
    outdoor()
    layers()
    measured_depth()
    coefficients()
    octaves()
    drifting()
    kernels_by_angle()
    kernels_on_screen()
    lamps()
    photo_fog()
    guo_figures()
    photo_depth()
    dehazing()
