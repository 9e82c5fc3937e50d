"""The kinds of value that flow between stages.

A port is a NumPy array annotated with a :class:`Kind`: a quantity with its unit, shape, dtype,
admissible values, and what NaN and infinity mean. Edges of a pipeline match by kind, so a depth
in metres can never be wired into a transmission. A plugin adds a kind by making one::

    Polarisation = Annotated[np.ndarray, Kind("Polarisation", "degree of linear polarisation",
                                              shapes=(("H", "W"),), low=0, high=1)]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

Color = Literal["linear", "srgb"]
"""What the numbers of colours mean inside a pipeline: linear light, or sRGB display values."""

FloatArray = np.ndarray[Any, np.dtype[np.floating[Any]]]
BoolArray = np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class Unit:
    """The unit of a parameter, for example ``Annotated[float, Ge(0), Unit("1/m")]``."""

    symbol: str


@dataclass(frozen=True, slots=True)
class Kind:
    """A quantity that a port carries.

    Attributes
    ----------
    name : the name used in pipelines and messages.
    meaning : one line for people.
    shapes : admissible shapes; letters are sizes that agree across all inputs of a run.
    unit : physical unit, ``"1"`` for a pure number.
    dtype : ``"float"`` (float32 or float64) or ``"bool"``.
    low, high : closed bounds of admissible finite values.
    nan, infinity : what NaN and +inf mean; ``None`` where they are not admitted.
    display : how a proof sheet draws it (a key of ``fogpipe.io.sheet.STYLES``).
    """

    name: str
    meaning: str
    shapes: tuple[tuple[str | int, ...], ...]
    unit: str = "1"
    dtype: str = "float"
    low: float = -np.inf
    high: float = np.inf
    nan: str | None = None
    infinity: str | None = None
    display: str = "grey"

    @property
    def is_scalar(self) -> bool:
        """Whether the value is a single number."""
        return self.shapes == ((),)

    def sizes(self, array: np.ndarray) -> dict[str, int]:
        """What the letters of the shape stand for in ``array``: its height H and width W."""
        shape = next((shape for shape in self.shapes if _same_shape(array.shape, shape)), ())
        return {symbol: size for symbol, size in zip(shape, array.shape, strict=True) if isinstance(symbol, str)}

    def is_per_pixel(self, array: np.ndarray) -> bool:
        """Whether ``array`` holds a value for each pixel, rather than a few numbers for all."""
        return bool(self.sizes(array))

    def __str__(self) -> str:
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"

    def misfit(self, array: np.ndarray) -> str | None:
        """Why the dtype or shape of ``array`` does not fit this kind, or None. O(1)."""
        wanted = np.bool_ if self.dtype == "bool" else np.floating
        if not np.issubdtype(array.dtype, wanted):
            return f"dtype {array.dtype} where {self} is {self.dtype}"
        if not any(_same_shape(array.shape, shape) for shape in self.shapes):
            shapes = " or ".join(_shape_text(shape) for shape in self.shapes)
            return f"shape {array.shape} where {self} is {shapes}"
        return None

    def bad_values(self, array: np.ndarray) -> str | None:
        """Why the values of ``array`` are not admissible, or None. Two passes when all is well, O(size)."""
        if self.dtype == "bool":
            return None
        least, most = array.min(), array.max()  # NaN where there is one
        if np.isfinite(least) and np.isfinite(most) and self.low <= least and most <= self.high:
            return None
        for code, test, meaning in (("NaN", np.isnan, self.nan), ("inf", np.isposinf, self.infinity)):
            if meaning is None and (count := int(np.count_nonzero(test(array)))):
                return f"{count} of {array.size} values are {code}, which {self} does not admit"
        finite = array[np.isfinite(array)]
        if np.isneginf(array).any() or (finite.size and finite.min() < self.low):
            low = "-inf" if np.isneginf(array).any() else f"{finite.min():g}"
            return f"smallest value {low} is below {self.low:g}, the least that {self} admits"
        if finite.size and finite.max() > self.high:
            return f"largest value {finite.max():g} is above {self.high:g}, the most that {self} admits"
        return None


def _same_shape(shape: tuple[int, ...], wanted: tuple[str | int, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        size > 0 if isinstance(want, str) else size == want for size, want in zip(shape, wanted, strict=True)
    )


def _shape_text(shape: tuple[str | int, ...]) -> str:
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})" if shape else "a single number"


MAP = (("H", "W"),)
COLOUR = (("H", "W", 3),)
SCALAR = ((),)
UNKNOWN = "unknown"
SKY = "sky, infinitely far"
# A distance may be unknown (NaN) or infinite (+inf); the two are never confused.
_DISTANCE: dict[str, Any] = {"unit": "m", "low": 0, "nan": UNKNOWN, "infinity": SKY, "display": "distance"}

Image = Annotated[
    FloatArray, Kind("Image", "colour in the working space; 1 is display white, more is HDR", COLOUR, display="image")
]
Layer = Annotated[
    FloatArray, Kind("Layer", "premultiplied colour and opacity, t·(r, g, b, 1)", (("H", "W", 4),), display="layer")
]
Depth = Annotated[FloatArray, Kind("Depth", "planar depth along the optical axis", MAP, **_DISTANCE)]
Range = Annotated[FloatArray, Kind("Range", "distance along the ray of the pixel", MAP, **_DISTANCE)]
RelativeDepth = Annotated[
    FloatArray,
    Kind("RelativeDepth", "depth without unit, 0 near to 1 far", MAP, low=0, high=1, nan=UNKNOWN, display="distance"),
]
Transmission = Annotated[
    FloatArray,
    Kind("Transmission", "share of light that arrives unscattered", MAP, low=0, high=1, nan=UNKNOWN, display="share"),
]
Density = Annotated[
    FloatArray, Kind("Density", "density of the medium relative to its mean", MAP, low=0, display="density")
]
Mask = Annotated[BoolArray, Kind("Mask", "a region", MAP, dtype="bool", display="mask")]
BlurScale = Annotated[
    FloatArray, Kind("BlurScale", "standard deviation of the blur at each pixel", MAP, "px", low=0, display="blur")
]
Airlight = Annotated[
    FloatArray,
    Kind("Airlight", "colour of the scattered light, one or one per pixel", ((3,), *COLOUR), low=0, display="image"),
]
Coefficient = Annotated[
    FloatArray, Kind("Coefficient", "absorption, scattering or extinction of the medium", SCALAR, "1/m", low=0)
]
Length = Annotated[
    FloatArray,
    Kind("Length", "a distance", SCALAR, "m", low=0, nan="none in this scene", infinity="beyond any distance"),
]
Number = Annotated[
    FloatArray, Kind("Number", "a pure number, such as a score", SCALAR, nan="undefined", infinity="no error at all")
]
Camera = Annotated[FloatArray, Kind("Camera", "intrinsic matrix, centre of the first pixel at (0, 0)", ((3, 3),), "px")]


def known_kinds() -> dict[str, Kind]:
    """The kinds of this module, by name."""
    found = (meta for value in globals().values() for meta in getattr(value, "__metadata__", ()))
    return {kind.name: kind for kind in found if isinstance(kind, Kind)}
