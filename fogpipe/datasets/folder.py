"""The folder, or the part of an object store, that holds a data set: its files are listed once."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import PurePosixPath

from fogpipe.errors import InputError
from fogpipe.io.files import is_url


class Folder:
    """Names of all files below a root.

    Parameters
    ----------
    root : a folder, or a URL such as ``s3://bucket/kitti`` (with ``fogpipe[remote]``).

    Raises
    ------
    InputError
        When the files are listed, if there is no such folder.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        self.root = str(root).rstrip("/") or "/"

    @cached_property
    def files(self) -> frozenset[str]:
        """Every file, as a path relative to the root with ``/`` between folders; links to folders are followed."""
        found = _listed(self.root) if is_url(self.root) else _walked(self.root)
        if not found:
            raise InputError(f"{self.root}: there is no such folder, or it holds no files.")
        return frozenset(found)

    def matches(self, pattern: str) -> Iterator[tuple[str, re.Match[str]]]:
        """Files whose whole relative path matches a regular expression, in order, each with its match."""
        for path in sorted(self.files):
            if found := re.fullmatch(pattern, path):
                yield path, found

    def path(self, relative: str) -> str:
        """A file by its relative path, whether it is there or not."""
        return f"{self.root}/{relative}"

    def optional(self, relative: str) -> str | None:
        """The file if it is there."""
        return self.path(relative) if relative in self.files else None

    def labels(self, *relative: str) -> dict[str, str]:
        """Those of these files that are there, as the labels of an item."""
        return {path: self.path(path) for path in relative if path in self.files}


def without_suffix(path: str) -> str:
    """The path without its last ending."""
    return str(PurePosixPath(path).with_suffix(""))


def _walked(root: str) -> list[str]:
    found: list[str] = []
    seen: set[str] = set()
    for folder, folders, names in os.walk(root, followlinks=True):
        if (real := os.path.realpath(folder)) in seen:  # a link that leads back
            folders.clear()
            continue
        seen.add(real)
        folders[:] = [name for name in folders if not name.startswith(".")]
        base = os.path.relpath(folder, root).replace(os.sep, "/")
        found += [name if base == "." else f"{base}/{name}" for name in names]
    return found


def _listed(url: str) -> list[str]:
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise InputError(f"{url}: to read URLs, install fogpipe[remote].") from error
    try:
        system, base = url_to_fs(url)
        found = system.find(base)
    except Exception as error:  # every file system has errors of its own
        raise InputError(f"{url}: cannot be listed: {type(error).__name__}: {error}. Check the address.") from error
    return [path.removeprefix(base).lstrip("/") for path in found]
