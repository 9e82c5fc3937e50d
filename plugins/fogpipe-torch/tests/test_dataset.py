"""A data set in fog: reproducible whatever the workers, and nothing touched but the picture."""

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


def test_every_sample_epoch_and_seed_has_its_own_fog(image: np.ndarray, range_map: np.ndarray):
    samples = tensor_samples(image, range_map, count=3)
    found = []
    for seed in (0, 1):
        dataset = FogDataset(samples, Fog(), seed=seed)
        for epoch in (0, 1):
            dataset.set_epoch(epoch)
            found += [dataset[n]["image"].numpy().tobytes() for n in range(3)]
    assert len(set(found)) == 12


def test_workers_that_live_on_see_the_next_epoch(image: np.ndarray, range_map: np.ndarray):
    dataset = FogDataset(tensor_samples(image, range_map, count=2), Fog())
    loader = torch.utils.data.DataLoader(dataset, num_workers=1, persistent_workers=True)
    first = [batch["image"] for batch in loader]
    dataset.set_epoch(1)
    second = [batch["image"] for batch in loader]
    assert not torch.equal(first[0], second[0])
    torch.testing.assert_close(second[0][0], dataset[0]["image"], rtol=0, atol=0)


def test_only_the_picture_changes_and_the_clear_one_can_be_kept(image: np.ndarray, range_map: np.ndarray):
    boxes = [[1, 2, 30, 40]]
    clear = {"image": image, "depth": range_map, "boxes": boxes}
    sample = FogDataset([clear], Fog(), inputs={"range_map": "depth"}, keep="clear")[0]
    assert sample.keys() == {"image", "depth", "boxes", "clear"}
    assert sample["boxes"] is boxes
    assert sample["depth"] is range_map
    assert sample["clear"] is image
    assert sample["image"].shape == image.shape
    assert (sample["image"] != image).any()
    assert clear.keys() == {"image", "depth", "boxes"}


def test_it_can_be_walked_through_and_counted_from_the_end(image: np.ndarray, range_map: np.ndarray):
    dataset = FogDataset(tensor_samples(image, range_map, count=3), Fog())
    assert [sample["label"] for sample in dataset] == [0, 1, 2]
    torch.testing.assert_close(dataset[-1]["image"], dataset[2]["image"], rtol=0, atol=0)
    with pytest.raises(IndexError, match="sample 3 of 3"):
        dataset[3]
