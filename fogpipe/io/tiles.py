"""One value of a run as a small picture or a few numbers, with its caption."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fogpipe.io.painting import SKY_COLOUR, STYLES, UNKNOWN_COLOUR, Scale, paint_image, paint_map, scale_for
from fogpipe.io.writers import quantised
from fogpipe.kernels.srgb import srgb_levels_from_linear
from fogpipe.ports import Color, Kind

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Tile:
    """What a proof sheet shows of one value; it holds a thumbnail, not the value.

    Attributes
    ----------
    name : where the value comes from, such as ``sky.range_map``.
    caption : kind, unit and range of values, such as ``Range [m] · 2.11 … 5.02``.
    marks : what special colours in the picture mean, such as ``7 % unknown``.
    picture : (h, w, 3) uint8; None where the value is a few numbers.
    scale : the colour bar of a map, or None.
    numbers : rows of text, where the value is a few numbers.
    swatch : the colour that these numbers are, or None.
    """

    name: str
    caption: str
    marks: tuple[tuple[Rgb, str], ...] = ()
    picture: np.ndarray | None = None
    scale: Scale | None = None
    numbers: tuple[tuple[str, ...], ...] = ()
    swatch: Rgb | None = None


def tile(name: str, kind: Kind, array: np.ndarray, color: Color) -> Tile:
    """Make the tile of a value at once, so that the value itself can be freed.

    Parameters
    ----------
    name : what to call it.
    kind : its quantity, whose ``display`` chooses the colours (grey where it is not known).
    array : the value; (H, W) floats or booleans, (H, W, C) floats, or a few numbers.
    color : the working space of its colours.
    """
    if array.ndim not in (2, 3) or array.shape in kind.shapes or array.size == 0:
        return _tile_of_numbers(name, kind, array, color)
    facts = _Facts.of(array)
    if array.ndim == 3 and array.shape[2] in (3, 4):
        return Tile(name, f"{kind} · {facts.range_text}", facts.marks(kind), paint_image(array, color))
    values = array if array.ndim == 2 else array.mean(axis=2)
    scale = scale_for(STYLES.get(kind.display, STYLES["grey"]), facts.low, facts.high)
    picture = paint_map(values.astype(np.float32, copy=False), scale)
    if array.dtype == bool:
        return Tile(name, f"{kind} · {_percent(array.mean())} true", (), picture)
    return Tile(name, f"{kind} · {facts.range_text}", facts.marks(kind), picture, scale if facts.known else None)


@dataclass(frozen=True, slots=True)
class _Facts:
    """Range of the finite values, and how much of the rest there is."""

    low: float
    high: float
    nan: float
    infinite: float

    @classmethod
    def of(cls, array: np.ndarray) -> _Facts:
        finite = np.isfinite(array)
        if finite.all():
            return cls(float(array.min()), float(array.max()), 0.0, 0.0)
        low = float(array.min(where=finite, initial=np.inf)) if finite.any() else 0.0
        high = float(array.max(where=finite, initial=-np.inf)) if finite.any() else 0.0
        return cls(low, high, float(np.isnan(array).mean()), float(np.isinf(array).mean()))

    @property
    def known(self) -> bool:
        """Whether any value is finite."""
        return self.nan + self.infinite < 1

    @property
    def range_text(self) -> str:
        if not self.known:
            return "no finite value"
        if self.low == self.high:
            return f"{number(self.low)} everywhere"
        return f"{number(self.low)} … {number(self.high)}"

    def marks(self, kind: Kind) -> tuple[tuple[Rgb, str], ...]:
        found = []
        if self.nan:
            found.append((UNKNOWN_COLOUR, f"{_percent(self.nan)} {_word(kind.nan, 'not a number')}"))
        if self.infinite:
            found.append((SKY_COLOUR, f"{_percent(self.infinite)} {_word(kind.infinity, 'infinite')}"))
        return tuple(found)


def _tile_of_numbers(name: str, kind: Kind, array: np.ndarray, color: Color) -> Tile:
    if array.ndim > 2 or array.size > 16 or array.size == 0:
        return Tile(name, str(kind), numbers=((f"shape {array.shape}",),))
    rows = tuple(tuple(map(number, row)) for row in np.atleast_2d(array).tolist())
    swatch = None
    if kind.display == "image" and array.shape == (3,):
        to_levels = srgb_levels_from_linear if color == "linear" else lambda values: quantised(values, 8)
        red, green, blue = to_levels(np.nan_to_num(array.astype(np.float32))).tolist()
        swatch = (red, green, blue)
    return Tile(name, str(kind), numbers=rows, swatch=swatch)


def number(value: float) -> str:
    """A number with three significant digits, and all of a whole number's."""
    size = abs(value)
    if not np.isfinite(value) or size == 0 or 1e-4 <= size < 1000:
        return f"{value:.3g}"
    return f"{value:.0f}" if 1000 <= size < 1e7 else f"{value:.2e}"


def _percent(share: float) -> str:
    percent = 100 * share
    if 0 < percent < 0.1:
        return "< 0.1 %"
    if 99.9 < percent < 100:
        return "> 99.9 %"
    return f"{percent:.1f} %" if 0 < percent < 1 or 99 < percent < 100 else f"{percent:.0f} %"


def _word(meaning: str | None, otherwise: str) -> str:
    return meaning.partition(",")[0] if meaning else otherwise
