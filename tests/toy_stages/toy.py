"""Small stages that the tests of the framework wire together."""

from __future__ import annotations

import threading
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Le

from fogpipe.ports import Density, Image, Length, Mask, Number, Range, Transmission, Unit
from fogpipe.stage import stage

calls: list[str] = []
"""Names of the stages that ran, in order of their start."""
meeting = threading.Barrier(2, timeout=10)
"""Two stages that wait here prove that they run side by side."""


class Halves(NamedTuple):
    near: Mask
    far: Mask


def _nothing_to_add(distance: float) -> str | None:
    """skipped when the distance is 0"""
    return "the distance is 0" if distance == 0 else None


def _all_known(range_map: Range) -> str | None:
    """skipped when every range is known"""
    return None if np.isnan(range_map).any() else "every range is known"


@stage("toy.farther", identity_when=_nothing_to_add)
def farther(range_map: Range, *, distance: Annotated[float, Ge(0), Unit("m")] = 1.0) -> Range:
    """Move everything away.

    Parameters
    ----------
    range_map : (H, W) metres.
    distance : how far.

    Returns
    -------
    (H, W) metres.
    """
    calls.append("farther")
    return range_map + np.asarray(distance, dtype=range_map.dtype)


@stage("toy.fill", identity_when=_all_known)
def fill(range_map: Range, *, value: Annotated[float, Ge(0), Unit("m")] = 5.0) -> Range:
    """Replace unknown ranges by a value.

    Parameters
    ----------
    range_map : (H, W) metres.
    value : what unknown ranges become.

    Returns
    -------
    (H, W) metres.
    """
    calls.append("fill")
    return np.where(np.isnan(range_map), np.asarray(value, range_map.dtype), range_map)


@stage("toy.split")
def split(range_map: Range, *, at: Annotated[float, Unit("m")] = 3.0) -> Halves:
    """Tell near from far.

    Parameters
    ----------
    range_map : (H, W) metres.
    at : where far begins.

    Returns
    -------
    near : (H, W) bool.
    far : (H, W) bool.
    """
    calls.append("split")
    return Halves(range_map < at, range_map >= at)


@stage("toy.transmission")
def transmission(
    range_map: Range,
    density: Density | None = None,
    *,
    extinction: Annotated[float, Ge(0), Unit("1/m")] = 0.1,
    law: Literal["exponential", "linear"] = "exponential",
) -> Transmission:
    """Transmission of a toy medium.

    Parameters
    ----------
    range_map : (H, W) metres.
    density : (H, W), optional.
    extinction : per metre.
    law : how it falls.

    Returns
    -------
    (H, W) in [0, 1].
    """
    calls.append("transmission")
    thickness = extinction * range_map * (1 if density is None else density)
    return np.exp(-thickness) if law == "exponential" else np.clip(1 - thickness, 0, 1)


@stage("toy.noise")
def noise(image: Image, *, rng: np.random.Generator, sigma: Annotated[float, Ge(0), Le(1)] = 0.1) -> Image:
    """Add white noise.

    Parameters
    ----------
    image : (H, W, 3).
    sigma : standard deviation.
    rng : source of the noise.

    Returns
    -------
    (H, W, 3).
    """
    calls.append("noise")
    return (image + sigma * rng.standard_normal(image.shape)).astype(image.dtype)


@stage("toy.paint")
def paint(image: Image, transmission: Transmission, *, tolerance: float = 0.5) -> Image:
    """Darken an image by a transmission.

    Parameters
    ----------
    image : (H, W, 3).
    transmission : (H, W).
    tolerance : not used, only here to be filled in from the pipeline.

    Returns
    -------
    (H, W, 3).
    """
    calls.append("paint")
    return image * transmission[..., None]


@stage("toy.mean")
def mean(image: Image) -> Number:
    """Mean of an image.

    Parameters
    ----------
    image : (H, W, 3).

    Returns
    -------
    A number.
    """
    return np.float64(image.mean())


@stage("toy.farthest")
def farthest(range_map: Range) -> Length:
    """Largest range.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    Metres.
    """
    return np.float64(np.nanmax(range_map))


@stage("toy.meet")
def meet(range_map: Range) -> Range:
    """Wait until another stage waits here too.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    (H, W) metres.
    """
    meeting.wait()
    return range_map * 2


@stage("toy.fail")
def fail(range_map: Range, *, why: str = "it was asked to") -> Range:
    """Fail.

    Parameters
    ----------
    range_map : (H, W) metres.
    why : the message.

    Returns
    -------
    Nothing ever.
    """
    raise ValueError(why)


@stage("toy.lie")
def lie(range_map: Range) -> Range:
    """Return something else than declared.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    (H, W) metres, it says.
    """
    return np.zeros((2, 2, 2), dtype=np.float32)


@stage("toy.scribble")
def scribble(range_map: Range) -> Range:
    """Write into the input, which is forbidden.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    (H, W) metres.
    """
    range_map[0, 0] = 0
    return range_map


@stage("toy.crop")
def crop(range_map: Range) -> Range:
    """Return fewer rows than were given.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    (H, W) metres, it says.
    """
    return range_map[:1]


@stage("toy.scramble")
def scramble(range_map: Range) -> Range:
    """Stumble over a mistake of its own.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    Nothing ever.
    """
    return range_map[{"no": "index"}["of this name"]]


def _divides_by_nothing(range_map: Range) -> str | None:
    return str(1 / (range_map.size - range_map.size))


@stage("toy.doubtful", identity_when=_divides_by_nothing)
def doubtful(range_map: Range) -> Range:
    """Never run, because its condition fails.

    Parameters
    ----------
    range_map : (H, W) metres.

    Returns
    -------
    (H, W) metres.
    """
    return range_map
