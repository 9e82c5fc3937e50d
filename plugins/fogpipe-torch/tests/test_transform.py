"""Fog among the transforms of Albumentations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

albumentations = pytest.importorskip("albumentations", reason="Albumentations is not installed")

from fogpipe_torch import FogTransform  # noqa: E402 (after the skip)


def composed(*transforms: Any, seed: int = 7, **options: Any) -> Any:
    return albumentations.Compose(list(transforms), additional_targets={"range_map": "mask"}, seed=seed, **options)


def test_masks_boxes_and_keypoints_stay(image: np.ndarray, range_map: np.ndarray):
    # Albumentations warns of boxes where no transform moves them, so there is one that never does.
    transform = composed(
        FogTransform(p=1),
        albumentations.HorizontalFlip(p=0),
        bbox_params=albumentations.BboxParams("pascal_voc", label_fields=["labels"]),
        keypoint_params=albumentations.KeypointParams("xy"),
    )
    mask = np.arange(48 * 64, dtype=np.int32).reshape(48, 64)
    out = transform(
        image=image, range_map=range_map, mask=mask, bboxes=[[1, 2, 30, 40]], labels=[1], keypoints=[[3, 4]]
    )
    assert (out["image"] != image).any()
    np.testing.assert_array_equal(out["mask"], mask)
    np.testing.assert_array_equal(out["range_map"], range_map)
    np.testing.assert_allclose(out["bboxes"], [[1, 2, 30, 40]], rtol=1e-6)  # kept relative to the size, in float32
    np.testing.assert_allclose(out["keypoints"], [[3, 4]])


def test_the_range_goes_along_with_a_flip(image: np.ndarray, range_map: np.ndarray):
    fog = FogTransform(settings={"airlight.colour": [0.8, 0.8, 0.8]}, p=1)
    flat = np.full_like(image, 40)
    out = composed(albumentations.HorizontalFlip(p=1), fog)(image=flat, range_map=range_map)["image"]
    brightness = out.mean((0, 2))
    assert (np.diff(brightness) <= 0).all()  # far is now at the left, and the fog is brighter than the scene
    assert brightness[0] > brightness[-1]


def test_the_seed_of_compose_decides(image: np.ndarray, range_map: np.ndarray):
    def pictures(seed: int) -> list[bytes]:
        transform = composed(FogTransform(p=1), seed=seed)
        return [transform(image=image, range_map=range_map)["image"].tobytes() for _ in range(2)]

    assert pictures(7) == pictures(7)
    assert len({*pictures(7), *pictures(8)}) == 4


def test_it_can_be_saved_and_read_back(image: np.ndarray, range_map: np.ndarray):
    transform = composed(FogTransform(sample=["fog.visibility=uniform(50, 60)"], settings={"scale.strength": 0}, p=1))
    again = albumentations.from_dict(albumentations.to_dict(transform))
    again.set_random_seed(7)
    np.testing.assert_array_equal(
        again(image=image, range_map=range_map)["image"], transform(image=image, range_map=range_map)["image"]
    )


def test_a_missing_range_is_named(image: np.ndarray):
    with pytest.raises(ValueError, match="range_map"):
        composed(FogTransform(p=1))(image=image)
