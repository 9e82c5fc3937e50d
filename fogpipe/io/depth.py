"""Depth files to metres: read the numbers, decode them by a named encoding, refuse what cannot be depth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from fogpipe.errors import InputError
from fogpipe.io.camera import CameraFile
from fogpipe.io.depth_files import ORIGINAL, read_numbers
from fogpipe.io.encodings import DepthEncoding, encoding_named, encodings_text
from fogpipe.io.files import file_name
from fogpipe.kernels.rays import planar_to_radial

Geometry = Literal["planar", "radial", "relative"]
FARTHEST = 1e6
"""Metres. No surface on Earth is seen from farther; a larger number is a mistake in unit or encoding."""
REVERSED = 0.6
"""Rank correlation of row and distance from which a map is doubted. Ground and floor go the other way."""
ENOUGH_PIXELS = 10_000
"""Measured pixels below which the layout of a map says nothing."""
ENOUGH_CODES = 64
"""Different whole numbers that a map of metres has by chance never."""
LEAST_CODE = 256
"""Metres that are rounded to whole ones seldom reach so far; millimetres and other codes do."""
CLOSE = 300
"""Metres within which most scenes have something."""


CODES = (
    "all values are whole numbers, as millimetres and other codes are, and metres are not. Divide them, or save them as"
    " uint16 and name their encoding, such as millimetres. If they are metres that were rounded, add 0.1 to all."
)
"""What is wrong with a map that :func:`are_codes` finds, and what to do."""


@dataclass(frozen=True, eq=False)
class DepthMap:
    """A decoded depth map.

    Attributes
    ----------
    values : (H, W) float32. NaN where unknown, +inf for sky.
    geometry : ``planar`` or ``radial`` in metres, or ``relative`` (0 near, 1 far).
    notes : what a reader of the result should know.
    """

    values: np.ndarray
    geometry: Geometry
    notes: tuple[str, ...]


def read_depth(path: str | Path, *, encoding: str | None, camera: CameraFile | None = None) -> DepthMap:
    """Read a depth map.

    Parameters
    ----------
    path : PNG (16-bit grey), ``.npy``, ``.npz`` with one array, PFM, or OpenEXR with a channel ``Z``, told by content.
    encoding : a name in :data:`fogpipe.io.encodings.ENCODINGS`. It cannot be left out, because no file tells
        metres from millimetres, planar from radial, or depth from inverse depth; None raises the error
        that lists the encodings this type of file may have.
    camera : needed by disparities, for baseline and focal length.

    Raises
    ------
    InputError
        If the file cannot be read, is a colour-mapped or 8-bit picture of depth, does not fit the encoding, lacks
        the camera it needs, or decodes to something that is no depth: negative, zero (a surface at the
        lens), beyond 1000 km, unknown everywhere, normalised (metres whose largest is exactly 1), or in millimetres or
        other codes where metres are named (whole numbers only).

    Notes
    -----
    Inverse depth cannot be told from depth by its numbers. A map that is farther at the bottom of the picture than at
    the top, where most scenes are nearer, gets a note that asks.
    """
    numbers = read_numbers(path)
    if encoding is None:
        choices = encodings_text(numbers.format)
        raise InputError(f"{path}: name the encoding of its depth; a {numbers.format} file may be\n{choices}")
    known = encoding_named(encoding)
    _check_storage(path, numbers.format, numbers.values, known)
    values = _decode(path, numbers.values, known, camera)
    _check_plausible(path, values, known)
    geometry: Geometry = "planar" if known.quantity == "disparity" else known.quantity
    values = values.astype(np.float32, copy=False)
    remarks = (numbers.note, _doubt(values))
    return DepthMap(
        values, geometry, (_summary(path, values, known), *(f"{file_name(path)}: {r}" for r in remarks if r))
    )


def to_range(depth: DepthMap, camera: CameraFile | None) -> tuple[np.ndarray, tuple[str, ...]]:
    """Distance along the ray, (H, W) float32 in metres, and notes on how it was found.

    Planar depth Z becomes ``Z·|K⁻¹ (u, v, 1)|``. Without a camera it is taken for the range as it is, which is too
    short towards the corners (by 1/cos of the angle from the optical axis), and a note says so.

    Raises
    ------
    InputError
        If the depth is relative, or the camera is for another size.
    """
    if depth.geometry == "relative":
        raise InputError("relative depth has no unit and cannot become a range in metres; use it as relative_depth.")
    if depth.geometry == "radial":
        return depth.values, ()
    if camera is None:
        return depth.values, (
            "no camera: planar depth is taken for the distance along the ray, too short towards the corners."
            " Pass a camera (fx, fy, cx, cy in pixels) for the true range.",
        )
    height, width = depth.values.shape
    fitted, notes = camera.fitted_to(width, height)
    return planar_to_radial(depth.values, fitted.matrix), (*notes, f"planar depth made radial with {camera.source}")


def are_codes(values: np.ndarray) -> bool:
    """Whether floats that should be metres are millimetres or other codes: many whole numbers, and nothing else.

    Half floats are left alone, since all of theirs are whole from 1024 on. Leaves at the first number with a fraction.
    """
    if values.dtype == np.float16 or values.dtype.kind != "f":
        return False
    some = values.ravel()[:1024]
    if (some[np.isfinite(some)] % 1).any():
        return False
    known = values[np.isfinite(values)]
    return (
        known.size > 0 and known.max() >= LEAST_CODE and not (known % 1).any() and np.unique(known).size >= ENOUGH_CODES
    )


def _check_storage(path: str | Path, file_format: str, numbers: np.ndarray, encoding: DepthEncoding) -> None:
    if file_format not in encoding.files:
        raise InputError(
            f"{path}: {encoding.name} is stored as {', '.join(encoding.files)}, not as {file_format};"
            f" a {file_format} file may be\n{encodings_text(file_format)}"
        )
    if numbers.dtype.kind not in "uif":
        raise InputError(f"{path}: holds {numbers.dtype} values, but depth is real or whole numbers.")
    if numbers.dtype.itemsize == 1:
        raise InputError(f"{path}: holds 8-bit values: a picture of depth, with 256 steps at most. {ORIGINAL}")
    if encoding.rotated and numbers.dtype != np.uint16:
        raise InputError(f"{path}: holds {numbers.dtype} values, but {encoding.name} rotates the bits of uint16.")
    if encoding.whole != (numbers.dtype.kind in "ui"):
        wanted = "whole numbers" if encoding.whole else "real numbers"
        raise InputError(f"{path}: holds {numbers.dtype} values, but {encoding.name} is made of {wanted}. {ORIGINAL}")
    if encoding.quantity in ("planar", "radial") and file_format != "exr" and are_codes(numbers):
        raise InputError(f"{path}: as {encoding.name}, {CODES}")


def _decode(path: str | Path, numbers: np.ndarray, encoding: DepthEncoding, camera: CameraFile | None) -> np.ndarray:
    """Numbers of the file to metres, NaN and +inf; float64 if the file is, else float32."""
    if encoding.rotated:
        numbers = (numbers >> 3) | (numbers << 13)
    values = numbers.astype(np.float64 if numbers.dtype == np.float64 else np.float32)
    sky = np.zeros(values.shape, bool)
    if encoding.sky is not None:
        sky |= values >= encoding.sky
    if encoding.background is not None:
        sky |= values == encoding.background
    if encoding.unknown is not None:
        values[values == encoding.unknown] = np.nan
    values -= encoding.offset
    values /= encoding.divisor
    if encoding.quantity == "disparity":
        values = _depth_from_disparity(path, values, encoding, camera)
    values[sky] = np.inf
    return values


def _depth_from_disparity(
    path: str | Path, disparity: np.ndarray, encoding: DepthEncoding, camera: CameraFile | None
) -> np.ndarray:
    """``Z = baseline · fx / (disparity + doffs)``, +inf where the sum is 0; doffs only if the encoding needs it."""
    if camera is None or any(getattr(camera, need) is None for need in encoding.needs):
        lacking = "a camera file" if camera is None else f"{camera.source} to state {' and '.join(encoding.needs)}"
        raise InputError(f"{path}: {encoding.name} is disparity and needs {lacking}: {encoding.formula}.")
    height, width = disparity.shape
    if camera.size not in (None, (width, height)):
        raise InputError(
            f"{path}: has {width}×{height} disparities, but {camera.source} states another size."
            " A resized disparity map does not say whether its values were scaled too; give the original."
        )
    camera.fitted_to(width, height)
    assert camera.baseline is not None  # it is among encoding.needs
    doffs = camera.doffs if "doffs" in encoding.needs else 0.0
    with np.errstate(divide="ignore"):
        return camera.baseline * float(camera.matrix[0, 0]) / (disparity + doffs)


def _check_plausible(path: str | Path, values: np.ndarray, encoding: DepthEncoding) -> None:
    def refuse(what: str, count: int, hint: str) -> None:
        if count:
            raise InputError(f"{path}: as {encoding.name}, {count} of {values.size} pixels {what}. {hint}")

    unknown = int(np.count_nonzero(np.isnan(values)))
    if unknown == values.size:
        raise InputError(f"{path}: as {encoding.name}, no pixel holds a depth ({encoding.codes}).")
    negative = int(np.count_nonzero(values < 0))
    refuse("have a negative depth", negative, "Is it an inverse or normalised map, or another encoding?")
    if encoding.quantity == "relative":
        refuse("are above 1", int(np.count_nonzero(values > 1)), "Relative depth is 0 near to 1 far.")
        return
    zero = int(np.count_nonzero(values == 0))
    refuse("are at 0 m, at the lens itself", zero, "If 0 marks unknown, say so by the encoding metres-zero-unknown.")
    absurd = int(np.count_nonzero((values > FARTHEST) & (values < np.inf)))
    refuse(f"are farther than {FARTHEST / 1000:g} km", absurd, "Is the unit or the encoding another one?")
    if not encoding.whole and np.nanmax(values) == 1 and np.nanmin(values) < 1:
        refuse(
            "are at exactly 1 m and none is farther",
            int(np.count_nonzero(values == 1)),
            "A normalised map looks like this. Give metres; or name the encoding relative, if 0 is near and 1 is far"
            " (turn inverse depth round first). If these are metres, cut off at 1 m, make the cut pixels NaN.",
        )


def _doubt(values: np.ndarray) -> str:
    """A question about a map that is nearer at the top than at the bottom, or an empty text.

    Spearman's rank correlation of row and distance, over a regular share of the measured pixels.
    """
    measured = np.flatnonzero(np.isfinite(values))
    if measured.size < ENOUGH_PIXELS:
        return ""
    sampled = measured[:: measured.size // ENOUGH_PIXELS]
    rows, distances = _ranks(sampled // values.shape[1]), _ranks(values.reshape(-1)[sampled])
    spread = np.sqrt((rows**2).mean() * (distances**2).mean())
    if (rows * distances).mean() < REVERSED * spread or spread == 0:
        return ""
    return "nearer at the top than at the bottom: is this inverse depth?"


def _ranks(values: np.ndarray) -> np.ndarray:
    """Ranks about their mean; equal values share one."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks = np.cumsum(counts) - (counts - 1) / 2
    return ranks[inverse] - (values.size + 1) / 2


def _summary(path: str | Path, values: np.ndarray, encoding: DepthEncoding) -> str:
    unknown, sky = np.isnan(values).mean(), np.isposinf(values).mean()
    finite = values[np.isfinite(values)]
    unit = "" if encoding.quantity == "relative" else " m"
    extent = f"{finite.min():.4g} to {finite.max():.4g}{unit}" if finite.size else "sky only"
    parts = [extent, f"{unknown:.1%} unknown", f"{sky:.1%} sky"]
    if unit and finite.size and finite.max() < 1:
        parts.append("all below 1 m: make sure that it is not relative depth")
    if unit and finite.size and finite.min() >= CLOSE:
        parts.append(f"nothing nearer than {CLOSE} m: make sure that the unit is metres")
    return f"{file_name(path)} as {encoding.name} ({encoding.formula}): {', '.join(parts)}"
