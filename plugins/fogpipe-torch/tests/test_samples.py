"""Samples in fog without PyTorch: reproducible, and nothing touched but the picture."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe_torch import Fog, FoggySamples


def samples(image: np.ndarray, range_map: np.ndarray, count: int = 3) -> list[dict]:
    return [{"image": image, "range_map": range_map, "label": number} for number in range(count)]


def test_order_does_not_change_a_pixel(image: np.ndarray, range_map: np.ndarray):
    forwards = FoggySamples(samples(image, range_map), Fog(), seed=5)
    backwards = [forwards[n]["image"] for n in reversed(range(3))]
    for one, other in zip(forwards, reversed(backwards), strict=True):
        np.testing.assert_array_equal(one["image"], other)


def test_every_sample_epoch_and_seed_has_its_own_fog(image: np.ndarray, range_map: np.ndarray):
    found = []
    for seed in (0, 1):
        foggy = FoggySamples(samples(image, range_map), Fog(), seed=seed)
        for epoch in (0, 1):
            foggy.set_epoch(epoch)
            found += [sample["image"].tobytes() for sample in foggy]
    assert len(set(found)) == 12


def test_only_the_picture_changes_and_the_clear_one_can_be_kept(image: np.ndarray, range_map: np.ndarray):
    boxes = [[1, 2, 30, 40]]
    clear = {"image": image, "depth": range_map, "boxes": boxes}
    sample = FoggySamples([clear], Fog(), inputs={"range_map": "depth"}, keep="clear")[0]
    assert sample.keys() == {"image", "depth", "boxes", "clear"}
    assert sample["boxes"] is boxes
    assert sample["depth"] is range_map
    assert sample["clear"] is image
    assert sample["image"].shape == image.shape
    assert (sample["image"] != image).any()
    assert clear.keys() == {"image", "depth", "boxes"}


def test_it_is_counted_from_the_end_too_and_ends(image: np.ndarray, range_map: np.ndarray):
    foggy = FoggySamples(samples(image, range_map), Fog())
    assert [sample["label"] for sample in foggy] == [0, 1, 2]
    np.testing.assert_array_equal(foggy[-1]["image"], foggy[2]["image"])
    with pytest.raises(IndexError, match="sample 3 of 3"):
        foggy[3]
