"""Reads YAML and remembers where everything stands."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import yaml

from fogpipe.errors import Problem

Path = tuple[str | int, ...]
Place = tuple[int, int]

MAX_NODES = 20_000
"""More than any pipeline needs, and few enough that nested aliases cannot fill the memory."""


class _Loader(yaml.SafeLoader):
    """YAML with the scalars of version 1.2: ``1e-3`` is a number, ``1:30`` and ``yes`` are texts."""


_Loader.yaml_implicit_resolvers = {}
for _kind, _form, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?(0|[1-9]\d*)|0x[\da-fA-F]+", "-+0123456789"),
    ("float", r"[-+]?(\.\d+|\d+(\.\d*)?)([eE][-+]?\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", "-+0123456789."),
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", re.compile(f"^(?:{_form})$"), list(_first))


@dataclass
class Document:
    """Plain data with the place of every item.

    Attributes
    ----------
    data : what the YAML says, as dicts, lists and scalars.
    places : line and column (from 1) of the key of each path, or of the item in a list.
    problems : syntax errors, doubled keys.
    """

    data: Any = None
    places: dict[Path, Place] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def place(self, path: Path) -> Place:
        """Line and column of ``path``, or of its nearest parent that has one."""
        while path and path not in self.places:
            path = path[:-1]
        return self.places.get(path, (0, 0))


def read_yaml(text: str) -> Document:
    """Parse one YAML document. Problems are collected, never raised."""
    document = Document()
    loader = None
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None:
            document.problems.append(Problem(1, 1, "file", "is empty; a pipeline starts with 'fogpipe: 1'."))
        else:
            document.data = _plain(root, (), document, loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        what = " ".join(part for part in (error.context, error.problem) if part)
        document.problems.append(Problem(line, column, "file", f"is not valid YAML: {what}."))
    except yaml.YAMLError as error:  # unprintable characters carry no mark
        document.problems.append(Problem(0, 0, "file", f"is not valid YAML: {str(error).splitlines()[0]}."))
    except RecursionError:
        document.problems.append(Problem(0, 0, "file", "is nested too deeply."))
    finally:
        if loader:
            loader.dispose()
    return document


def read_value(text: str) -> Any:
    """One value, read as a pipeline file would read it; yaml.YAMLError where it is not YAML."""
    return yaml.load(text, _Loader)


def _plain(node: yaml.Node, path: Path, document: Document, loader: _Loader) -> Any:
    document.places.setdefault(path, _place(node))
    if len(document.places) > MAX_NODES:
        raise yaml.YAMLError(f"it has more than {MAX_NODES} items")
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, (*path, index), document, loader) for index, item in enumerate(node.value)]
    if not isinstance(node, yaml.MappingNode):
        return loader.construct_object(node)
    mapping: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = str(key_node.value) if isinstance(key_node, yaml.ScalarNode) else "?"
        if key in mapping:
            place = ".".join(map(str, (*path, key)))
            document.problems.append(Problem(*_place(key_node), place, "is given twice; keep one."))
        document.places[(*path, key)] = _place(key_node)
        mapping[key] = _plain(value_node, (*path, key), document, loader)
    return mapping


def _place(node: yaml.Node) -> Place:
    return node.start_mark.line + 1, node.start_mark.column + 1
