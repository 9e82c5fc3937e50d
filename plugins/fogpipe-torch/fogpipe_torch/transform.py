"""An Albumentations transform that puts pictures in fog."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import albumentations  # pyright: ignore[reportMissingImports]
import numpy as np
from albumentations.core.transforms_interface import BasicTransform  # pyright: ignore[reportMissingImports]

from fogpipe_torch.fog import Draw, Fog


class FogTransform(albumentations.ImageOnlyTransform):
    """Put the picture in fog; masks, boxes and keypoints stay as they are.

    Draws from the random numbers of Albumentations, so ``Compose(seed=…)`` and its seeding of workers hold here too.

    Parameters
    ----------
    pipeline, sample, settings, output, plugins : as those of :class:`~fogpipe_torch.fog.Fog`; plain values, so that
        Albumentations can save the transform.
    inputs : the name, among the data of the transform, of each further input of the pipeline. Declare a range as
        ``additional_targets={"range_map": "mask"}`` of the ``Compose``, so that crops and flips before the fog take it
        along (by nearest neighbour, as a distance must be).
    p : probability of fog.

    Examples
    --------
    >>> transform = albumentations.Compose(
    ...     [albumentations.HorizontalFlip(), FogTransform("hansard2019", p=0.5)],
    ...     additional_targets={"range_map": "mask"},
    ...     seed=7,
    ... )
    >>> transform(image=image, range_map=range_map, bboxes=boxes)  # doctest: +SKIP
    """

    class InitSchema(BasicTransform.InitSchema):
        """What the constructor takes; Albumentations checks it."""

        pipeline: str
        sample: Sequence[str]
        settings: dict[str, Any]
        output: str
        plugins: Sequence[str]
        inputs: dict[str, str]

    def __init__(
        self,
        pipeline: str = "hansard2019",
        sample: Sequence[str] = ("fog.visibility=loguniform(50, 500)",),
        settings: Mapping[str, Any] = MappingProxyType({}),
        output: str = "hazy",
        plugins: Sequence[str] = (),
        inputs: Mapping[str, str] = MappingProxyType({"range_map": "range_map"}),
        p: float = 0.5,
    ) -> None:
        super().__init__(p=p)
        self.pipeline = pipeline
        self.sample = tuple(sample)
        self.settings = dict(settings)
        self.output = output
        self.plugins = tuple(plugins)
        self.inputs = dict(inputs)
        self.fog = Fog(pipeline, self.sample, self.settings, output, self.plugins)

    @property
    def targets_as_params(self) -> list[str]:
        """The data that the fog depends on beside the picture."""
        return list(self.inputs.values())

    def get_params_dependent_on_data(self, params: dict[str, Any], data: dict[str, Any]) -> dict[str, Any]:
        """The fog of this picture, and what it depends on."""
        return {
            "draw": self.fog.draw(self.random_generator),
            "given": {name: np.asarray(data[key]) for name, key in self.inputs.items()},
        }

    def apply(self, img: np.ndarray, draw: Draw, given: Mapping[str, np.ndarray], **params: Any) -> np.ndarray:
        """The picture in fog."""
        return self.fog.apply(img, draw, **given)
