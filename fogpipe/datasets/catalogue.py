"""Finds readers by name, and opens data sets with them."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, Reader
from fogpipe.errors import InputError, RequestError, did_you_mean, suggestion
from fogpipe.registry import Source, find_sources

GROUP = "fogpipe.datasets"


@dataclass(frozen=True)
class Dataset:
    """A data set on disk or in an object store.

    Attributes
    ----------
    name : of its reader.
    root : the folder, URL or table.
    options : what the reader was told, as text.
    items : every item, by its id, in the order of ids.
    """

    name: str
    root: str
    options: Mapping[str, str]
    items: Mapping[str, Item] = field(repr=False)


def readers(plugins: Iterable[Path] = ()) -> dict[str, Source]:
    """Every data set that has a reader, and where that is; modules of local folders may hold something else."""
    return {name: sources[-1] for name, sources in sorted(find_sources(GROUP, plugins).items())}


def find_reader(name: str, plugins: Iterable[Path] = ()) -> Reader:
    """The reader of the data set ``name``.

    Raises
    ------
    InputError
        If there is none, or its module cannot be imported.
    """
    known = readers(plugins)
    if name not in known:
        listed = ", ".join(known)
        raise InputError(f'there is no reader "{name}" of data sets.{did_you_mean(name, known)} There is: {listed}.')
    try:
        module = known[name].load()
    except (Exception, SystemExit) as error:  # a broken plugin is its author's business, and told as one line
        raise InputError(f'the reader "{name}", {known[name].origin}: {type(error).__name__}: {error}') from error
    found = [value for value in vars(module).values() if getattr(value, "__reader__", None) == name]
    if not found:
        raise InputError(f'{known[name].origin} holds no function with @reader("{name}").')
    return found[0]


def options_of(read: Reader) -> dict[str, inspect.Parameter]:
    """The options that a reader takes: its keyword-only arguments."""
    arguments = inspect.signature(read).parameters.values()
    return {argument.name: argument for argument in arguments if argument.kind is argument.KEYWORD_ONLY}


def open_dataset(text: str, options: Mapping[str, str] | None = None, plugins: Iterable[Path] = ()) -> Dataset:
    """Read which items a data set has.

    Parameters
    ----------
    text : ``NAME:ROOT``, such as ``kitti:/data/kitti`` or ``folder:s3://bucket/photos``.
    options : for the reader; texts become what its annotations say.

    Raises
    ------
    RequestError
        If an option is unknown, missing or not of its type.
    InputError
        If there is no such reader, or the root does not hold what it reads.
    """
    name, colon, root = text.partition(":")
    if not colon or not root:
        raise RequestError(f"--data {text}: write it as NAME:FOLDER, for example kitti:/data/kitti.")
    read = find_reader(name, plugins)
    items: dict[str, Item] = {}
    for item in read(Folder(root), **_checked(name, read, options or {})):
        if item.id in items:
            raise InputError(f'{text}: two items are called "{item.id}"; outputs are named after it.')
        items[item.id] = item
    if not items:
        raise InputError(
            f'{root}: holds no image in the layout of {name}. "fogpipe datasets {name}" shows the layout;'
            f" csv and folder read any other."
        )
    return Dataset(name, root, dict(options or {}), dict(sorted(items.items())))


def _checked(name: str, read: Reader, given: Mapping[str, str]) -> dict[str, object]:
    """The options as the types that the reader declares."""
    import typing

    from pydantic import TypeAdapter, ValidationError

    known = options_of(read)
    hints = typing.get_type_hints(read)
    for option in given:
        if option not in known:
            raise RequestError(f"--option {option}: the reader {name} has no such option.{suggestion(option, known)}")
    missing = [key for key, option in known.items() if option.default is option.empty and key not in given]
    if missing:
        raise RequestError(f"the reader {name} needs --option {' and --option '.join(f'{key}=…' for key in missing)}.")
    checked = {}
    for option, value in given.items():
        try:
            checked[option] = TypeAdapter(hints[option]).validate_python(value)
        except ValidationError as error:
            raise RequestError(f"--option {option}={value}: {error.errors()[0]['msg']}.") from error
    return checked
