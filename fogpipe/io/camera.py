"""Cameras: the intrinsic matrix, and for stereo pairs what turns a disparity into a depth.

Files understood, told apart by what they hold:

* fogpipe's own JSON: ``{"fx": 994.978, "fy": 994.978, "cx": 311.193, "cy": 254.877}``, optionally with
  ``baseline`` (m), ``doffs`` (px), ``width`` and ``height`` (px);
* Cityscapes JSON: ``{"intrinsic": {"fx", "fy", "u0", "v0"}, "extrinsic": {"baseline"}}``;
* Middlebury 2014 ``calib.txt``: ``cam0=[fx 0 cx; 0 fy cy; 0 0 1]``, ``doffs``, ``baseline`` (mm), ``width`` and
  ``height``;
* KITTI ``calib_cam_to_cam.txt``: ``P_rect_02`` and ``S_rect_02``, the left colour camera after rectification; the
  ``calib`` files of its object detection, ``P2``; and the intrinsics of its depth selection, nine numbers;
* Synscapes JSON: ``{"camera": {"intrinsic": {"fx", "fy", "u0", "v0", "resx", "resy"}}, …}``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fogpipe.errors import InputError, did_you_mean
from fogpipe.io.files import read_bytes

MAX_BYTES = 1 << 20
"""A camera file is a few lines; anything larger is something else."""
ASPECT_TOLERANCE = 0.01
"""Relative difference of the two scale factors that rounding to whole pixels explains."""
OWN_KEYS = ("fx", "fy", "cx", "cy", "baseline", "doffs", "width", "height")


@dataclass(frozen=True, eq=False)
class CameraFile:
    """What a camera file says.

    Attributes
    ----------
    matrix : (3, 3) float64, intrinsic matrix in pixels, the first pixel centre at (0, 0).
    baseline : distance between the two cameras of a stereo pair (m), or None.
    doffs : difference of the two principal points in x (px), added to a disparity, or None.
    size : (width, height) of the images that the matrix belongs to, or None if the file does not say.
    source : where it came from, for messages.
    """

    matrix: np.ndarray
    baseline: float | None = None
    doffs: float | None = None
    size: tuple[int, int] | None = None
    source: str = "camera"

    def fitted_to(self, width: int, height: int) -> tuple[CameraFile, tuple[str, ...]]:
        """The camera for images of the given size, and notes on what was changed.

        A file that states another size of the same aspect is scaled: focal lengths by the factor s,
        principal point by ``s·(c + 1/2) − 1/2`` (pixel centres are whole numbers), disparity offset by s.

        Raises
        ------
        InputError
            If the stated size has another aspect, or if no size is stated and the principal point is
            outside the image, as it is when the image was scaled and the camera was not.
        """
        if self.size is None:
            self._expect_centre_inside(width, height)
            return self, ()
        if self.size == (width, height):
            return self, ()
        sx, sy = width / self.size[0], height / self.size[1]
        stated = f"{self.size[0]}×{self.size[1]}"
        if abs(sx / sy - 1) > ASPECT_TOLERANCE:
            raise InputError(
                f"{self.source}: is for images of {stated} pixels, but this one has {width}×{height}, another aspect."
                " Give the camera of this image; after cropping, subtract the crop's corner from cx and cy."
            )
        scale = np.array([[sx, sx, sx], [1, sy, sy], [1, 1, 1]])
        shift = np.array([[0, 0, (sx - 1) / 2], [0, 0, (sy - 1) / 2], [0, 0, 0]])
        fitted = replace(
            self,
            matrix=self.matrix * scale + shift,
            doffs=None if self.doffs is None else self.doffs * sx,
            size=(width, height),
        )
        return fitted, (f"{self.source} is for {stated} pixels and was scaled to {width}×{height}",)

    def _expect_centre_inside(self, width: int, height: int) -> None:
        cx, cy = self.matrix[:2, 2]
        if not (-0.5 <= cx <= width - 0.5 and -0.5 <= cy <= height - 0.5):
            raise InputError(
                f"{self.source}: principal point ({cx:g}, {cy:g}) is outside the image of {width}×{height} pixels."
                " The camera belongs to another size. Add the width and height it belongs to"
                " (as JSON with fx, fy, cx, cy, width, height), and it will be scaled."
            )


def camera_from(given: str | Path | Mapping[str, Any], source: str = "camera") -> CameraFile:
    """A camera from its file, or from a mapping as in a scene file, which messages call ``source``."""
    return camera_from_mapping(given, source) if isinstance(given, Mapping) else read_camera(given)


def read_camera(path: str | Path) -> CameraFile:
    """Read a camera file in any of the forms above.

    Raises
    ------
    InputError
        If the file is missing, unreadable or of no known form; if a key is missing, unknown or not a
        finite number; if a focal length, baseline or size is not positive.
    """
    text = _text(path)
    if text.lstrip().startswith("{"):
        try:
            content = json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise InputError(f"{path}: is not readable JSON: {error}") from error
        return camera_from_mapping(content, str(path))
    if "cam0" in text:
        return _from_middlebury(_key_values(text, "="), str(path))
    values = _key_values(text, ":")
    if key := next((key for key in ("P_rect_02", "P2") if key in values), None):
        return _from_kitti(values, key, str(path))
    if _is_matrix(text.split()):
        return _from_matrix(text.split(), str(path))
    raise InputError(
        f"{path}: is not a camera file. Known forms: JSON with {', '.join(OWN_KEYS[:4])}; Cityscapes and Synscapes"
        " camera JSON; Middlebury 2014 calib.txt; KITTI calib_cam_to_cam.txt, calib and intrinsics."
    )


def camera_from_mapping(content: Mapping[str, Any], source: str) -> CameraFile:
    """A camera from the content of a JSON file, or from a mapping in a scene file.

    Raises
    ------
    InputError
        As :func:`read_camera`.
    """
    if "camera" in content:  # Synscapes, beside much else
        content = _section(content, "camera", source)
    if "intrinsic" in content:
        intrinsic = _section(content, "intrinsic", source)
        baseline = _section(content, "extrinsic", source).get("baseline") if "extrinsic" in content else None
        content = {key: intrinsic.get(name) for key, name in zip(OWN_KEYS, ("fx", "fy", "u0", "v0"), strict=False)}
        content |= {} if baseline is None else {"baseline": baseline}
        if "resx" in intrinsic and "resy" in intrinsic:
            content |= {"width": intrinsic["resx"], "height": intrinsic["resy"]}
    for key in content:
        if key not in OWN_KEYS:
            meant = did_you_mean(str(key), OWN_KEYS)
            raise InputError(f"{source}: unknown key {key!r}.{meant} Known: {', '.join(OWN_KEYS)}.")
    return _camera(content.get, source)


def _from_middlebury(values: Mapping[str, str], source: str) -> CameraFile:
    rows = [row.split() for row in values.get("cam0", "").strip("[] ").split(";")]
    if [len(row) for row in rows] != [3, 3, 3]:
        raise InputError(f"{source}: cam0 must be written as [fx 0 cx; 0 fy cy; 0 0 1].")
    given: dict[str, Any] = {"fx": rows[0][0], "cx": rows[0][2], "fy": rows[1][1], "cy": rows[1][2], **values}
    camera = _camera(given.get, source)
    return replace(camera, baseline=None if camera.baseline is None else camera.baseline / 1000)


def _from_kitti(values: Mapping[str, str], key: str, source: str) -> CameraFile:
    projection = values[key].split()
    if len(projection) != 12:
        raise InputError(f"{source}: {key} holds {len(projection)} numbers, but a 3×4 projection matrix has 12.")
    given: dict[str, Any] = {"fx": projection[0], "cx": projection[2], "fy": projection[5], "cy": projection[6]}
    if size := values.get("S_rect_02", "").split():
        given |= zip(("width", "height"), size, strict=False)
    return _camera(given.get, source)


def _is_matrix(words: list[str]) -> bool:
    """Whether these are the nine numbers of [fx 0 cx; 0 fy cy; 0 0 1], row by row."""
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return False
    return len(numbers) == 9 and numbers[6:] == [0, 0, 1]


def _from_matrix(words: list[str], source: str) -> CameraFile:
    given: dict[str, Any] = {"fx": words[0], "cx": words[2], "fy": words[4], "cy": words[5]}
    return _camera(given.get, source)


def _camera(value_of: Callable[[str], Any], source: str) -> CameraFile:
    given = {key: value_of(key) for key in OWN_KEYS}
    missing = [key for key in OWN_KEYS[:4] if given[key] is None]
    if missing:
        raise InputError(f"{source}: {', '.join(missing)} missing; a camera needs {', '.join(OWN_KEYS[:4])}.")
    numbers = {key: _number(value, key, source) for key, value in given.items() if value is not None}
    for key in ("fx", "fy", "baseline", "width", "height"):
        if numbers.get(key, 1) <= 0:
            raise InputError(f"{source}: {key} is {numbers[key]:g}, but it must be positive.")
    if ("width" in numbers) != ("height" in numbers):
        raise InputError(f"{source}: width and height are given together or not at all.")
    matrix = np.array([[numbers["fx"], 0, numbers["cx"]], [0, numbers["fy"], numbers["cy"]], [0, 0, 1]], np.float64)
    size = (round(numbers["width"]), round(numbers["height"])) if "width" in numbers else None
    return CameraFile(matrix, numbers.get("baseline"), numbers.get("doffs"), size, source)


def _number(value: Any, key: str, source: str) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{source}: {key} is {str(value)[:40]!r}, but it must be a finite number.")
    return number


def _section(content: Mapping[str, Any], key: str, source: str) -> Mapping[str, Any]:
    if not isinstance(content[key], Mapping):
        raise InputError(f"{source}: {key!r} must be a mapping, as in a Cityscapes or Synscapes camera file.")
    return content[key]


def _key_values(text: str, separator: str) -> dict[str, str]:
    pairs = (line.partition(separator) for line in text.splitlines() if separator in line)
    return {key.strip(): value.strip() for key, _, value in pairs}


def _text(path: str | Path) -> str:
    data = read_bytes(path)
    if len(data) > MAX_BYTES:
        raise InputError(f"{path}: is too large for a camera file.")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text, so not a camera file.") from error
