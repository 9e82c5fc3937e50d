"""Cards: what a stage or a reader takes, gives and means, made from its signature and docstring alone."""

from __future__ import annotations

import inspect
import re
import textwrap
import typing
from collections.abc import Callable
from typing import Any

from annotated_types import BaseMetadata

from fogpipe.stage import Contract, Port, unit_of


def card(contract: Contract, origin: str = "") -> str:
    """The card of a stage as Markdown."""
    data = card_data(contract, origin)
    lines = [f"# {data['name']}", "", data["summary"], "", data["extended"], ""]
    for title, ports in (("Inputs", data["inputs"]), ("Outputs", data["outputs"])):
        lines += [f"## {title}", "", "| port | kind | meaning |", "|---|---|---|"]
        lines += [_row(port["name"], port["kind"], port["description"]) for port in ports] + [""]
    if data["parameters"]:
        lines += ["## Parameters", "", "| name | type | default | unit | meaning |", "|---|---|---|---|---|"]
        for p in data["parameters"]:
            lines.append(_row(p["name"], p["type"], p["default"], p["unit"], p["description"]))
        lines.append("")
    for title, text in data["sections"].items():
        lines += [f"## {title}", "", text, ""]
    if data["skipped_when"]:
        lines += ["## Skipped", "", data["skipped_when"], ""]
    lines += [f"`{data['import']}` · version {data['version']}{f' · {origin}' if origin else ''}", ""]
    return markdown(re.sub(r"\n{3,}", "\n\n", "\n".join(lines)))


def reader_card(name: str, reader: Callable[..., Any]) -> str:
    """The card of a reader of data sets as Markdown: the layout that it reads, and its options."""
    head, sections = _sections(inspect.getdoc(reader) or "")
    words = _descriptions(sections.pop("Parameters", ""))
    options = [p for p in inspect.signature(reader).parameters.values() if p.kind is p.KEYWORD_ONLY]
    lines = [f"# {name}", "", head, ""]
    if options:
        lines += ["## Options", "", "| option | default | meaning |", "|---|---|---|"]
        for option in options:
            default = "required" if option.default is option.empty else "" if option.default is None else option.default
            lines.append(_row(f"`--option {option.name}=…`", str(default), words.get(option.name, "")))
        lines.append("")
    for title, text in sections.items():
        lines += [f"## {title}", "", text, ""]
    return markdown("\n".join([*lines, f"`fogpipe batch hansard2019 --data {name}:… -o foggy`", ""]))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def card_data(contract: Contract, origin: str = "") -> dict[str, Any]:
    """The same as plain data."""
    head, sections = _sections(inspect.getdoc(contract.function) or "")
    summary, _, extended = head.partition("\n")
    words = _descriptions(sections.pop("Parameters", ""))
    returned = sections.pop("Returns", "")
    condition = contract.mark.identity_when
    return {
        "name": contract.name,
        "version": contract.mark.version,
        "origin": origin,
        "import": f"from {contract.function.__module__} import {contract.function.__name__}",
        "summary": summary,
        "extended": extended.strip(),
        "inputs": [_port(port, words.get(port.name, "")) for port in contract.inputs],
        "outputs": [_output(port, returned) for port in contract.outputs],
        "parameters": [_parameter(p, words.get(p.name, "")) for p in contract.parameters],
        "sections": sections,
        "skipped_when": (inspect.getdoc(condition) or "") if condition else "",
    }


def undocumented(contract: Contract) -> list[str]:
    """Ports and parameters of which the docstring says nothing under Parameters."""
    words = _descriptions(_sections(inspect.getdoc(contract.function) or "")[1].get("Parameters", ""))
    return [item.name for item in (*contract.inputs, *contract.parameters) if not words.get(item.name)]


def _port(port: Port, description: str) -> dict[str, str]:
    name = f"{port.name} (optional)" if port.optional else port.name
    return {"name": name, "kind": str(port.kind), "description": description or port.kind.meaning}


def _output(port: Port, returned: str) -> dict[str, str]:
    if not port.name:
        return {"name": "", "kind": str(port.kind), "description": " ".join(returned.split())}
    return {"name": port.name, "kind": str(port.kind), "description": _descriptions(returned).get(port.name, "")}


def _parameter(parameter: inspect.Parameter, description: str) -> dict[str, str]:
    return {
        "name": parameter.name,
        "type": type_text(parameter),
        "default": "required" if parameter.default is parameter.empty else repr(parameter.default),
        "unit": unit_of(parameter.annotation) or "",
        "description": description,
    }


def type_text(parameter: inspect.Parameter) -> str:
    """The type of a parameter and its bounds, for people."""
    hint = parameter.annotation
    bounds = [_bound(item) for item in getattr(hint, "__metadata__", ()) if isinstance(item, BaseMetadata)]
    base = typing.get_args(hint)[0] if typing.get_origin(hint) is typing.Annotated else hint
    return f"{_type_name(base)} {', '.join(bounds)}".rstrip()


def markdown(text: str) -> str:
    """Markdown from text in which formulas, roles and definitions are written as reStructuredText."""
    text = re.sub(r"^\.\. math:: *(.*(?:\n +\S.*)*)", _display_formula, text, flags=re.MULTILINE)
    text = re.sub(r"(?<=\S)::$", ":", text, flags=re.MULTILINE)
    text = re.sub(r":math:`([^`]+)`", r"$\1$", text)
    text = re.sub(r":(?:func|class|data|meth|mod):`~?(?:[\w.]*\.)?(\w+)`", r"`\1`", text)
    return re.sub(r"^(\w+)\n {4}(?=\S)", r"\1\n: ", text, flags=re.MULTILINE)


def _display_formula(match: re.Match[str]) -> str:
    lines = match[1].splitlines()
    return "\n".join(["$$", lines[0], textwrap.dedent("\n".join(lines[1:])), "$$"]).replace("\n\n", "\n")


_SIGNS = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}


def _bound(item: Any) -> str:
    parts = [f"{sign} {getattr(item, key)}" for key, sign in _SIGNS.items() if getattr(item, key, None) is not None]
    return ", ".join(parts) or repr(item)


def _type_name(hint: Any) -> str:
    if typing.get_origin(hint) is typing.Literal:
        return " or ".join(str(item) for item in typing.get_args(hint))
    if hint is type(None):
        return "none"
    if typing.get_origin(hint) is typing.Annotated:
        bounds = [_bound(item) for item in hint.__metadata__ if isinstance(item, BaseMetadata)]
        return f"{_type_name(hint.__origin__)} {', '.join(bounds)}".rstrip()
    if isinstance(hint, type) and not typing.get_args(hint):
        return hint.__name__
    if typing.get_origin(hint) is tuple:
        return f"({', '.join(_type_name(item) for item in typing.get_args(hint))})"
    return " or ".join(_type_name(item) for item in typing.get_args(hint)) or str(hint)


def _sections(doc: str) -> tuple[str, dict[str, str]]:
    """Split a numpydoc docstring at its underlined titles."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}$", doc, flags=re.MULTILINE)
    titles, texts = parts[1::2], parts[2::2]
    return parts[0].strip(), {title: text.strip("\n") for title, text in zip(titles, texts, strict=True)}


def _descriptions(section: str) -> dict[str, str]:
    """What a Parameters section says of each name; ``a, b : text`` speaks of both."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        match = re.match(r"^(\w+(?:, \w+)*) : (.*)$", line)
        if match:
            names = match[1].split(", ")
            found |= dict.fromkeys(names, match[2])
        elif line.strip():
            found |= {name: f"{found[name]} {line.strip()}" for name in names}
    return found
