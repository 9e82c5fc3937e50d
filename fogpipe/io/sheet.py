"""The proof sheet: every intermediate of a run as a picture with a caption, on one page.

:func:`tile` makes a thumbnail of a value as soon as it is there, and :func:`write_sheet` lays the thumbnails out. Names
and titles keep to the letters of the font that comes with Pillow; other letters are spelled as well as it can.
"""

from __future__ import annotations

import math
import os
import unicodedata
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, cast

import numpy as np

from fogpipe.io.atomic import atomic_write
from fogpipe.io.painting import STYLES, Scale
from fogpipe.io.tiles import Rgb, Tile, number, tile
from fogpipe.io.writers import encode_png

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

__all__ = ["STYLES", "Tile", "tile", "write_sheet"]

MAX_COLUMNS = 4
MIN_CARD = 240
MARGIN, GAP, PADDING, RADIUS = 28, 18, 12, 8
PAGE, CARD, STRONG, SOFT = (22, 24, 28), (34, 37, 43), (236, 239, 244), (160, 167, 178)
TITLE, NAME, TEXT, SMALL = 26, 17, 14, 12
LINE = 20
HEADER = 2 * LINE + 8
BAR = 8
NUMBER = 64

_LETTERS = str.maketrans({"–": "-", "—": "-", "−": "-", "×": "x", "→": "->", "’": "'", "“": '"', "”": '"', "∞": "inf"})
_IN_FONT = frozenset("·…°±")


def write_sheet(path: str | os.PathLike[str], title: str, tiles: Sequence[Tile]) -> None:
    """Write a proof sheet as a PNG; pictures come first, then what is a few numbers, each in the order given.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    pictures = [entry for entry in tiles if entry.picture is not None]
    numbers = [entry for entry in tiles if entry.picture is None]
    card = max([MIN_CARD, *(entry.picture.shape[1] + 2 * PADDING for entry in pictures if entry.picture is not None)])
    columns = min(MAX_COLUMNS, max(1, math.ceil(math.sqrt(len(pictures) or len(numbers)))))
    rows = _rows(pictures, columns) + _rows(numbers, columns)
    heights = [max(map(_height, row)) for row in rows]
    width = 2 * MARGIN + columns * card + (columns - 1) * GAP
    top = MARGIN + 2 * TITLE
    page = _Page(width, top + sum(heights) + GAP * max(0, len(rows) - 1) + MARGIN)
    page.write(MARGIN, MARGIN, title, TITLE, STRONG, width - 2 * MARGIN)
    for row, height in zip(rows, heights, strict=True):
        for column, entry in enumerate(row):
            page.draw_card(MARGIN + column * (card + GAP), top, card, height, entry)
        top += height + GAP
    with atomic_write(path) as temporary:
        temporary.write_bytes(page.encoded())


def _rows(tiles: Sequence[Tile], columns: int) -> list[Sequence[Tile]]:
    return [tiles[start : start + columns] for start in range(0, len(tiles), columns)]


def _height(entry: Tile) -> int:
    height = 2 * PADDING + HEADER
    if entry.picture is None:
        return height + LINE * len(entry.numbers)
    bar = 6 + BAR + LINE if entry.scale is not None else 0
    return height + entry.picture.shape[0] + bar + (LINE if entry.marks else 0)


class _Page:
    """A page that cards are drawn on."""

    def __init__(self, width: int, height: int) -> None:
        from PIL import Image, ImageDraw

        self.image = Image.new("RGB", (width, height), PAGE)
        self.draw = ImageDraw.Draw(self.image)

    def encoded(self) -> bytes:
        """The page as a PNG."""
        return encode_png(np.asarray(self.image))

    def write(self, left: int, top: int, text: str, size: int, color: Rgb, width: int) -> int:
        """Write a line, cut off at ``width``; returns the width it takes."""
        font, text = _font(size), _printable(text)
        if font.getlength(text) > width:
            while text and font.getlength(f"{text}…") > width:
                text = text[:-1]
            text += "…"
        self.draw.text((left, top), text, fill=color, font=font)
        return math.ceil(font.getlength(text))

    def paste(self, left: int, top: int, pixels: np.ndarray) -> None:
        """Put uint8 pixels on the page."""
        from PIL import Image

        self.image.paste(Image.fromarray(pixels), (left, top))

    def draw_card(self, left: int, top: int, width: int, height: int, entry: Tile) -> None:
        """A card with the name, the caption, and the picture or numbers of a tile."""
        self.draw.rounded_rectangle((left, top, left + width - 1, top + height - 1), RADIUS, CARD)
        left, top, width = left + PADDING, top + PADDING, width - 2 * PADDING
        self.write(left, top, entry.name, NAME, STRONG, width)
        self.write(left, top + LINE + 2, entry.caption, TEXT, SOFT, width)
        top += HEADER
        if entry.picture is None:
            self._draw_numbers(left, top, width, entry)
            return
        self.paste(left + (width - entry.picture.shape[1]) // 2, top, entry.picture)
        top += entry.picture.shape[0]
        if entry.scale is not None:
            self._draw_bar(left, top + 6, width, entry.scale)
            top += 6 + BAR + LINE
        for color, text in entry.marks:
            self.draw.rectangle((left, top + 7, left + 9, top + 16), color)
            left += 16 + self.write(left + 16, top + 3, text, TEXT, SOFT, width) + 20

    def _draw_bar(self, left: int, top: int, width: int, scale: Scale) -> None:
        ramp = scale.colors[np.linspace(0, 255, width).astype(int)]
        self.paste(left, top, np.broadcast_to(ramp, (BAR, width, 3)).copy())
        labels = [scale.low, scale.middle, scale.high] if scale.high > scale.low else [scale.low]
        for share, value in zip((0, 0.5, 1), labels, strict=False):
            text = number(value) + (" (log)" if share == 0.5 and scale.logarithmic else "")
            place = left + round(share * (width - _font(SMALL).getlength(text)))
            self.write(place, top + BAR + 3, text, SMALL, SOFT, width)

    def _draw_numbers(self, left: int, top: int, width: int, entry: Tile) -> None:
        if entry.swatch is not None:
            self.draw.rounded_rectangle((left, top, left + 2 * LINE, top + LINE - 5), 3, entry.swatch, outline=SOFT)
            left, width = left + 2 * LINE + 12, width - 2 * LINE - 12
        for row in entry.numbers:
            for column, text in enumerate(row):
                self.write(left + column * NUMBER, top - 2, text, NAME, STRONG, width - column * NUMBER)
            top += LINE


@cache
def _font(size: int) -> FreeTypeFont:
    from PIL import ImageFont

    return cast("FreeTypeFont", ImageFont.load_default(size))


def _printable(text: str) -> str:
    """Text in the letters that the font has: accents are dropped, what is left over becomes a question mark."""
    plain = unicodedata.normalize("NFKD", "".join(c if c in _IN_FONT else c.translate(_LETTERS) for c in text))
    kept = (c for c in plain if not unicodedata.combining(c))
    return "".join(c if c in _IN_FONT or " " <= c <= "~" else "?" for c in kept)
