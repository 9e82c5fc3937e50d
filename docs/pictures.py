"""Makes the pictures of the README and the docs: ``python docs/pictures.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import fogpipe
from fogpipe.io.images import write_image
from fogpipe.io.scenes import open_scene
from fogpipe.stages.composite import naive
from fogpipe.stages.depth import from_photo, from_transmission
from fogpipe.stages.haziness import mrf
from fogpipe.stages.medium import thicken
from fogpipe.stages.refine import bilateral
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


if __name__ == "__main__":
    outdoor()
    photo_fog()
    guo_figures()
    photo_depth()
