"""Scenes: named bundles of pipeline inputs, from a sample, from a scene file, or from single files.

A scene file is YAML, with paths relative to itself::

    title: A street in Karlsruhe
    image: rgb.png
    depth: depth.png
    encoding: kitti
    camera: {fx: 707.0493, fy: 707.0493, cx: 604.0814, cy: 180.5066}    # or a path
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fogpipe.errors import InputError, did_you_mean
from fogpipe.io.camera import CameraFile, camera_from_mapping, read_camera
from fogpipe.io.depth import check_same_size, read_depth, to_range
from fogpipe.io.files import read_bytes
from fogpipe.ports import Color

PREFIX = "sample:"
KEYS = ("title", "image", "depth", "encoding", "camera")


@dataclass(frozen=True, eq=False)
class SceneInputs:
    """What a scene gives to a pipeline.

    Attributes
    ----------
    values : by input name, as far as known: ``image`` (H, W, 3), ``range_map`` (H, W) in metres or
        ``relative_depth`` (H, W), ``camera`` (3, 3).
    alpha : (H, W) opacity of the image, or None.
    notes : what a reader of the result should know.
    sources : for each value, the file or sample it came from.
    """

    values: dict[str, np.ndarray]
    alpha: np.ndarray | None
    notes: tuple[str, ...]
    sources: dict[str, str]


@dataclass(frozen=True, slots=True)
class Scene:
    """A named bundle of pipeline inputs that is loaded on demand."""

    reference: str
    title: str
    loader: Callable[[Color], SceneInputs]

    def load(self, color: Color = "linear") -> SceneInputs:
        """Read or make the inputs, the image in linear light or in sRGB display values.

        Raises
        ------
        InputError
            If a file cannot be used or does not fit the others.
        """
        return self.loader(color)


def open_scene(reference: str | Path) -> Scene:
    """A scene by reference.

    Parameters
    ----------
    reference : ``sample:NAME``, with options as in ``sample:outdoor:7:640x400``; or the path of a scene file.

    Raises
    ------
    InputError
        If there is no such sample, or the scene file is not valid.
    """
    text = str(reference)
    return _sample_scene(text) if text.startswith(PREFIX) else _scene_from_yaml(Path(reference))


def scene_from_files(
    image: str | Path | None,
    depth: str | Path | None = None,
    *,
    encoding: str | None = None,
    camera: str | Path | Mapping[str, Any] | None = None,
    title: str = "",
    reference: str = "files",
) -> Scene:
    """A scene from single files: an image, and optionally a depth map with its encoding and a camera.

    Raises
    ------
    InputError
        If there is neither image nor depth, or an encoding without a depth. Files are read by :meth:`Scene.load`.
    """
    if image is None and depth is None:
        raise InputError(f"{reference}: gives neither an image nor a depth.")
    if encoding is not None and depth is None:
        raise InputError(f"{reference}: names the depth encoding {encoding} but gives no depth.")

    def load(color: Color) -> SceneInputs:
        return _load_files(image, depth, encoding, _camera(camera, reference), color)

    return Scene(reference, title or Path(str(image or depth)).stem, load)


def _load_files(
    image: str | Path | None, depth: str | Path | None, encoding: str | None, camera: CameraFile | None, color: Color
) -> SceneInputs:
    from fogpipe.io.images import read_image

    values: dict[str, np.ndarray] = {}
    sources: dict[str, str] = {}
    notes: list[str] = []
    alpha = None
    if image is not None:
        picture = read_image(image, color=color)
        values["image"], sources["image"], alpha = picture.pixels, str(image), picture.alpha
    if depth is not None:
        depth_map = read_depth(depth, encoding=encoding, camera=camera)
        notes += depth_map.notes
        name = "relative_depth" if depth_map.geometry == "relative" else "range_map"
        if name == "range_map":
            values[name], more = to_range(depth_map, camera)
            notes += more
        else:
            values[name] = depth_map.values
        sources[name] = str(depth)
        if image is not None:
            check_same_size(values["image"], values[name], (str(image), str(depth)))
    if camera is not None:
        height, width = next(iter(values.values())).shape[:2]
        fitted, more = camera.fitted_to(width, height)
        values["camera"], sources["camera"] = fitted.matrix, camera.source
        notes += (note for note in more if note not in notes)
    return SceneInputs(values, alpha, tuple(notes), sources)


def _camera(given: str | Path | Mapping[str, Any] | None, reference: str) -> CameraFile | None:
    if isinstance(given, Mapping):
        return camera_from_mapping(given, f"{reference}: camera")
    return None if given is None else read_camera(given)


def _sample_scene(reference: str) -> Scene:
    from fogpipe.io.samples import sample_named

    name, *options = reference.removeprefix(PREFIX).split(":")
    sample = sample_named(name)
    if options and not sample.options:
        raise InputError(f"sample:{name} takes no options, but {reference} gives {':'.join(options)}.")

    def load(color: Color) -> SceneInputs:
        from fogpipe.io.images import picture_from_array
        from fogpipe.kernels.srgb import srgb_from_linear

        frame = sample.make(*options)
        light = frame.pixels.dtype.kind == "f" and color == "srgb"
        picture = picture_from_array(srgb_from_linear(frame.pixels) if light else frame.pixels, color=color)
        values = {"image": picture.pixels}
        if frame.range_map is not None:
            values["range_map"] = frame.range_map
        if frame.camera is not None:
            values["camera"] = frame.camera.matrix
        return SceneInputs(values, picture.alpha, frame.notes, dict.fromkeys(values, reference))

    return Scene(reference, sample.title, load)


def _scene_from_yaml(path: Path) -> Scene:
    content = _read_yaml(path)
    for key, value in content.items():
        if key not in KEYS:
            raise InputError(f"{path}: unknown key {key!r}.{did_you_mean(str(key), KEYS)} Known: {', '.join(KEYS)}.")
        wanted = (str, Mapping) if key == "camera" else (str,)
        if not isinstance(value, wanted):
            raise InputError(f"{path}: {key} must be {'a path or a mapping' if key == 'camera' else 'text'}.")
    files = {key: path.parent / content[key] for key in ("image", "depth") if key in content}
    camera = content.get("camera")
    return scene_from_files(
        files.get("image"),
        files.get("depth"),
        encoding=content.get("encoding"),
        camera=path.parent / camera if isinstance(camera, str) else camera,
        title=content.get("title", path.stem),
        reference=str(path),
    )


def _read_yaml(path: Path) -> dict[Any, Any]:
    import yaml

    try:
        data = read_bytes(path)
    except InputError as error:
        from fogpipe.io.samples import SAMPLES

        samples = ", ".join(PREFIX + name for name in SAMPLES)
        raise InputError(f"{error} A scene is a YAML file or one of {samples}.") from error
    try:
        content = yaml.safe_load(data.decode("utf-8-sig"))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: is not readable YAML: {error}") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: must be a mapping with the keys {', '.join(KEYS)}.")
    return content
