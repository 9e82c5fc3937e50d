"""The bytes of an input file, or one clear error."""

from __future__ import annotations

import os
import stat
from pathlib import PurePosixPath

from fogpipe.errors import InputError


def read_bytes(path: str | os.PathLike[str], *, may_be_empty: bool = False) -> bytes:
    """The whole content of a file, or of what a URL such as ``s3://bucket/key`` names.

    Raises
    ------
    InputError
        If the file is missing, empty, a folder or a device, or must not be read.
    """
    data = _read_url(str(path)) if is_url(path) else _read_file(path)
    if not data and not may_be_empty:
        raise InputError(f"{path}: is empty (0 bytes). Get a fresh copy.")
    return data


def is_url(path: str | os.PathLike[str]) -> bool:
    """Whether ``path`` is a URL, and not the name of a file."""
    return "://" in str(path)


def file_name(path: str | os.PathLike[str]) -> str:
    """The last part of a path or URL."""
    return PurePosixPath(str(path)).name


def _read_url(url: str) -> bytes:
    try:
        import fsspec
    except ImportError as error:
        raise InputError(f"{url}: to read URLs, install fogpipe[remote].") from error
    try:
        with fsspec.open(url, "rb") as file:
            return file.read()  # type: ignore[union-attr]
    except FileNotFoundError as error:
        raise InputError(f"{url}: there is nothing at this address. Check the spelling.") from error
    except Exception as error:  # every file system has errors of its own
        raise InputError(f"{url}: cannot be read: {type(error).__name__}: {error}. Check the address.") from error


def _read_file(path: str | os.PathLike[str]) -> bytes:
    try:
        with open(path, "rb", opener=_open_without_waiting) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise InputError(f"{path}: is not a regular file. Give the name of a file.")
            return file.read()
    except IsADirectoryError as error:
        raise InputError(f"{path}: is a folder. Give the name of a file in it.") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file. Check the spelling and the folder.") from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror or error}. Check the path and its permissions."
        ) from error


def split_layer(path: str | os.PathLike[str]) -> tuple[str, str]:
    """File and layer of a path such as ``picture.exr#left``; of any other, the path and an empty text."""
    file, _, layer = str(path).rpartition("#")
    return (file, layer) if file.lower().endswith(".exr") else (str(path), "")


def split_part(text: str) -> tuple[str, str]:
    """File and part of a path such as ``layers.tif#tree``; the whole path where there is a file of that name."""
    file, _, part = text.rpartition("#")
    return (file, part) if file and part and not os.path.exists(text) else (text, "")


def _open_without_waiting(path: str, flags: int) -> int:
    """A pipe that nobody writes to would block the run for ever."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
