"""Where outputs go: a folder, or a URL. A file appears there complete or not at all, and never outside the root."""

from __future__ import annotations

import contextlib
import os
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from fogpipe.batch.names import inside
from fogpipe.errors import InputError, OutputError
from fogpipe.io.atomic import flush
from fogpipe.io.files import is_url, read_bytes

STATE = ".fogpipe"
"""Folder below the root for the journal and for files that are not complete yet."""


class Place(ABC):
    """The root of the outputs. Files are named by their path relative to it."""

    root: str

    @abstractmethod
    def draft(self) -> contextlib.AbstractContextManager[Path]:
        """A folder of this machine for files that are not complete yet; it is gone afterwards."""

    @abstractmethod
    def publish(self, file: Path, relative: str) -> None:
        """Move a complete file to its place; OutputError where that cannot be, or must not."""

    @abstractmethod
    def listed(self, below: str = "") -> list[str]:
        """Every file below a folder of this place."""

    @abstractmethod
    def missing(self, files: Collection[str]) -> set[str]:
        """Those of these files that are not there."""

    @abstractmethod
    def read(self, relative: str) -> bytes:
        """The content of a file that is there."""

    def write_text(self, relative: str, text: str) -> None:
        """Write a file of text."""
        with self.draft() as draft:
            file = draft / "text"
            file.write_text(text, encoding="utf-8")
            self.publish(file, relative)

    def copy(self, source: str, relative: str) -> None:
        """Copy a file that is elsewhere to its place."""
        with self.draft() as draft:
            file = draft / "copy"
            file.write_bytes(read_bytes(source, may_be_empty=True))
            self.publish(file, relative)

    def link(self, source: str, relative: str) -> None:
        """Make a file that is elsewhere appear here too; a copy where there are no links."""
        self.copy(source, relative)


def place_at(root: str, drafts: str = "") -> Place:
    """The place that a path or URL names; ``drafts`` is a folder on the same disk as a local root."""
    return RemotePlace(root) if is_url(root) else LocalPlace(root, drafts)


class LocalPlace(Place):
    """A folder, which several machines may share."""

    def __init__(self, root: str, drafts: str = "") -> None:
        self.root = root
        self._drafts = drafts or os.path.join(root, STATE)

    @contextlib.contextmanager
    def draft(self) -> Iterator[Path]:
        with _reporting(self.root):
            os.makedirs(self._drafts, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self._drafts, prefix="draft-", ignore_cleanup_errors=True) as folder:
                yield Path(folder)

    def publish(self, file: Path, relative: str) -> None:
        target = self._target(relative)
        with _reporting(target):
            flush(file, os.O_RDWR)
            os.replace(file, target)
            with contextlib.suppress(OSError):  # the file is in place; some systems cannot flush a folder
                flush(target.parent, os.O_RDONLY)

    def link(self, source: str, relative: str) -> None:
        if is_url(source):
            self.copy(source, relative)
            return
        with self.draft() as draft:
            link = draft / "link"
            link.symlink_to(os.path.abspath(source))
            target = self._target(relative)
            with _reporting(target):
                os.replace(link, target)

    def listed(self, below: str = "") -> list[str]:
        folder = Path(self.root, below)
        return sorted(path.relative_to(self.root).as_posix() for path in folder.rglob("*") if path.is_file())

    def missing(self, files: Collection[str]) -> set[str]:
        return {file for file in files if not os.path.exists(os.path.join(self.root, file))}

    def read(self, relative: str) -> bytes:
        return Path(self.root, relative).read_bytes()

    def _target(self, relative: str) -> Path:
        """The path of a file, its folder made; a link on the way must not lead out of the root."""
        target = Path(self.root, inside(relative, "an output is to be written to"))
        root = os.path.realpath(self.root)
        if os.path.commonpath([root, os.path.realpath(target.parent)]) != root:
            raise OutputError(f"{target}: a link on the way leads out of {self.root}; nothing was written there.")
        with _reporting(target):
            target.parent.mkdir(parents=True, exist_ok=True)
        return target


class RemotePlace(Place):
    """An address in an object store, where files appear complete by themselves."""

    def __init__(self, root: str) -> None:
        try:
            from fsspec.core import url_to_fs
        except ImportError as error:
            raise InputError(f"{root}: to write to URLs, install fogpipe[remote].") from error
        self.root = root.rstrip("/")
        try:
            found: tuple[Any, str] = url_to_fs(self.root)
        except Exception as error:  # an unknown protocol, or one whose library is not installed
            raise OutputError(f"{root}: cannot be written to: {type(error).__name__}: {error}.") from error
        self._system, self._base = found

    @contextlib.contextmanager
    def draft(self) -> Iterator[Path]:
        with tempfile.TemporaryDirectory(prefix="fogpipe-", ignore_cleanup_errors=True) as folder:
            yield Path(folder)

    def publish(self, file: Path, relative: str) -> None:
        target = f"{self._base}/{inside(relative, 'an output is to be written to')}"
        try:
            self._system.makedirs(target.rpartition("/")[0], exist_ok=True)
            self._system.put_file(str(file), target)
        except Exception as error:  # every file system has errors of its own
            raise OutputError(f"{self.root}/{relative}: cannot be written: {type(error).__name__}: {error}.") from error

    def listed(self, below: str = "") -> list[str]:
        self._system.invalidate_cache()
        folder = f"{self._base}/{below}".rstrip("/")
        found = self._system.find(folder) if self._system.exists(folder) else []
        return sorted(path.removeprefix(self._base).lstrip("/") for path in found)

    def missing(self, files: Collection[str]) -> set[str]:
        return set(files) - set(self.listed())

    def read(self, relative: str) -> bytes:
        return self._system.cat_file(f"{self._base}/{relative}")


@contextlib.contextmanager
def _reporting(path: str | Path) -> Iterator[None]:
    """Whatever the operating system refuses is one clear error."""
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written: {error.strerror or error}. Nothing there was changed."
        ) from error
