"""Sample scenes that need no files: a name, what it shows, and a function that makes it.

A new sample is one more entry in :data:`SAMPLES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fogpipe.errors import InputError, did_you_mean
from fogpipe.io.camera import CameraFile


@dataclass(frozen=True, eq=False)
class SampleFrame:
    """One frame of a sample.

    Attributes
    ----------
    pixels : (H, W, 3), uint8 sRGB display values or float32 linear light.
    range_map : (H, W) float32 in metres along the ray, NaN where unknown; None if there is no depth.
    camera : the camera, or None if it is not known.
    notes : what a reader of the result should know.
    """

    pixels: np.ndarray
    range_map: np.ndarray | None = None
    camera: CameraFile | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Sample:
    """A sample scene. ``make`` takes the options after the name, as in ``sample:outdoor:7:640x400``."""

    name: str
    title: str
    options: str
    make: Callable[..., SampleFrame]


def _motorcycle() -> SampleFrame:
    from fogpipe.io.samples.motorcycle import motorcycle

    return motorcycle()


def _outdoor(*options: str) -> SampleFrame:
    from fogpipe.io.samples.outdoor import outdoor

    given: dict[str, int] = {}
    holes = False
    for option in options:
        width, times, height = option.partition("x")
        if option == "holes":
            holes = True
        elif times and width.isdecimal() and height.isdecimal():
            given |= {"width": int(width), "height": int(height)}
        elif option.isdecimal():
            given["seed"] = int(option)
        else:
            raise InputError(f'sample:outdoor has no option "{option}"; it takes {SAMPLES["outdoor"].options}.')
    return outdoor(**given, holes=holes)


def _rocket() -> SampleFrame:
    from skimage.data import rocket

    return SampleFrame(rocket(), notes=("sample:rocket is a photograph without depth or camera",))


SAMPLES = {
    sample.name: sample
    for sample in (
        Sample("motorcycle", "Middlebury 2014 Motorcycle: a photograph with dense stereo depth", "", _motorcycle),
        Sample(
            "outdoor",
            "a country road in the sun, ray-cast: exact range, open sky, thin poles, foliage, a lamp",
            "a seed, a size as WIDTHxHEIGHT, and holes (window panes without range)",
            _outdoor,
        ),
        Sample("rocket", "a night photograph of a rocket on its pad, without depth", "", _rocket),
    )
}
"""Every sample by name."""


def sample_named(name: str) -> Sample:
    """The sample of that name.

    Raises
    ------
    InputError
        If there is none; the message lists all.
    """
    if name not in SAMPLES:
        known = "\n".join(f"  sample:{sample.name:<12} {sample.title}" for sample in SAMPLES.values())
        raise InputError(f'no sample scene "{name}".{did_you_mean(name, SAMPLES)} Known:\n{known}')
    return SAMPLES[name]
