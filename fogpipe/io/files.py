"""The bytes of an input file, or one clear error."""

from __future__ import annotations

import os
import stat

from fogpipe.errors import InputError


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The whole content of a file.

    Raises
    ------
    InputError
        If the file is missing, empty, a folder or a device, or must not be read.
    """
    try:
        with open(path, "rb", opener=_open_without_waiting) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise InputError(f"{path}: is not a regular file. Give the name of a file.")
            data = file.read()
    except IsADirectoryError as error:
        raise InputError(f"{path}: is a folder. Give the name of a file in it.") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file. Check the spelling and the folder.") from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror or error}. Check the path and its permissions."
        ) from error
    if not data:
        raise InputError(f"{path}: is empty (0 bytes). Get a fresh copy.")
    return data


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
