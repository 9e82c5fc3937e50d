"""A small data set, and a pipeline that costs next to nothing."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from fogpipe.batch.prepare import prepare
from fogpipe.batch.run import Batch
from fogpipe.batch.variation import Variation
from fogpipe.datasets.catalogue import open_dataset

MIST = '''\
"""Mist: the least that a pipeline of fog can be, in NumPy alone."""

import os
import signal
import time
from typing import Annotated

import numpy as np
from annotated_types import Gt

from fogpipe.ports import Coefficient, Image, Range, Transmission
from fogpipe.stage import stage

calls = []


@stage("mist.filled")
def filled(range_map: Range) -> Range:
    """Put what is unknown far away."""
    calls.append("filled")
    return np.nan_to_num(range_map, nan=100.0)


@stage("mist.extinction")
def extinction(*, visibility: Annotated[float, Gt(0)] = 100.0) -> Coefficient:
    """Extinction of a visibility."""
    return np.array(3 / visibility)


@stage("mist.transmission")
def transmission(range_map: Range, extinction: Coefficient) -> Transmission:
    """Beer-Lambert."""
    calls.append("transmission")
    return np.exp(-extinction.astype(np.float32) * range_map)


@stage("mist.veil")
def veil(
    image: Image, transmission: Transmission, *, grain: float = 0.0, time: float = 0.0, rng: np.random.Generator
) -> Image:
    """Blend with white, with grain."""
    t = transmission[..., None]
    noise = grain * rng.random(image.shape[:2], np.float32)[..., None]
    return np.clip(image * t + (1 - t) * 0.8 + noise + np.float32(time) / 100, 0, 1)


@stage("mist.accident")
def accident(image: Image, *, flag: str = "") -> Image:
    """Kill the process where an image is all white, as often as the file says; wait a little otherwise."""
    if image.min() == 1 and flag:
        with open(flag, "a") as file:
            file.write("x")
        if os.path.getsize(flag) <= int(flag.rpartition("-")[2]):
            os.kill(os.getpid(), signal.SIGKILL)
    return image


@stage("mist.wait")
def wait(image: Image, *, seconds: float = 0.02) -> Image:
    """Take some time."""
    time.sleep(seconds)
    return image
'''

PIPELINE = """\
fogpipe: 1
title: Mist
inputs: {image: Image, range_map: Range}
stages:
  filled: {use: mist.filled, in: {range_map: range_map}}
  extinction: {use: mist.extinction}
  transmission: {use: mist.transmission, in: {range_map: filled, extinction: extinction}}
  waited: {use: mist.wait, in: {image: image}, with: {seconds: 0}}
  whole: {use: mist.accident, in: {image: waited}}
  veil: {use: mist.veil, in: {image: whole, transmission: transmission}}
outputs: {hazy: veil, transmission: transmission, range: filled, extinction: extinction}
"""


@pytest.fixture
def mist(tmp_path: Path) -> Path:
    """The pipeline, beside a folder ``stages`` with its stages."""
    folder = tmp_path / "mist"
    (folder / "stages").mkdir(parents=True)
    (folder / "stages" / "mist.py").write_text(MIST)
    (folder / "mist.yaml").write_text(PIPELINE)
    return folder / "mist.yaml"


def write_photos(root: Path, count: int, size: tuple[int, int] = (12, 16)) -> Path:
    """``images/N.png`` with ``depth/N.png`` (codes of KITTI) and ``labels/N.txt``."""
    rng = np.random.default_rng(5)
    for folder in ("images", "depth", "labels"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    for number in range(count):
        picture = rng.integers(0, 200, (*size, 3), np.uint8)
        codes = rng.integers(256, 60 * 256, size).astype(np.uint16)
        cv2.imwrite(str(root / f"images/{number:04}.png"), picture)
        cv2.imwrite(str(root / f"depth/{number:04}.png"), codes)
        (root / f"labels/{number:04}.txt").write_text(f"0 {number}\n")
    return root


@pytest.fixture
def photos(tmp_path: Path) -> Callable[..., Path]:
    """Makes a data set of so many photos."""
    return lambda count=4, **options: write_photos(tmp_path / "photos", count, **options)


OPTIONS = {"image": "images/{id}.png", "depth": "depth/{id}.png", "encoding": "kitti", "labels": "labels/{id}.txt"}


@pytest.fixture
def make_batch(mist: Path) -> Callable[..., Batch]:
    """Prepares a batch of the mist over a folder of photos, in this process unless said otherwise."""

    def make(data: Path, out: Path | str, **options: Any) -> Batch:
        given = {key: options.pop(key, ()) for key in ("sweeps", "samples", "binds")}
        variation = Variation.parse(**given, draws=options.pop("draws", 1))
        text = str(data) if ":" in str(data) else f"folder:{data}"
        reader_options = options.pop("reader_options", OPTIONS if text.startswith("folder:") else {})
        running = {
            key: options.pop(key)
            for key in ("engine", "workers", "shard", "max_failures", "retry_failed", "keep")
            if key in options
        }
        found = open_dataset(text, reader_options)
        plugins = [str(mist.parent / "stages")]
        pipeline = str(options.pop("pipeline", mist))
        job = prepare(pipeline, found, str(out), variation=variation, plugins=plugins, **options)
        return Batch(job, found, variation, **{"engine": "here", **running})

    return make


def contents(folder: Path) -> dict[str, str]:
    """Digest of every file of an output folder; the journal, which tells what happened when, excepted."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "journal" not in path.parts
    }
