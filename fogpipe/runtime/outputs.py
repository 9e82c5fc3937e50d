"""Writes what a run gave: one file per output, each complete or absent."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fogpipe.errors import OutputError, RequestError
from fogpipe.pipeline.plan import Plan
from fogpipe.ports import MAP, Color, Kind

IMAGE_FORMATS = ("png", "png16", "jpg", "webp", "tif", "exr", "hdr", "npy")
MAP_FORMATS = ("npy", "exr", "tif", "png")


def check_formats(plan: Plan, image_format: str, map_format: str) -> None:
    """Refuse, before anything is computed, formats that are unknown or cannot hold an output."""
    for option, value, known in (
        ("--image-format", image_format, IMAGE_FORMATS),
        ("--map-format", map_format, MAP_FORMATS),
    ):
        if value not in known:
            raise RequestError(f"{option} {value}: choose one of {', '.join(known)}.")
    for name, ref in plan.outputs.items() if map_format == "png" else ():
        kind = plan.graph.kind(ref)
        if kind.shapes == MAP and kind.dtype == "float" and not (kind.low >= 0 and kind.high <= 1):
            raise RequestError(f"--map-format png: {name} is a {kind}, and a PNG holds values in [0, 1] only; use exr.")


def make_folder(folder: Path) -> None:
    """Make the output folder, and make sure that it can be written to, before anything is computed."""
    import tempfile

    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {error.strerror}. Choose another folder with -o.") from error


def write_output(
    folder: Path,
    name: str,
    kind: Kind,
    array: np.ndarray,
    *,
    color: Color,
    alpha: np.ndarray | None = None,
    image_format: str = "png",
    map_format: str = "npy",
) -> Path | None:
    """Write one output; returns its file, or None for what is a few numbers and stands in the record.

    Pictures get back the opacity of the input picture. Maps are written exactly, as ``.npy``, unless
    another format is asked for.
    """
    from fogpipe.io.images import write_image
    from fogpipe.io.maps import write_map

    if array.ndim < 2 or kind.name == "Camera":
        return None
    if array.ndim == 3 and array.shape[2] == 3:
        path = folder / f"{name}.{image_format.removesuffix('16')}"
        opacity = alpha if alpha is not None and alpha.shape == array.shape[:2] else None
        bits = 16 if image_format == "png16" else None
        write_image(path, array, color=color, alpha=opacity, bits=bits)
    elif array.ndim == 3:
        path = folder / f"{name}.npy"
        write_map(path, array)
    else:
        path = folder / f"{name}.{map_format}"
        write_map(path, array, channel="Z" if kind.display == "distance" else "Y")
    return path


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def numbers(values: Mapping[str, np.ndarray]) -> dict[str, float | list[float]]:
    """The values that are a few numbers, as plain data."""
    return {name: array.tolist() for name, array in values.items() if array.ndim < 2}
