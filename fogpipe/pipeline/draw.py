"""A graph as DOT, Mermaid or SVG text, with the kind of value on every edge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from fogpipe.pipeline.graph import Graph, Ref
from fogpipe.pipeline.svg import layered_svg

Format = Literal["svg", "dot", "mermaid"]
Shape = Literal["input", "stage", "output"]


@dataclass(frozen=True)
class Box:
    """A thing to draw: an input, a stage or an output of the pipeline."""

    key: str
    shape: Shape
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Arrow:
    """An edge between two boxes, with its kind."""

    start: str
    end: str
    label: str


def draw(graph: Graph, form: Format = "svg") -> str:
    """The drawing of a graph as text."""
    boxes, arrows = list(_boxes(graph)), list(_arrows(graph))
    if form == "dot":
        return _dot(graph, boxes, arrows)
    if form == "mermaid":
        return _mermaid(boxes, arrows)
    title = graph.title or graph.source
    return layered_svg(
        title,
        {box.key: (box.shape, box.lines) for box in boxes},
        [(arrow.start, arrow.end, arrow.label) for arrow in arrows],
    )


def _boxes(graph: Graph) -> Iterator[Box]:
    for name in graph.inputs:
        yield Box(f"in:{name}", "input", (name,))
    for name, node in graph.nodes.items():
        yield Box(name, "stage", (name, node.contract.name))
    for name in graph.outputs:
        yield Box(f"out:{name}", "output", (name,))


def _arrows(graph: Graph) -> Iterator[Arrow]:
    for name, node in graph.nodes.items():
        for ref in node.sources.values():
            yield Arrow(_key(graph, ref), name, _label(graph, ref))
    for name, ref in graph.outputs.items():
        yield Arrow(_key(graph, ref), f"out:{name}", _label(graph, ref))


def _key(graph: Graph, ref: Ref) -> str:
    return f"in:{ref.node}" if ref.node in graph.inputs else ref.node


def _label(graph: Graph, ref: Ref) -> str:
    kind = str(graph.kind(ref))
    return f"{ref.port}: {kind}" if ref.port else kind


def _dot(graph: Graph, boxes: list[Box], arrows: list[Arrow]) -> str:
    shapes = {"input": "oval", "stage": "box", "output": "oval"}
    lines = [f"digraph {_quoted(graph.title or graph.source)} {{", "  rankdir=LR;", '  node [fontname="sans-serif"];']
    for box in boxes:
        label = "\\n".join(box.lines)
        lines.append(f'  {_quoted(box.key)} [shape={shapes[box.shape]}, label="{label}"];')
    lines += [f"  {_quoted(a.start)} -> {_quoted(a.end)} [label={_quoted(a.label)}];" for a in arrows]
    return "\n".join([*lines, "}", ""])


def _mermaid(boxes: list[Box], arrows: list[Arrow]) -> str:
    brackets = {"input": ("([", "])"), "stage": ("[", "]"), "output": ("([", "])")}
    keys = {box.key: f"n{index}" for index, box in enumerate(boxes)}
    lines = ["flowchart LR"]
    for box in boxes:
        left, right = brackets[box.shape]
        lines.append(f'  {keys[box.key]}{left}"{"<br/>".join(box.lines)}"{right}')
    lines += [f'  {keys[arrow.start]} -->|"{arrow.label}"| {keys[arrow.end]}' for arrow in arrows]
    return "\n".join([*lines, ""])


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
