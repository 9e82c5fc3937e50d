"""Samples of tensors in fog, for data loaders; what arrays do is in test_samples.py."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

from fogpipe_torch import Fog, FogDataset, one_thread  # noqa: E402 (after the skip)


def tensor_samples(image: np.ndarray, range_map: np.ndarray, count: int = 6) -> list[dict[str, Any]]:
    picture = torch.from_numpy(image.transpose(2, 0, 1).copy())
    return [{"image": picture, "range_map": torch.from_numpy(range_map)[None], "label": n} for n in range(count)]


def loaded(dataset: FogDataset, **options: Any) -> Any:
    loader = torch.utils.data.DataLoader(dataset, batch_size=2, **options)
    return torch.cat([batch["image"] for batch in loader])


def test_neither_workers_nor_order_change_a_pixel(image: np.ndarray, range_map: np.ndarray):
    dataset = FogDataset(tensor_samples(image, range_map), Fog(), seed=5)
    backwards = torch.stack([dataset[n]["image"] for n in reversed(range(6))]).flip(0)
    torch.testing.assert_close(loaded(dataset), backwards, rtol=0, atol=0)
    workers = loaded(dataset, num_workers=2, worker_init_fn=one_thread)
    torch.testing.assert_close(workers, backwards, rtol=0, atol=0)


def test_workers_that_live_on_see_the_next_epoch(image: np.ndarray, range_map: np.ndarray):
    dataset = FogDataset(tensor_samples(image, range_map, count=2), Fog())
    loader = torch.utils.data.DataLoader(dataset, num_workers=1, persistent_workers=True)
    first = [batch["image"] for batch in loader]
    dataset.set_epoch(1)
    second = [batch["image"] for batch in loader]
    assert not torch.equal(first[0], second[0])
    torch.testing.assert_close(second[0][0], dataset[0]["image"], rtol=0, atol=0)


def test_it_can_be_walked_through_and_counted_from_the_end(image: np.ndarray, range_map: np.ndarray):
    dataset = FogDataset(tensor_samples(image, range_map, count=3), Fog())
    assert [sample["label"] for sample in dataset] == [0, 1, 2]
    torch.testing.assert_close(dataset[-1]["image"], dataset[2]["image"], rtol=0, atol=0)
    with pytest.raises(IndexError, match="sample 3 of 3"):
        dataset[3]
