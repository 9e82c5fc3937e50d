"""Draws a directed acyclic graph as SVG, in layers from left to right, with no other program.

The method is Sugiyama's: boxes stand in the layer of their longest path from a source, an edge that
spans several layers is led through a point in each, the order within a layer is improved by
barycentres, and then every box moves towards the mean height of its neighbours.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise

BOX_HEIGHT = 40
ROW = 62
GAP = 150
CHARACTER = 7.2
MARGIN = 24
SWEEPS = 12

_FILLS = {"input": "#e8f1e4", "stage": "#eef2f7", "output": "#fbeedd"}

Boxes = Mapping[str, tuple[str, Sequence[str]]]
Edge = tuple[str, str, str]


def layered_svg(title: str, boxes: Boxes, edges: Sequence[Edge]) -> str:
    """The SVG text of a graph.

    Parameters
    ----------
    boxes : for each key its shape (input, stage, output) and its lines of text.
    edges : start, end and label of each arrow; the graph has no cycle.
    """
    ranks = _ranks(boxes, edges)
    paths = [_path(start, end, ranks) for start, end, _ in edges]
    layers = _ordered(_layers(boxes, paths, ranks), paths)
    heights = _heights(layers, paths)
    left, widths = _columns(layers, boxes)
    points = {key: (left[rank], heights[key]) for rank, layer in enumerate(layers) for key in layer}
    width = max((left[rank] + widths[rank] for rank in range(len(layers))), default=0) + MARGIN
    height = max(heights.values(), default=0) + BOX_HEIGHT + MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height + 30:.0f}" '
        f'viewBox="0 -30 {width:.0f} {height + 30:.0f}" font-family="sans-serif" font-size="12">',
        '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0 8 4 0 8z" fill="#667"/></marker></defs>',
        '<rect y="-30" width="100%" height="100%" fill="#fff"/>',
        f'<text x="{MARGIN}" y="-6" font-size="15" font-weight="bold">{escape(title)}</text>',
    ]
    labels = []
    for path, (_, _, label) in zip(paths, edges, strict=True):
        curve, label_x, label_y = _curve(path, points, ranks, widths, boxes)
        parts.append(f'<path d="{curve}" fill="none" stroke="#99a" marker-end="url(#head)"/>')
        labels.append(
            f'<text x="{label_x:.0f}" y="{label_y:.0f}" text-anchor="end" font-size="10" fill="#556" '
            f'paint-order="stroke" stroke="#fff" stroke-width="3">{escape(label)}</text>'
        )
    parts += labels
    parts += [_box(key, *boxes[key], points[key]) for key in boxes]
    return "\n".join([*parts, "</svg>", ""])


def _ranks(boxes: Boxes, edges: Sequence[Edge]) -> dict[str, int]:
    ranks = dict.fromkeys(boxes, 0)
    for _ in boxes:
        changed = False
        for start, end, _ in edges:
            if ranks[end] <= ranks[start]:
                ranks[end] = ranks[start] + 1
                changed = True
        if not changed:
            break
    last = max(ranks.values(), default=0)
    for key, (shape, _) in boxes.items():
        if shape == "output":
            ranks[key] = last
        elif shape == "input":  # close to what it feeds, or its arrows cross the whole drawing
            ranks[key] = min((ranks[end] for start, end, _ in edges if start == key), default=1) - 1
    return ranks


def _path(start: str, end: str, ranks: Mapping[str, int]) -> list[str]:
    """The keys that an edge passes: its ends and a point in every layer between."""
    between = [f"{start}→{end}@{rank}" for rank in range(ranks[start] + 1, ranks[end])]
    return [start, *between, end]


def _layers(boxes: Boxes, paths: Sequence[Sequence[str]], ranks: Mapping[str, int]) -> list[list[str]]:
    layers: defaultdict[int, dict[str, None]] = defaultdict(dict)
    for key in boxes:
        layers[ranks[key]][key] = None
    for path in paths:
        for step, key in enumerate(path):
            layers[ranks[path[0]] + step][key] = None
    return [list(layers[rank]) for rank in range(max(layers, default=-1) + 1)]


def _neighbours(paths: Sequence[Sequence[str]]) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    before: defaultdict[str, list[str]] = defaultdict(list)
    after: defaultdict[str, list[str]] = defaultdict(list)
    for path in paths:
        for one, other in pairwise(path):
            after[one].append(other)
            before[other].append(one)
    return before, after


def _ordered(layers: list[list[str]], paths: Sequence[Sequence[str]]) -> list[list[str]]:
    before, after = _neighbours(paths)
    for sweep in range(SWEEPS):
        side = before if sweep % 2 == 0 else after
        position = {key: index for layer in layers for index, key in enumerate(layer)}
        for layer in layers if sweep % 2 == 0 else reversed(layers):
            layer.sort(key=lambda key: _mean([position[other] for other in side.get(key, ())], position[key]))
            position.update({key: index for index, key in enumerate(layer)})
    return layers


def _heights(layers: list[list[str]], paths: Sequence[Sequence[str]]) -> dict[str, float]:
    before, after = _neighbours(paths)
    heights = {key: float(MARGIN + ROW * index) for layer in layers for index, key in enumerate(layer)}
    for _ in range(SWEEPS):
        for layer in layers:
            floor = float(MARGIN)
            for key in layer:
                wish = _mean([heights[other] for other in (*before.get(key, ()), *after.get(key, ()))], heights[key])
                heights[key] = max(floor, wish)
                floor = heights[key] + (ROW if "→" not in key else ROW / 3)
    lowest = min(heights.values(), default=0)
    return {key: height - lowest + MARGIN for key, height in heights.items()}


def _columns(layers: list[list[str]], boxes: Boxes) -> tuple[list[float], list[float]]:
    widths = [max((_width(boxes[key][1]) for key in layer if key in boxes), default=20.0) for layer in layers]
    left = [float(MARGIN)]
    for width in widths:
        left.append(left[-1] + width + GAP)
    return left, widths


def _curve(
    path: Sequence[str],
    points: Mapping[str, tuple[float, float]],
    ranks: Mapping[str, int],
    widths: Sequence[float],
    boxes: Boxes,
) -> tuple[str, float, float]:
    """The path data of an edge and where its label ends, just before the arrow's head."""
    x, y = points[path[0]]
    x, y = x + _width(boxes[path[0]][1]), y + BOX_HEIGHT / 2
    curve = f"M{x:.1f} {y:.1f}"
    for step, key in enumerate(path[1:], start=1):
        next_x, next_y = points[key][0], points[key][1] + BOX_HEIGHT / 2
        middle = (x + next_x) / 2
        curve += f" C{middle:.1f} {y:.1f} {middle:.1f} {next_y:.1f} {next_x:.1f} {next_y:.1f}"
        x, y = next_x, next_y
        if key not in boxes:
            x += widths[ranks[path[0]] + step]
            curve += f" L{x:.1f} {y:.1f}"
    return curve, x - 12, y - 4


def _box(key: str, shape: str, lines: Sequence[str], point: tuple[float, float]) -> str:
    x, y = point
    radius = 5 if shape == "stage" else BOX_HEIGHT / 2
    width = _width(lines)
    texts = []
    for index, line in enumerate(lines):
        height = y + BOX_HEIGHT / 2 + 4 + (index - (len(lines) - 1) / 2) * 15
        style = ' font-weight="bold"' if index == 0 else ' fill="#556" font-size="11"'
        texts.append(
            f'<text x="{x + width / 2:.1f}" y="{height:.1f}" text-anchor="middle"{style}>{escape(line)}</text>'
        )
    frame = (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{BOX_HEIGHT}" rx="{radius}" '
        f'fill="{_FILLS[shape]}" stroke="#889"/>'
    )
    return f"<g><title>{escape(key)}</title>{frame}{''.join(texts)}</g>"


def _width(lines: Sequence[str]) -> float:
    return max(len(line) for line in lines) * CHARACTER + 24


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise
