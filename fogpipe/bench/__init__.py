"""Speed against error, shared by the command line and the docs.

A *subject* is a function that yields :class:`~fogpipe.bench.table.Row`, one for each way of doing a thing:
how long it takes as a ratio to a named yardstick, and how far it is from a named reference.
Add one by writing its module and naming it in :data:`SUBJECTS`. A subject that has pictures to show beside its table
has a function ``draw(folder, quick, rows)``, too.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fogpipe.bench.table import Row

SUBJECTS = {
    "overhead": "fogpipe.bench.overhead",
    "haze": "fogpipe.bench.haze",
    "blur": "fogpipe.bench.blur",
    "apsf": "fogpipe.bench.apsf",
    "density": "fogpipe.bench.density",
    "mrf": "fogpipe.bench.mrf",
    "photo": "fogpipe.bench.photo",
    "dehaze": "fogpipe.bench.dehaze",
    "airlight": "fogpipe.bench.airlight",
    "batch": "fogpipe.bench.batch",
}
"""Subjects by name, and the module that holds a function ``measure(quick)`` for each."""


def subject(name: str) -> Callable[[bool], Iterator[Row]]:
    """The measuring function of a subject; KeyError where there is none of that name."""
    return importlib.import_module(SUBJECTS[name]).measure


def pictures(name: str) -> Callable[[Path, bool, Sequence[Row]], None] | None:
    """The function that writes the pictures of a subject into a folder, if it has any."""
    return getattr(importlib.import_module(SUBJECTS[name]), "draw", None)
