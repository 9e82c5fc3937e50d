"""Makes the pictures of the README and the docs: ``python docs/pictures.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import fogpipe
from fogpipe.io.images import write_image
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.perlin import field
from fogpipe.stages.composite import attenuate, over_airlight
from fogpipe.stages.density import along_rays
from fogpipe.stages.medium import transmission as beer_lambert

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
    write_image(FOLDER / "layers.jpg", np.vstack(rows))


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


def _photograph(name: str) -> np.ndarray:
    return open_scene(f"sample:{name}").load("linear", ["image"]).values["image"]


if __name__ == "__main__":
    outdoor()
    layers()
    coefficients()
    octaves()
    drifting()
