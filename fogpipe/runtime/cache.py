"""A content-addressed cache of stage results on disk.

The key of a result covers everything it depends on: the stage's name, version and source code (with
that of the modules of its package which it uses), its parameters, the content, dtype and shape of its
inputs, the seed where it draws random numbers, and the version of the package that holds it. An
entry is a folder of ``.npy`` files with a table of their digests; it appears by one rename, so two
processes may share a cache. A damaged entry is dropped and computed again. Nothing is unpickled.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fogpipe
from fogpipe.errors import InputError
from fogpipe.pipeline.graph import Node
from fogpipe.runtime.code import code_digest

DEFAULT_LIMIT = 4 * 2**30
_INDEX = "entry.json"
_ABANDONED = 3600.0
"""Seconds after which a half-written entry is taken to be left by a killed process."""


def digest(array: np.ndarray) -> str:
    """BLAKE2b of dtype, shape and content. About 1 GB/s."""
    state = hashlib.blake2b(f"{array.dtype.str}{array.shape}".encode(), digest_size=20)
    state.update(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
    return state.hexdigest()


@dataclass(frozen=True)
class Entry:
    """A stored result: the array and its digest for each output port."""

    arrays: Mapping[str, np.ndarray]
    digests: Mapping[str, str]


class Cache:
    """Results of stages in a folder.

    Parameters
    ----------
    folder : made when missing.
    limit : bytes; when a new entry exceeds it, the entries used longest ago are dropped. Processes that share a cache
        count what the others store only when they themselves reach the limit.
    read_only : look results up, but keep none.

    Raises
    ------
    InputError
        If the folder cannot be made or written to.
    """

    def __init__(self, folder: Path | str, limit: int = DEFAULT_LIMIT, *, read_only: bool = False) -> None:
        self.folder = Path(folder)
        self.limit = limit
        self.read_only = read_only
        self._held: int | None = None
        if read_only:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=self.folder).close()
        except OSError as error:
            raise InputError(f"cache folder {folder} cannot be used: {error.strerror}. Name another.") from error

    def key(self, node: Node, inputs: Mapping[str, str], seed: int | None) -> str:
        """The address of a node's result, given the digests of its inputs."""
        facts = {
            "stage": node.contract.name,
            "version": node.contract.mark.version,
            "code": code_digest(node.contract.function),
            "origin": node.origin,
            "fogpipe": fogpipe.__version__,
            "numpy": np.__version__,
            "parameters": {key: repr(value) for key, value in sorted(node.parameters.items())},
            "inputs": dict(sorted(inputs.items())),
            "random": [seed, node.name] if seed is not None else None,
        }
        return hashlib.blake2b(json.dumps(facts).encode(), digest_size=20).hexdigest()

    def look_up(self, key: str) -> Entry | None:
        """The entry at ``key`` if it is there and whole; a damaged one is removed."""
        folder = self._place(key)
        try:
            index = (folder / _INDEX).read_text()
        except OSError:
            return None
        try:
            digests = json.loads(index)["digests"]
            arrays = {port: _read(folder / _file_name(port), expected) for port, expected in digests.items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError):
            if not self.read_only:
                shutil.rmtree(folder, ignore_errors=True)
            return None
        with contextlib.suppress(OSError):
            os.utime(folder)  # the time of last use, which eviction goes by
        return Entry(arrays, digests)

    def store(self, key: str, arrays: Mapping[str, np.ndarray]) -> dict[str, str]:
        """Keep a result and return its digests. A cache that cannot be written to does not fail the run."""
        digests = {port: digest(array) for port, array in arrays.items()}
        if self.read_only:
            return digests
        target = self._place(key)
        with contextlib.suppress(OSError):
            target.parent.mkdir(exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self.folder, prefix=".new-", ignore_cleanup_errors=True) as new:
                folder = Path(new) / key
                folder.mkdir()
                for port, array in arrays.items():
                    np.save(folder / _file_name(port), array, allow_pickle=False)
                (folder / _INDEX).write_text(json.dumps({"digests": digests}))
                os.rename(folder, target)  # fails, harmlessly, when another process was first
        if self._held is not None:
            self._held += sum(array.nbytes for array in arrays.values())
        if self._held is None or self._held > self.limit:
            self._held = self._evict(keep=target)
        return digests

    def _place(self, key: str) -> Path:
        return self.folder / key[:2] / key

    def _evict(self, keep: Path) -> int:
        """Drop what is over the limit, and what killed processes left; returns the bytes that remain."""
        entries = []
        for folder in self.folder.glob("[0-9a-f][0-9a-f]/*"):
            with contextlib.suppress(OSError):
                size = sum(file.stat().st_size for file in folder.iterdir())
                entries.append((folder.stat().st_mtime_ns, size, folder))
        for left in self.folder.glob(".new-*"):  # by a process that was killed
            with contextlib.suppress(OSError):
                if time.time() - left.stat().st_mtime > _ABANDONED:
                    shutil.rmtree(left, ignore_errors=True)
        total = sum(size for _, size, _ in entries)
        for _, size, folder in sorted(entries):
            if total <= self.limit:
                break
            if folder != keep or size > self.limit:
                shutil.rmtree(folder, ignore_errors=True)
                total -= size
        return total


def _file_name(port: str) -> str:
    return f"{port or 'value'}.npy"


def _read(path: Path, expected: str) -> np.ndarray:
    array = np.load(path, allow_pickle=False)
    if digest(array) != expected:
        raise ValueError(f"{path} is damaged")
    array.flags.writeable = False
    return array
