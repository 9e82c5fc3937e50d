"""Draws a directed acyclic graph as SVG, in layers from left to right, with no other program.

The method is Sugiyama's: boxes stand in the layer of their longest path from a source, an edge that
spans several layers is led through a point in each, the order within a layer is improved by
barycentres, and then every box moves towards the mean height of its neighbours. Arrows arrive at
places of their own along a box, so that their labels do not fall on each other.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise

LEAST_HEIGHT = 40.0
ARRIVAL = 15.0
"""Distance between two arrow heads on a box."""
SPACE = 20.0
GAP = 165.0
CHARACTER = 7.2
MARGIN = 24.0
SWEEPS = 12

_FILLS = {"input": "#e8f1e4", "stage": "#eef2f7", "output": "#fbeedd"}
_HEAD = (
    '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
    '<path d="M0 0 8 4 0 8z" fill="#667"/></marker></defs>'
)

Boxes = Mapping[str, tuple[str, Sequence[str]]]
Edge = tuple[str, str, str]


def layered_svg(title: str, boxes: Boxes, edges: Sequence[Edge]) -> str:
    """The SVG text of a graph.

    Parameters
    ----------
    boxes : for each key its shape (input, stage, output) and its lines of text.
    edges : start, end and label of each arrow; the graph has no cycle.
    """
    return _Drawing(boxes, edges).svg(title)


class _Drawing:
    """Places of the boxes, and of a point for every edge in every layer that it crosses."""

    def __init__(self, boxes: Boxes, edges: Sequence[Edge]) -> None:
        self.boxes = boxes
        self.edges = edges
        self.ranks = _ranks(boxes, edges)
        self.paths = [self._path(start, end) for start, end, _ in edges]
        self.before: defaultdict[str, list[str]] = defaultdict(list)
        self.after: defaultdict[str, list[str]] = defaultdict(list)
        for path in self.paths:
            for one, other in pairwise(path):
                self.after[one].append(other)
                self.before[other].append(one)
        self.size = {key: max(LEAST_HEIGHT, ARRIVAL * (1 + len(self.before[key]))) for key in boxes}
        self.layers = self._layers()
        self._order()
        self.middle = self._heights()
        self.left, self.width = self._columns()

    def svg(self, title: str) -> str:
        right = max((x + width for x, width in zip(self.left, self.width, strict=True)), default=0) + MARGIN
        bottom = max((self.middle[key] + self.size[key] / 2 for key in self.boxes), default=0) + MARGIN
        curves, labels = self._arrows()
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{right:.0f}" height="{bottom + 30:.0f}" '
            f'viewBox="0 -30 {right:.0f} {bottom + 30:.0f}" font-family="sans-serif" font-size="12">',
            _HEAD,
            '<rect y="-30" width="100%" height="100%" fill="#fff"/>',
            f'<text x="{MARGIN:.0f}" y="-6" font-size="15" font-weight="bold">{escape(title)}</text>',
            *curves,
            *labels,
            *(self._box(key) for key in self.boxes),
            "</svg>",
        ]
        return "\n".join([*parts, ""])

    def _path(self, start: str, end: str) -> list[str]:
        """What an edge passes: its ends and a point in every layer between."""
        return [start, *(f"{start}→{end}@{rank}" for rank in range(self.ranks[start] + 1, self.ranks[end])), end]

    def _layers(self) -> list[list[str]]:
        layers: defaultdict[int, dict[str, None]] = defaultdict(dict)
        for key in self.boxes:
            layers[self.ranks[key]][key] = None
        for path in self.paths:
            for step, key in enumerate(path):
                layers[self.ranks[path[0]] + step][key] = None
        return [list(layers[rank]) for rank in range(max(layers, default=-1) + 1)]

    def _order(self) -> None:
        """Sort every layer by the mean position of its neighbours, forwards and backwards in turn."""
        for sweep in range(SWEEPS):
            forwards = sweep % 2 == 0
            side = self.before if forwards else self.after
            position = {key: index for layer in self.layers for index, key in enumerate(layer)}
            for layer in self.layers if forwards else reversed(self.layers):
                layer.sort(key=lambda key: _mean([position[other] for other in side[key]], position[key]))
                position.update({key: index for index, key in enumerate(layer)})

    def _heights(self) -> dict[str, float]:
        """The middle of every box and point: near its neighbours, below the one above it."""
        middle = {key: 60.0 * index for layer in self.layers for index, key in enumerate(layer)}
        for _ in range(SWEEPS):
            for layer in self.layers:
                floor = -1e9
                for key in layer:
                    half = self.size.get(key, 0) / 2
                    wish = _mean([middle[other] for other in (*self.before[key], *self.after[key])], middle[key])
                    middle[key] = max(floor + half, wish)
                    floor = middle[key] + half + SPACE
        top = min((middle[key] - self.size[key] / 2 for key in self.boxes), default=0)
        return {key: height - top + MARGIN for key, height in middle.items()}

    def _columns(self) -> tuple[list[float], list[float]]:
        widths = [max((_width(self.boxes[key][1]) for key in layer if key in self.boxes), default=20.0)
                  for layer in self.layers]  # fmt: skip
        left = [MARGIN + sum(widths[:rank]) + GAP * rank for rank in range(len(widths))]
        return left, widths

    def _arrows(self) -> tuple[list[str], list[str]]:
        arrivals: defaultdict[str, list[int]] = defaultdict(list)
        for index, path in enumerate(self.paths):
            arrivals[path[-1]].append(index)
        curves, labels = [""] * len(self.paths), [""] * len(self.paths)
        for end, indices in arrivals.items():
            indices.sort(key=lambda index: self.middle[self.paths[index][-2]])
            for place, index in enumerate(indices):
                y = self.middle[end] + ARRIVAL * (place - (len(indices) - 1) / 2)
                curves[index], labels[index] = self._arrow(self.paths[index], y, self.edges[index][2])
        return curves, labels

    def _arrow(self, path: Sequence[str], arrival: float, label: str) -> tuple[str, str]:
        rank = self.ranks[path[0]]
        x, y = self.left[rank] + _width(self.boxes[path[0]][1]), self.middle[path[0]]
        curve = f"M{x:.1f} {y:.1f}"
        for step, key in enumerate(path[1:], start=1):
            next_x, next_y = self.left[rank + step], self.middle[key] if key not in self.boxes else arrival
            bend = (x + next_x) / 2
            curve += f" C{bend:.1f} {y:.1f} {bend:.1f} {next_y:.1f} {next_x:.1f} {next_y:.1f}"
            x, y = next_x, next_y
            if key not in self.boxes:
                x += self.width[rank + step]
                curve += f" L{x:.1f} {y:.1f}"
        text = (
            f'<text x="{x - 11:.0f}" y="{y - 3:.0f}" text-anchor="end" font-size="10" fill="#556" '
            f'paint-order="stroke" stroke="#fff" stroke-width="3">{escape(label)}</text>'
        )
        return f'<path d="{curve}" fill="none" stroke="#99a" marker-end="url(#head)"/>', text

    def _box(self, key: str) -> str:
        shape, lines = self.boxes[key]
        x, width, height = self.left[self.ranks[key]], _width(lines), self.size[key]
        texts = []
        for index, line in enumerate(lines):
            y = self.middle[key] + 4 + (index - (len(lines) - 1) / 2) * 15
            style = ' font-weight="bold"' if index == 0 else ' fill="#556" font-size="11"'
            texts.append(f'<text x="{x + width / 2:.1f}" y="{y:.1f}" text-anchor="middle"{style}>{escape(line)}</text>')
        frame = (
            f'<rect x="{x:.1f}" y="{self.middle[key] - height / 2:.1f}" width="{width:.1f}" height="{height:.1f}" '
            f'rx="{5 if shape == "stage" else LEAST_HEIGHT / 2:.0f}" fill="{_FILLS[shape]}" stroke="#889"/>'
        )
        return f"<g><title>{escape(key)}</title>{frame}{''.join(texts)}</g>"


def _ranks(boxes: Boxes, edges: Sequence[Edge]) -> dict[str, int]:
    """The layer of each box: its longest path from a source; an input stands beside what it feeds."""
    ranks = dict.fromkeys(boxes, 0)
    for _ in boxes:
        for start, end, _ in edges:
            ranks[end] = max(ranks[end], ranks[start] + 1)
    for key, (shape, _) in boxes.items():
        if shape == "input":
            ranks[key] = min((ranks[end] for start, end, _ in edges if start == key), default=1) - 1
    return ranks


def _width(lines: Sequence[str]) -> float:
    return max(len(line) for line in lines) * CHARACTER + 24


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise
