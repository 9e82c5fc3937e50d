"""Runs a depth network over a picture: a session for a model file, sizes that it takes, and tiles."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from fogpipe.kernels import bands

Map = np.ndarray[Any, np.dtype[np.float32]]
OVERLAP = 0.25
"""Share of a tile that it has in common with the next one."""


def session(model: str, sha256: str | None) -> Any:
    """The session of a model file, kept while the file stays the same.

    Raises
    ------
    ValueError
        If there is no such file, it is no model, it has another digest, or not one picture for input.
    """
    path = Path(model)
    if not path.is_file():
        raise ValueError(f'there is no model file "{model}": set model to the path of an ONNX file that you have.')
    status = path.stat()
    return _session(path.resolve(), sha256, status.st_mtime_ns, status.st_size, bands.threads())


@lru_cache(maxsize=2)
def _session(path: Path, sha256: str | None, _changed: int, _size: int, threads: int) -> Any:
    import onnxruntime  # pyright: ignore[reportMissingImports]

    if sha256 is not None and (found := hashlib.sha256(path.read_bytes()).hexdigest()) != sha256.lower():
        raise ValueError(f"{path.name} has the SHA-256 digest {found}, not {sha256}: it is another model.")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    try:
        opened = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime's exceptions have no common base but this
        raise ValueError(f"{path.name} is not an ONNX model that onnxruntime can run: {error}") from error
    inputs = opened.get_inputs()
    if len(inputs) != 1 or len(inputs[0].shape) != 4 or inputs[0].shape[1] in (1, 2, 4):
        shapes = ", ".join(f"{entry.name} {entry.shape}" for entry in inputs)
        raise ValueError(f"{path.name} must take one picture (1, 3, height, width), but takes {shapes}.")
    return opened


def predict(network: Any, display: Map, side: int, multiple: int, mean: Map, std: Map) -> Map:
    """What the network gives for a picture of display values, (H, W, 3), brought back to (H, W)."""
    import cv2

    entry = network.get_inputs()[0]
    rows, columns = display.shape[:2]
    wanted = (_sides(rows, columns, side, multiple), entry.shape[2:])
    height, width = (size if isinstance(size, int) else own for own, size in zip(*wanted, strict=True))
    shrinks = height * width < rows * columns
    resized = cv2.resize(display, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
    batch = ((resized - mean) / std).transpose(2, 0, 1)[None].astype(np.float32)
    found = np.squeeze(np.asarray(network.run(None, {entry.name: batch})[0], np.float32))
    found = found.reshape((1, 1)) if found.size == 1 else found
    if found.ndim != 2 or not np.isfinite(found).all():
        raise ValueError(f"the model gives shape {found.shape}, or values that are not finite, where a map is wanted.")
    return np.asarray(cv2.resize(found, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32)


def tiled(look: Callable[[Map], Map], display: Map, tiles: int, align: bool) -> Map:
    """What ``look`` gives for overlapping tiles, blended; with ``align`` each fitted to the whole first."""
    whole = look(display)
    if tiles == 1:
        return whole
    total, weight = np.zeros_like(whole), np.zeros_like(whole)
    for rows in _spans(display.shape[0], tiles):
        for columns in _spans(display.shape[1], tiles):
            tile, there = look(np.ascontiguousarray(display[rows, columns])), whole[rows, columns]
            if align:
                tile = _fitted(tile, there)
            share = np.outer(_window(tile.shape[0]), _window(tile.shape[1]))
            total[rows, columns] += share * tile
            weight[rows, columns] += share
    return total / weight


def _sides(rows: int, columns: int, side: int, multiple: int) -> tuple[int, int]:
    """Height and width with the shorter one ``side`` or just above, the aspect kept, both multiples."""
    grow = side / min(rows, columns)
    height, width = (max(1, round(grow * size / multiple)) * multiple for size in (rows, columns))
    return height, width


def _spans(size: int, tiles: int) -> list[slice]:
    length = min(size, max(1, round(size / (tiles - (tiles - 1) * OVERLAP))))
    starts = np.unique(np.linspace(0, size - length, tiles).round().astype(int))
    return [slice(int(start), int(start) + length) for start in starts]


def _window(size: int) -> Map:
    """A ramp up and down over the overlap, never 0."""
    ramp = np.minimum(np.arange(size) + 1, np.arange(size)[::-1] + 1) / max(1.0, OVERLAP * size)
    return np.minimum(ramp, 1).astype(np.float32)


def _fitted(tile: Map, whole: Map) -> Map:
    """The tile times a scale above 0 plus a shift, nearest to the whole in least squares."""
    centred = tile - tile.mean()
    power = float(np.vdot(centred, centred))
    scale = float(np.vdot(centred, whole)) / power if power > 0 else 0.0
    return np.float32(scale) * centred + whole.mean() if scale > 0 else whole
