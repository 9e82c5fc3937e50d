"""One input of a run as it was given, read from its file; and all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.camera import CameraFile
from fogpipe.ports import Color, Kind

DISTANCES = ("Range", "Depth", "RelativeDepth")
"""Kinds whose files need an encoding, by name."""


@dataclass(frozen=True, eq=False)
class Given:
    """One input of a run.

    Attributes
    ----------
    value : the array, of the kind's dtype where the file has it so.
    kind : name of the kind.
    source : the file, text or sample it came from.
    notes : what a reader of the result should know.
    alpha : (H, W) opacity of a picture, or None.
    orientation : EXIF orientation that was applied to a picture; 1 where it was upright.
    """

    value: np.ndarray
    kind: str
    source: str
    notes: tuple[str, ...] = ()
    alpha: np.ndarray | None = None
    orientation: int = 1


@dataclass(frozen=True, eq=False)
class GivenInputs:
    """Inputs that belong together, by name, and the camera that took them, if it is known.

    Raises
    ------
    InputError
        If a picture that EXIF had turned comes with a distance: nothing tells which way up the distance is.
    """

    inputs: Mapping[str, Given]
    camera: CameraFile | None = None

    def __post_init__(self) -> None:
        turned = next((given for given in self.inputs.values() if given.orientation != 1), None)
        distance = next((given for given in self.inputs.values() if given.kind in DISTANCES), None)
        if turned and distance:
            raise InputError(
                f"{turned.source} has EXIF orientation {turned.orientation}: it was turned upright, and nothing tells"
                f" whether {distance.source} is upright, too, or lies as the picture was stored. If it is upright, save"
                f" the picture upright without the tag; if not, remove the tag from the picture."
            )

    @property
    def values(self) -> dict[str, np.ndarray]:
        """The arrays."""
        return {name: given.value for name, given in self.inputs.items()}

    @property
    def sources(self) -> dict[str, str]:
        """Where each came from."""
        return {name: given.source for name, given in self.inputs.items()}

    @property
    def alpha(self) -> np.ndarray | None:
        """(H, W) opacity of the first picture that has one, or None."""
        return next((given.alpha for given in self.inputs.values() if given.alpha is not None), None)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the result should know, each note once."""
        return tuple(dict.fromkeys(note for given in self.inputs.values() for note in given.notes))


def read_given(
    name: str, kind: Kind, text: str, *, color: Color, encoding: str | None = None, camera: CameraFile | None = None
) -> Given:
    """Read one input from its file.

    Parameters
    ----------
    name : how messages call it.
    kind : what it is; a camera is not read here, see :func:`camera_given`.
    text : the path, or the number itself where the kind is a single number. A mask may be a part of a file, such as
        ``layers.tif#tree``, see :func:`fogpipe.io.masks.read_mask`.
    color : the working space of pictures.
    encoding, camera : how a distance is written, see :func:`fogpipe.io.depth.read_depth`.

    Raises
    ------
    InputError
        If the file cannot be used for this kind.
    """
    if kind.is_scalar:
        try:
            return Given(np.array(float(text)), kind.name, text)
        except ValueError as error:
            raise InputError(f"-i {name}={text}: {kind} is a single number.") from error
    if kind.name == "Image":
        from fogpipe.io.images import read_image

        picture = read_image(text, color=color)
        notes = (f"{name}: {picture.description}",)
        return Given(picture.pixels, kind.name, text, notes, picture.alpha, picture.orientation)
    if kind.name in DISTANCES:
        array, notes = _distance(name, kind, text, encoding, camera)
        return Given(array, kind.name, text, notes)
    if kind.dtype == "bool":
        from fogpipe.io.masks import read_mask

        return Given(read_mask(text), kind.name, text)
    from fogpipe.io.maps import read_map

    return Given(read_map(text), kind.name, text)


def camera_given(camera: CameraFile, others: Mapping[str, Given]) -> Given:
    """The intrinsic matrix as an input, for the size of the pictures and maps beside it."""
    size = next((given.value.shape[:2] for given in others.values() if given.value.ndim > 1), None)
    if size is None:
        return Given(camera.matrix, "Camera", camera.source)
    fitted, notes = camera.fitted_to(size[1], size[0])
    return Given(fitted.matrix, "Camera", camera.source, notes)


def _distance(
    name: str, kind: Kind, path: str, encoding: str | None, camera: CameraFile | None
) -> tuple[np.ndarray, tuple[str, ...]]:
    from fogpipe.io.depth import read_depth, to_range

    depth = read_depth(path, encoding=encoding, camera=camera)
    if kind.name == "Range":
        if depth.geometry == "relative":
            raise InputError(f"input {name}: {path} holds relative depth, which has no metres; {kind} is needed.")
        array, notes = to_range(depth, camera)
        return array, (*depth.notes, *notes)
    if depth.geometry != ("relative" if kind.name == "RelativeDepth" else "planar"):
        raise InputError(f"input {name}: {path} holds {depth.geometry} distance, but {kind} is needed.")
    return depth.values, depth.notes
