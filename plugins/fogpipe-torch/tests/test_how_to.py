"""What the how-to page prints runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "train-in-pytorch.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_the_data_set(image: np.ndarray, range_map: np.ndarray):
    pytest.importorskip("torch", reason="PyTorch is not installed")
    seen = []
    names = {
        "clear": [{"image": image, "range_map": range_map, "labels": 3}] * 2,
        "train_on": lambda pictures, labels: seen.append((pictures.numpy().tobytes(), labels.tolist())),
    }
    short = BLOCKS[0].replace("range(10)", "range(2)").replace("num_workers=4", "num_workers=1")
    exec(short, names)
    assert [labels for _, labels in seen] == [[3, 3]] * 2
    assert len({pictures for pictures, _ in seen}) == 2  # each epoch has other fogs


def test_the_transform(image: np.ndarray, range_map: np.ndarray):
    pytest.importorskip("albumentations", reason="Albumentations is not installed")
    large = {"image": np.tile(image, (6, 5, 1)), "range_map": np.tile(range_map, (6, 5))}
    names = large | {"boxes": [[1, 2, 300, 280]], "labels": [1]}
    exec(BLOCKS[1], names)
    assert names["out"]["image"].shape == (256, 256, 3)
    assert names["out"]["range_map"].shape == (256, 256)
