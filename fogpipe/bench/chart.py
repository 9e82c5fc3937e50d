"""Draws time against error, and other curves, on logarithmic axes, as SVG without a library."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

from fogpipe.bench.table import Row

WIDTH, HEIGHT, MARGIN = 720, 480, 70
COLOURS = ("#0b6e99", "#c2410c", "#4d7c0f", "#7e22ce", "#a16207", "#be185d", "#475569")


def time_against_error(rows: Sequence[Row], case: str) -> str:
    """SVG of one case: a colour and a line for each solver, the Pareto front dashed.

    A way is named by its solver and, after a space, a setting; the settings of a solver are joined by a line.

    Raises
    ------
    ValueError
        If no row of the case has a ratio and an error above 0.
    """
    points = [
        (row.way, row.error, row.ratio) for row in rows if row.case == case and row.error and row.ratio is not None
    ]
    if not points:
        raise ValueError(f'there is nothing to draw for "{case}"')
    across, up = _Axis([error for _, error, _ in points]), _Axis([ratio for _, _, ratio in points])

    def place(error: float, ratio: float) -> tuple[float, float]:
        x = MARGIN + across.share(error) * (WIDTH - 2 * MARGIN)
        return round(x, 1), round(HEIGHT - MARGIN - up.share(ratio) * (HEIGHT - 2 * MARGIN), 1)

    first = next(row for row in rows if row.case == case)
    parts = [_text(WIDTH / 2, 28, case, "middle", 16), _text(WIDTH / 2, HEIGHT - 16, first.measure, "middle")]
    parts.append(_text(12, 50, f"time / {first.yardstick}"))
    for decade in across.decades():
        x, _ = place(decade, up.low)
        parts += [
            _line([(x, MARGIN), (x, HEIGHT - MARGIN)], "#ddd"),
            _text(x, HEIGHT - MARGIN + 18, f"{decade:g}", "middle"),
        ]
    for decade in up.decades():
        _, y = place(across.low, decade)
        parts += [_line([(MARGIN, y), (WIDTH - MARGIN, y)], "#ddd"), _text(MARGIN - 8, y + 4, f"{decade:g}", "end")]
    parts.append(_line([place(*point) for point in pareto_front([point[1:] for point in points])], "#999", "6 4"))
    solvers = dict.fromkeys(way.split(" ")[0] for way, _, _ in points)
    for colour, solver in zip(COLOURS * len(solvers), solvers, strict=False):
        own = [place(error, ratio) for way, error, ratio in points if way.split(" ")[0] == solver]
        parts.append(_line(own, colour))
        parts += [f'<circle cx="{x}" cy="{y}" r="4.5" fill="{colour}"/>' for x, y in own]
        parts.append(_text(own[0][0] + 8, own[0][1] - 8, solver, colour=colour))
    return _drawing(parts)


def curves(
    title: str, across: tuple[str, Sequence[float]], up: str, lines: Mapping[str, Sequence[float]], decades: int = 4
) -> str:
    """SVG of several curves over one linear axis; the other is logarithmic, over the topmost decades.

    Parameters
    ----------
    title : Above all.
    across : Name of the linear axis, and the ascending places along it that all curves share.
    up : Name of the logarithmic axis.
    lines : By name, the values of a curve, NaN where it has none. A name that ends in `` *`` draws it dashed, in the
        colour of the one before.
    decades : How many are shown below the largest value; what is below is left out.
    """
    name, places = across
    largest = math.ceil(math.log10(max(value for values in lines.values() for value in values if value == value)))
    axis = _Axis([10.0 ** (largest - decades), 10.0**largest])

    def place(x: float, value: float) -> tuple[float, float]:
        share = (x - places[0]) / (places[-1] - places[0])
        height = HEIGHT - MARGIN - axis.share(value) * (HEIGHT - 2 * MARGIN)
        return round(MARGIN + share * (WIDTH - 2 * MARGIN), 1), round(height, 1)

    parts = [_text(WIDTH / 2, 28, title, "middle", 16), _text(WIDTH / 2, HEIGHT - 16, name, "middle")]
    parts.append(_text(12, 50, up))
    for decade in axis.decades():
        _, y = place(places[0], decade)
        parts += [_line([(MARGIN, y), (WIDTH - MARGIN, y)], "#ddd"), _text(MARGIN - 8, y + 4, f"{decade:g}", "end")]
    step = max(5, 5 * round((places[-1] - places[0]) / 30))
    for x in range(step * math.ceil(places[0] / step), math.floor(places[-1]) + 1, step):
        parts.append(_text(place(x, axis.low)[0], HEIGHT - MARGIN + 18, f"{x:g}", "middle"))
    solid = [line for line in lines if not line.endswith(" *")]
    for row, (line, values) in enumerate(lines.items()):
        colour = COLOURS[solid.index(line.removesuffix(" *")) % len(COLOURS)]
        shown = [place(x, value) for x, value in zip(places, values, strict=True) if value >= axis.low]
        parts.append(_line(shown, colour, "6 4" if line.endswith(" *") else "none"))
        if line in solid:
            parts.append(_text(WIDTH - MARGIN - 8, MARGIN + 18 + 9 * row, line, "end", colour=colour))
    return _drawing(parts)


def _drawing(parts: Sequence[str]) -> str:
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">\n'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>\n{body}\n</svg>\n'
    )


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points (error, time) that no other beats in both, by growing error."""
    front: list[tuple[float, float]] = []
    for error, time in sorted(points):
        if not front or time < front[-1][1]:
            front.append((error, time))
    return front


class _Axis:
    """A logarithmic axis from a whole decade to a whole decade."""

    def __init__(self, values: Sequence[float]) -> None:
        self._first = math.floor(math.log10(min(values)))
        self._last = max(self._first + 1, math.ceil(math.log10(max(values))))
        self.low = 10.0**self._first

    def share(self, value: float) -> float:
        return (math.log10(value) - self._first) / (self._last - self._first)

    def decades(self) -> list[float]:
        return [10.0**power for power in range(self._first, self._last + 1)]


def _line(points: Sequence[tuple[float, float]], colour: str, dashes: str = "none") -> str:
    path = " ".join(f"{x},{y}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5" stroke-dasharray="{dashes}"/>'


def _text(x: float, y: float, text: str, anchor: str = "start", size: int = 12, colour: str = "#222") -> str:
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}" font-size="{size}" fill="{colour}">{escape(text)}</text>'
