"""What a reader gives: one :class:`Item` per image; and the mark that makes a function a reader."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

Reader = Callable[..., Iterator["Item"]]
Function = TypeVar("Function", bound=Reader)


@dataclass(frozen=True)
class Item:
    """One image of a data set and what belongs to it, as paths or URLs; nothing is read yet.

    Attributes
    ----------
    id : its name, unique in the set, with ``/`` between folders.
    files : a file for each input of a pipeline, by name, as scenes have it: ``image``, ``range_map`` …
    encoding : how its depth is written, a name in :mod:`fogpipe.io.encodings`.
    camera : its camera file, or a mapping with ``fx``, ``fy``, ``cx``, ``cy`` …
    labels : label files, by the path relative to the root that they have in the set and get in the result.
    values : numbers of its own, such as ``time`` (s); ``--bind stage.parameter=time`` hands them on.
    settings : parameters of the pipeline that this item sets, as ``stage.parameter``; texts are read as ``--set`` does.
    sequence : the video it is a frame of. Frames of one sequence share their seed, so that nothing random flickers.
    path : where its picture is in the set, without ending, which the outputs mirror; the id where it is empty.
    """

    id: str
    files: Mapping[str, str]
    encoding: str | None = None
    camera: str | Mapping[str, float] | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    sequence: str | None = None
    path: str = ""


def reader(name: str) -> Callable[[Function], Function]:
    """Declare a function as the reader of the data set ``name``.

    It takes a :class:`fogpipe.datasets.folder.Folder` and keyword-only options, and yields an :class:`Item` per image.
    ``name`` is that of its entry point in the group ``fogpipe.datasets``, or of its file in a plugin folder.
    """

    def mark(function: Function) -> Function:
        function.__reader__ = name  # type: ignore[attr-defined]
        return function

    return mark
