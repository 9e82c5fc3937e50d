"""Arrays as small pictures: averaged down, coloured by what they measure, with the unknown and the sky marked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fogpipe.io.writers import quantised
from fogpipe.kernels.srgb import srgb_levels_from_linear
from fogpipe.ports import Color

LARGEST_SIDE = 480
"""Most pixels that a thumbnail has in either direction."""
SMALLEST_SIDE = 12
"""A thumbnail that would be thinner is stretched to this, so that a row of pixels can be seen."""
USEFUL_SIDE = 240
"""A smaller array is magnified by whole pixels up to this."""
UNKNOWN_COLOUR = (200, 90, 210)
SKY_COLOUR = (100, 200, 255)
"""Far from every colour of every map, so that no value looks like them."""
LOGARITHMIC_FROM = 30.0
"""A distance whose largest value is this many times its smallest is drawn on a logarithmic scale."""


@dataclass(frozen=True, slots=True)
class Style:
    """How a map is coloured.

    Attributes
    ----------
    colormap : name of a perceptually uniform map of OpenCV, or ``grey``.
    low, high : ends of the scale; None takes the smallest or largest value.
    logarithmic : whether the scale may be.
    """

    colormap: str = "grey"
    low: float | None = None
    high: float | None = None
    logarithmic: bool = False


STYLES: dict[str, Style] = {
    "image": Style(),
    "layer": Style(),
    "distance": Style("viridis", logarithmic=True),
    "share": Style("deepgreen", low=0, high=1),
    "density": Style("magma", low=0),
    "mask": Style("grey", low=0, high=1),
    "blur": Style("inferno", low=0),
    "grey": Style(),
}
"""By the ``display`` of a kind; ``image`` and ``layer`` show colours as they are, and grey where there are none."""


@dataclass(frozen=True, slots=True)
class Scale:
    """The scale of values along a colour bar."""

    colors: np.ndarray
    low: float
    high: float
    logarithmic: bool

    @property
    def middle(self) -> float:
        """The value half-way along the bar."""
        return float(np.sqrt(self.low * self.high)) if self.logarithmic else (self.low + self.high) / 2

    def positions(self, values: np.ndarray) -> np.ndarray:
        """Where values lie on the bar, from 0 to 255; all at the low end if the scale has no length."""
        low, high = self.low, self.high
        if self.logarithmic:
            values, low, high = np.log(np.maximum(values, low)), np.log(low), np.log(high)
        share = (values - low) / (high - low) if high > low else np.zeros_like(values)
        return np.rint(255 * np.clip(share, 0, 1)).astype(np.uint8)


def scale_for(style: Style, low: float, high: float) -> Scale:
    """The scale for a map whose finite values reach from ``low`` to ``high``."""
    logarithmic = style.logarithmic and low > 0 and high >= LOGARITHMIC_FROM * low
    low = low if style.low is None else min(low, style.low)
    high = high if style.high is None else max(high, style.high)
    return Scale(_colors(style.colormap), low, high, logarithmic)


def paint_map(values: np.ndarray, scale: Scale) -> np.ndarray:
    """A (H, W) float32 map as a thumbnail, uint8 RGB. Where most of a pixel is NaN or sky it has that colour."""
    known = np.isfinite(values)
    if known.all():
        return _magnified(scale.colors[scale.positions(_shrunk(values))])
    total = _shrunk(np.where(known, values, 0))
    share = _shrunk(known.astype(np.float32))
    sky = _shrunk(np.isposinf(values).astype(np.float32))
    colors = scale.colors[scale.positions(total / np.maximum(share, 1e-6))]
    colors[share < 0.5] = UNKNOWN_COLOUR
    colors[(share < 0.5) & (sky >= 0.5 * (1 - share))] = SKY_COLOUR
    return _magnified(colors)


def paint_image(pixels: np.ndarray, color: Color) -> np.ndarray:
    """A (H, W, 3) picture, or a (H, W, 4) premultiplied layer over a checkerboard, as a thumbnail, uint8 sRGB."""
    small = _shrunk(np.asarray(pixels, np.float32))
    known = np.all(np.isfinite(small), axis=2)
    if small.shape[2] == 4:
        board = 0.02 if color == "linear" else 0.15
        small = small[..., :3] + (1 - small[..., 3:]) * _checkerboard(*small.shape[:2], board, 3 * board)
    small = np.where(known[..., np.newaxis], small, 0)
    colors = srgb_levels_from_linear(small) if color == "linear" else quantised(small, 8)
    colors[~known] = UNKNOWN_COLOUR
    return _magnified(colors)


def _colors(name: str) -> np.ndarray:
    ramp = np.arange(256, dtype=np.uint8)
    if name == "grey":
        return np.stack([ramp] * 3, axis=-1)
    import cv2

    return np.ascontiguousarray(
        cv2.applyColorMap(ramp, getattr(cv2, f"COLORMAP_{name.upper()}")).reshape(256, 3)[:, ::-1]
    )


def _shrunk(values: np.ndarray) -> np.ndarray:
    """Averaged over areas, so that no side is longer than ``LARGEST_SIDE``."""
    height, width = values.shape[:2]
    factor = LARGEST_SIDE / max(height, width)
    if factor >= 1:
        return values
    import cv2

    size = max(1, round(factor * width)), max(1, round(factor * height))
    return cv2.resize(values, size, interpolation=cv2.INTER_AREA)


def _magnified(colors: np.ndarray) -> np.ndarray:
    height, width = colors.shape[:2]
    factor = max(1, USEFUL_SIDE // max(height, width))
    rows = factor * max(1, -(-SMALLEST_SIDE // (factor * height)))
    columns = factor * max(1, -(-SMALLEST_SIDE // (factor * width)))
    return colors.repeat(rows, axis=0).repeat(columns, axis=1)


def _checkerboard(height: int, width: int, dark: float, light: float) -> np.ndarray:
    rows, columns = np.indices((height, width)) // 12
    return np.where((rows + columns) % 2, np.float32(light), np.float32(dark))[..., np.newaxis]
