"""Haze without blur: from 8-bit display values to 8-bit display values, in memory.

The yardstick is the script that one would write with NumPy for a range that is known: exact sRGB curves in
float32, an exponential, a blend. fogpipe turns planar depth into range as well. The reference is the script in
float64.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.io.scenes import open_scene
from fogpipe.kernels.compositing import blend
from fogpipe.kernels.rays import planar_to_radial, radial_to_planar
from fogpipe.kernels.srgb import linear_from_srgb, srgb_levels_from_linear
from fogpipe.stages.composite import attenuate, over_airlight
from fogpipe.stages.medium import transmission

EXTINCTION = np.array(0.3)
AIRLIGHT = np.array([0.7, 0.75, 0.8], np.float32)


def measure(quick: bool) -> Iterator[Row]:
    """The yardstick, the stages of `hansard2019` called one by one, and one fused composite."""
    height, width = (560, 800) if quick else (1120, 1600)
    frame, depth, camera = motorcycle(height, width)
    range_map = planar_to_radial(depth, camera)
    ways = {
        "NumPy script": lambda: numpy_script(frame, range_map, np.float32),
        "attenuate, over_airlight": lambda: by_stages(frame, depth, camera),
        "naive (one pass)": lambda: fused(frame, depth, camera),
    }
    times = alternating(ways, repeats=7 if quick else 15)
    reference = numpy_script(frame, range_map, np.float64).astype(np.float64)
    for way, call in ways.items():
        difference = (call().astype(np.float64) - reference) / 255
        yield Row(
            f"{width}×{height}, uint8 to uint8",
            way,
            times[way],
            times[way] / times["NumPy script"],
            "the NumPy float32 script with exact curves",
            float(np.sqrt(np.mean(difference**2))),
            float(np.abs(difference).max()),
        )


def motorcycle(height: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The Motorcycle frame at another size: (H, W, 3) uint8, (H, W) planar depth in metres, camera."""
    import cv2

    values = open_scene("sample:motorcycle").load("linear").values
    frame = cv2.resize(srgb_levels_from_linear(values["image"]), (width, height), interpolation=cv2.INTER_CUBIC)
    rows, columns = values["range_map"].shape
    stretch = np.diag([width / columns, height / rows, 1.0])
    range_map = cv2.resize(values["range_map"], (width, height), interpolation=cv2.INTER_NEAREST)
    camera = stretch @ values["camera"]
    return frame, radial_to_planar(np.nan_to_num(range_map, nan=5.0), camera), camera


def numpy_script(frame: np.ndarray, range_map: np.ndarray, dtype: type) -> np.ndarray:
    """The same picture as a plain script makes it."""
    value = frame.astype(dtype) / dtype(255)
    linear = np.where(value <= 0.04045, value / dtype(12.92), ((value + dtype(0.055)) / dtype(1.055)) ** dtype(2.4))
    t = np.exp(-dtype(EXTINCTION.item()) * range_map.astype(dtype))[..., None]
    linear = t * linear + (1 - t) * AIRLIGHT.astype(dtype)
    value = np.where(linear <= 0.0031308, linear * dtype(12.92), dtype(1.055) * linear ** dtype(1 / 2.4) - dtype(0.055))
    return np.rint(np.clip(value, 0, 1) * 255).astype(np.uint8)


def by_stages(frame: np.ndarray, depth: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """The stages of `hansard2019` without its blur."""
    t = transmission(planar_to_radial(depth, camera), EXTINCTION)
    return srgb_levels_from_linear(over_airlight(attenuate(linear_from_srgb(frame), t), AIRLIGHT))


def fused(frame: np.ndarray, depth: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """With the composite in one pass."""
    t = transmission(planar_to_radial(depth, camera), EXTINCTION)
    return srgb_levels_from_linear(blend(linear_from_srgb(frame), t, AIRLIGHT))
