"""Writes what a run gave: one file per output, each complete or absent."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fogpipe.errors import OutputError, RequestError
from fogpipe.pipeline.plan import Plan
from fogpipe.ports import MAP, Color, Kind
from fogpipe.runtime.inputs import Inputs

RECORD_NAME = "run.json"
SHEET_NAME = "sheet.png"
_DRAFT = ".fogpipe-run-"
_ABANDONED = 3600.0

IMAGE_FORMATS = ("png", "png16", "jpg", "webp", "tif", "exr", "hdr", "npy")
WITHOUT_OPACITY = ("jpg", "hdr")
MAP_FORMATS = ("npy", "exr", "tif", "png")


@dataclass(frozen=True)
class Options:
    """The choices of a run that shape its files, as plain data that a record can repeat."""

    to: tuple[str, ...] | None = None
    image_format: str = "png"
    map_format: str = "npy"
    plugins: tuple[str, ...] = ()
    sheet: bool = True
    opaque: bool = False


def check_formats(plan: Plan, options: Options) -> None:
    """Refuse, before anything is computed, formats that are unknown or cannot hold an output."""
    for option, value, known in (
        ("--image-format", options.image_format, IMAGE_FORMATS),
        ("--map-format", options.map_format, MAP_FORMATS),
    ):
        if value not in known:
            raise RequestError(f"{option} {value}: choose one of {', '.join(known)}.")
    for name, ref in plan.outputs.items() if options.map_format == "png" else ():
        kind = plan.graph.kind(ref)
        if kind.shapes == MAP and kind.dtype == "float" and not (kind.low >= 0 and kind.high <= 1):
            raise RequestError(f"--map-format png: {name} is a {kind}, and a PNG holds values in [0, 1] only; use exr.")
    if options.sheet and "sheet" in plan.outputs:
        raise RequestError('the output "sheet" would be overwritten by the proof sheet; rename it, or use --no-sheet.')


def check_opacity(inputs: Inputs, options: Options) -> None:
    """Refuse a format without opacity for a picture that has one, before anything is computed."""
    if inputs.alpha is not None and options.image_format in WITHOUT_OPACITY and not options.opaque:
        raise RequestError(
            f"--image-format {options.image_format} has no room for the opacity of the input picture; "
            f"choose png, webp, tif or exr, or leave it away with --opaque."
        )


def make_folder(folder: Path) -> None:
    """Make the output folder, and make sure that it can be written to, before anything is computed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except FileExistsError as error:
        raise OutputError(f"cannot write to {folder}: it is a file, not a folder. Choose another with -o.") from error
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {error.strerror}. Choose another folder with -o.") from error


@contextlib.contextmanager
def output_folder(folder: Path) -> Iterator[None]:
    """As :func:`make_folder`; a folder that is new goes again where the work in it fails and leaves it empty."""
    new = not folder.exists()
    make_folder(folder)
    try:
        yield
    except BaseException:
        if new:
            with contextlib.suppress(OSError):  # it holds something by now
                folder.rmdir()
        raise


@contextlib.contextmanager
def staging(folder: Path) -> Iterator[Path]:
    """A folder for files that are not complete yet, inside ``folder``; it is gone afterwards.

    What a killed run left there goes too, after an hour.
    """
    for left in folder.glob(f"{_DRAFT}*"):
        with contextlib.suppress(FileNotFoundError):  # another run has just ended
            if time.time() - left.stat().st_mtime > _ABANDONED:
                shutil.rmtree(left, ignore_errors=True)
    try:
        with tempfile.TemporaryDirectory(dir=folder, prefix=_DRAFT, ignore_cleanup_errors=True) as draft:
            yield Path(draft)
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {error.strerror or error}. Nothing there was changed.") from error


def publish(draft: Path, folder: Path) -> list[str]:
    """Move complete files from ``draft`` into ``folder``: the old record goes first, the new one comes last.

    A folder holds one run. Files of an older one that the new run does not replace are removed, and returned.
    """
    if (folder / RECORD_NAME).is_dir():
        raise OutputError(f"cannot write {folder / RECORD_NAME}: it is a folder. Choose another folder with -o.")
    with _alone_in(folder):
        old = _files_of_record(folder)
        (folder / RECORD_NAME).unlink(missing_ok=True)
        names = sorted((path.name for path in draft.iterdir()), key=lambda name: name == RECORD_NAME)
        removed = sorted(old - set(names))
        for name in removed:
            (folder / name).unlink(missing_ok=True)
        for name in names:
            os.replace(draft / name, folder / name)
    return removed


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other run publishes into ``folder``, so that the files of two runs never mix.

    The lock goes with the process, however it ends, and leaves no file. Windows cannot lock a folder.
    """
    try:
        import fcntl
    except ModuleNotFoundError:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # some network file systems have no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _files_of_record(folder: Path) -> set[str]:
    """Files that an older run wrote here and nobody has changed since."""
    try:
        record = json.loads((folder / RECORD_NAME).read_text(encoding="utf-8"))
        written = {output["file"]: output["sha256"] for output in record["outputs"].values() if "file" in output}
        sheet = {SHEET_NAME} if record["options"]["sheet"] else set()
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return set()
    here = {name for name in written if Path(name).name == name and (folder / name).is_file()}
    return {name for name in here if file_digest(folder / name) == written[name]} | sheet


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

    if not kind.is_per_pixel(array):
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
