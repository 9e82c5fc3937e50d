"""Files that are either complete or absent."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fogpipe.errors import OutputError

_ADVICE = {
    errno.ENOSPC: "Free some space, or choose another folder.",
    errno.EDQUOT: "Free some of your quota, or choose another folder.",
    errno.EFBIG: "Raise the limit on file sizes, or choose a smaller format.",
    errno.EACCES: "Change its permissions, or choose another folder.",
    errno.EPERM: "Change its permissions, or choose another folder.",
    errno.EROFS: "Choose another folder.",
    errno.ENOENT: "Create the folder first.",
    errno.ENOTDIR: "Choose a path whose parents are folders.",
    errno.ENAMETOOLONG: "Choose a shorter name.",
}


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file so that it is complete or not there at all, whatever happens.

    Use it as ``with atomic_write(path) as temporary: temporary.write_bytes(data)``. When the block ends
    well the file is flushed to the disk and takes the place of ``path`` in one step, with the permissions of the
    older file. A link is followed: the file it points to is replaced. When the block or the writing fails, the
    temporary is removed and an older file is as it was. A killed process leaves at worst a ``.fogpipe-*`` file.

    Yields
    ------
    A new, empty file in the folder of ``path``, with its suffix.

    Raises
    ------
    OutputError
        If the operating system refuses (disk full, no permission, no such folder …), or if ``path`` is
        there and is not a regular file. Other exceptions of the block pass through.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".fogpipe-{secrets.token_hex(8)}{target.suffix}")
    try:
        _refuse_irregular(path, target)
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))  # the umask applies
        try:
            yield temporary
            flush(temporary, os.O_RDWR)
            with suppress(FileNotFoundError):
                shutil.copymode(target, temporary)  # a private file stays private
            os.replace(temporary, target)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
        with suppress(OSError):  # the file is in place; some systems cannot flush a folder
            flush(target.parent, os.O_RDONLY)
    except OSError as error:
        advice = _ADVICE.get(error.errno or 0, "Choose another place.")
        cause = error.strerror or str(error)
        raise OutputError(f"{path}: cannot be written: {cause}. Nothing there was changed. {advice}") from error


def atomic_write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8, complete or not at all; errors as in :func:`atomic_write`."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _refuse_irregular(path: str | os.PathLike[str], target: Path) -> None:
    """Replacing a device or a pipe would remove it from the system."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISDIR(mode):
        raise OutputError(f"{path}: cannot be written: is a folder. Give the name of a file in it.")
    if not stat.S_ISREG(mode):
        raise OutputError(f"{path}: cannot be written: is not a regular file. Give the name of a file.")


def flush(path: Path, flags: int) -> None:
    """Make the operating system put what it holds of ``path`` on the disk."""
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
