"""Finds stages: in entry points and in local folders, by one rule.

The part of a stage's name before the dot is its *subject*. A subject lives in one module: an
installed package names it as an entry point of the group ``fogpipe.stages``
(``frost = "my_package.frost"``), a local folder as a file (``frost.py``). fogpipe's own
stages are found the same way. Nothing is imported before a pipeline needs that subject.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from fogpipe.errors import ContractError, InputError, UnknownStageError, did_you_mean
from fogpipe.stage import Contract, contract, is_stage

GROUP = "fogpipe.stages"


@dataclass(frozen=True)
class Source:
    """Where the stages of one subject come from, or the reader of one data set.

    Attributes
    ----------
    subject : the part of the stage names before the dot, or the name of the data set.
    origin : what people are told: a distribution and its version, or a file.
    load : imports the module.
    """

    subject: str
    origin: str
    load: Callable[[], ModuleType]


class Registry:
    """Stages by name.

    Parameters
    ----------
    folders : local folders; every ``subject.py`` in them may hold stages named ``subject.*``.
    """

    def __init__(self, folders: Iterable[Path | str] = ()) -> None:
        self._folders = tuple(Path(folder) for folder in folders)
        self._loaded: dict[str, dict[str, Contract]] = {}
        self.failures: dict[str, str] = {}
        """Subjects that could not be imported, and why."""

    @cached_property
    def sources(self) -> dict[str, list[Source]]:
        """Every known subject and the places that hold it."""
        return find_sources(GROUP, self._folders)

    def find(self, name: str) -> Contract:
        """The contract of the stage ``name``.

        Raises
        ------
        UnknownStageError
            If there is no such stage, or the module that should hold it cannot be imported.
        """
        subject = name.partition(".")[0]
        stages = self._stages_of(subject)
        if name in stages:
            return stages[name]
        if subject in self.failures:
            raise UnknownStageError(f'stage "{name}" cannot be used: {self.failures[subject]}')
        known = list(self.all())
        hint = did_you_mean(name, known) or ' "fogpipe stages" lists them all.'
        broken = "".join(f"\n{reason}" for reason in self.failures.values())
        raise UnknownStageError(f'there is no stage "{name}".{hint}{broken}')

    def all(self) -> dict[str, Contract]:
        """Every stage that can be imported, by name; what cannot is in :attr:`failures`."""
        return {name: stage for subject in sorted(self.sources) for name, stage in self._stages_of(subject).items()}

    def origin(self, name: str) -> str:
        """What holds the stage: a distribution with its version, or a file."""
        return ", ".join(source.origin for source in self.sources.get(name.partition(".")[0], []))

    def _stages_of(self, subject: str) -> dict[str, Contract]:
        if subject not in self._loaded:
            stages: dict[str, Contract] = {}
            for source in self.sources.get(subject, []):
                try:
                    stages = _united(stages, _stages_in(source))
                except (Exception, SystemExit) as error:  # a broken plugin must not take the others down
                    self.failures[subject] = f"{source.origin}: {type(error).__name__}: {error}"
            self._loaded[subject] = dict(sorted(stages.items()))
        return self._loaded[subject]


def find_sources(group: str, folders: Iterable[Path]) -> dict[str, list[Source]]:
    """What installed packages name in a group of entry points, and every module in local folders; imports nothing."""
    found: dict[str, list[Source]] = {}
    for point in entry_points(group=group):
        source = Source(point.name, _origin(point), point.load)
        if source.origin not in [other.origin for other in found.get(point.name, [])]:
            found.setdefault(point.name, []).append(source)
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"plugin folder {folder} does not exist.")
        for path in sorted(folder.glob("[!_]*.py")):
            found.setdefault(path.stem, []).append(Source(path.stem, str(path), _file_loader(path)))
    return found


def _stages_in(source: Source) -> dict[str, Contract]:
    stages: dict[str, Contract] = {}
    with contextlib.redirect_stdout(sys.stderr):  # standard output is for results
        module = source.load()
    for value in vars(module).values():
        if not is_stage(value):
            continue
        found = contract(value)
        if found.name.startswith(f"{source.subject}."):
            stages = _united(stages, {found.name: found})
        elif value.__module__ == module.__name__:  # and not imported from elsewhere to be called
            raise ContractError(f'stage "{found.name}" must be named "{source.subject}.…", after its subject.')
    return stages


def _united(stages: dict[str, Contract], more: dict[str, Contract]) -> dict[str, Contract]:
    for name in stages.keys() & more.keys():
        if stages[name].function is not more[name].function:
            raise ContractError(f'stage "{name}" is defined twice.')
    return stages | more


def _origin(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else point.value


def _file_loader(path: Path) -> Callable[[], ModuleType]:
    def load() -> ModuleType:
        name = f"fogpipe_local.{path.stem}"
        spec: Any = importlib.util.spec_from_file_location(name, path)
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        return module

    return load
