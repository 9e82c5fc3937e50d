"""What the code of a stage is: its module, and what that imports of its own package, however deep."""

from __future__ import annotations

import ast
import functools
import hashlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any


@functools.cache
def code_digest(function: Callable[..., Any]) -> str:
    """Digest of the source of a function's module and of all that it imports of the same package.

    The imports are read from the source, those inside functions included, so that a kernel counts before it is
    first used. Other packages are not followed.
    """
    package = function.__module__.partition(".")[0]
    sources: dict[str, bytes] = {}
    pending = [function.__module__]
    while pending:
        name = pending.pop()
        path = _source_file(name)
        if name in sources or path is None:
            continue
        sources[name] = path.read_bytes()
        pending += [found for found in _imports(sources[name], name) if found.partition(".")[0] == package]
    state = hashlib.blake2b(digest_size=20)
    for name in sorted(sources):
        state.update(sources[name])
        for part in _older(name, sources[name]):
            state.update(part)
    return state.hexdigest()


def _older(name: str, source: bytes) -> Iterator[bytes]:
    """The bytecode of a module's functions that were imported before its file was edited.

    Nothing for a module that is not imported yet, nor for one whose file is the same: the digest does not depend on
    what happens to be imported.
    """
    module = sys.modules.get(name)
    for value in list(vars(module).values()) if module else ():
        function = getattr(value, "py_func", value)  # what numba compiled
        # A wrapper has the module of what it wraps, but its code is from another file.
        if isinstance(function, FunctionType) and function.__code__.co_filename == getattr(module, "__file__", None):
            imported = _bytecode(function.__code__)
            if imported not in _written(source):
                yield imported


@functools.cache
def _written(source: bytes) -> frozenset[bytes]:
    """The bytecode of every function in a source."""
    pending, found = [compile(source, "", "exec", dont_inherit=True)], set()
    while pending:
        code = pending.pop()
        found.add(_bytecode(code))
        pending += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return frozenset(found)


def _bytecode(code: CodeType) -> bytes:
    parts = [code.co_code]
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            parts.append(_bytecode(constant))
        elif isinstance(constant, (int, float, str, bytes)):
            parts.append(repr(constant).encode())
    return b"".join(parts)


def _source_file(name: str) -> Path | None:
    """The file of a module, found without importing it."""
    package, *parts = name.split(".")
    if name in sys.modules:
        path = Path(getattr(sys.modules[name], "__file__", None) or "")
        return path if path.suffix == ".py" and path.is_file() else None
    for folder in getattr(sys.modules.get(package), "__path__", ()):
        for path in (Path(folder, *parts).with_suffix(".py"), Path(folder, *parts, "__init__.py")):
            if path.is_file():
                return path
    return None


def _imports(source: bytes, module: str) -> Iterator[str]:
    """Names that may be modules, of every import statement in the source of a module."""
    is_package = hasattr(sys.modules.get(module), "__path__")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = [*module.split("."), "__init__"] if is_package else module.split(".")
            above = parts[: -node.level] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            yield origin
            yield from (f"{origin}.{alias.name}" for alias in node.names)
