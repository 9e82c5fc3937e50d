"""Scenes: named bundles of pipeline inputs, from a sample, from a scene file, or from single files.

A scene file is YAML, with paths relative to itself::

    title: A street in Karlsruhe
    image: rgb.png
    depth: depth.png
    encoding: kitti
    camera: {fx: 707.0493, fy: 707.0493, cx: 604.0814, cy: 180.5066}    # or a path
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fogpipe.errors import InputError, did_you_mean
from fogpipe.io.camera import CameraFile, camera_from
from fogpipe.io.encodings import encoding_named
from fogpipe.io.files import read_bytes
from fogpipe.io.given import Given, GivenInputs, camera_given, read_given
from fogpipe.ports import Color, known_kinds

PREFIX = "sample:"
KEYS = ("title", "image", "depth", "encoding", "camera")
NAMES = ("image", "range_map", "relative_depth", "camera")
"""Every input that a scene may give."""

Loader = Callable[[Color, Collection[str], CameraFile | None], GivenInputs]


@dataclass(frozen=True, slots=True)
class Scene:
    """A named bundle of pipeline inputs that is loaded on demand."""

    reference: str
    title: str
    loader: Loader

    def load(
        self, color: Color = "linear", wanted: Collection[str] = NAMES, camera: CameraFile | None = None
    ) -> GivenInputs:
        """Read or make the inputs.

        Parameters
        ----------
        color : whether the image comes in linear light or in sRGB display values.
        wanted : what is needed of ``image`` (H, W, 3), ``range_map`` (H, W) in metres, ``relative_depth`` (H, W) and
            ``camera`` (3, 3); a file that nobody wants is not read.
        camera : takes the place of the scene's own.

        Returns
        -------
        What is wanted, as far as the scene has it, and its camera.

        Raises
        ------
        InputError
            If a file cannot be used or does not fit the others.
        """
        return self.loader(color, wanted, camera)


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

    def load(color: Color, wanted: Collection[str], other_camera: CameraFile | None) -> GivenInputs:
        taken_by = other_camera or (None if camera is None else camera_from(camera, f"{reference}: camera"))
        relative = encoding is not None and encoding_named(encoding).quantity == "relative"
        files = {
            "image": ("Image", image),
            "relative_depth" if relative else "range_map": ("RelativeDepth" if relative else "Range", depth),
        }
        kinds = known_kinds()
        inputs = {
            name: read_given(name, kinds[kind], str(path), color=color, encoding=encoding, camera=taken_by)
            for name, (kind, path) in files.items()
            if path is not None and name in wanted
        }
        return _with_camera(inputs, wanted, taken_by)

    return Scene(reference, title or Path(str(image or depth)).stem, load)


def _with_camera(inputs: dict[str, Given], wanted: Collection[str], camera: CameraFile | None) -> GivenInputs:
    if camera and "camera" in wanted:
        inputs["camera"] = camera_given(camera, inputs)
    return GivenInputs(inputs, camera)


def _sample_scene(reference: str) -> Scene:
    from fogpipe.io.samples import sample_named

    name, *options = reference.removeprefix(PREFIX).split(":")
    sample = sample_named(name)
    if options and not sample.options:
        raise InputError(f"sample:{name} takes no options, but {reference} gives {':'.join(options)}.")

    def load(color: Color, wanted: Collection[str], other_camera: CameraFile | None) -> GivenInputs:
        frame = sample.make(*options)
        inputs: dict[str, Given] = {}
        image_notes, range_notes = (frame.notes, ()) if frame.range_map is None else ((), frame.notes)
        if "image" in wanted:
            from fogpipe.io.images import picture_from_array
            from fogpipe.kernels.srgb import srgb_from_linear

            light = frame.pixels.dtype.kind == "f" and color == "srgb"
            picture = picture_from_array(srgb_from_linear(frame.pixels) if light else frame.pixels, color=color)
            inputs["image"] = Given(picture.pixels, "Image", reference, image_notes, picture.alpha)
        if "range_map" in wanted and frame.range_map is not None:
            inputs["range_map"] = Given(frame.range_map, "Range", reference, range_notes)
        own_camera = frame.camera and replace(frame.camera, source=reference)
        return _with_camera(inputs, wanted, other_camera or own_camera)

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
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not text, and a scene is a YAML file that names pictures."
            " Give a picture itself by -i image=FILE."
        ) from error
    except (yaml.YAMLError, RecursionError) as error:
        raise InputError(f"{path}: is not readable YAML: {error}") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: must be a mapping with the keys {', '.join(KEYS)}.")
    return content
