"""A sequence of samples in fog, of arrays alone: for any loader, and the whole of what a PyTorch data set does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fogpipe_torch.fog import Fog


class FoggySamples(Sequence[dict[str, Any]]):
    """Samples whose pictures are put in fog when they are asked for.

    The fog of a sample depends on ``seed``, the epoch and the index of the sample, and on nothing else: neither the
    number of workers nor the order of the samples changes a pixel, and each epoch has other fogs.

    Parameters
    ----------
    samples : in clear air. Each is a mapping; all of it but the picture is passed on as it is.
    fog : what to put on them.
    image : key of the picture: an array (H, W, 3).
    inputs : key in a sample of each further input of the pipeline.
    seed : of everything random.
    keep : where a foggy sample keeps the clear picture (for training a dehazer), or None.
    """

    def __init__(
        self,
        samples: Sequence[Mapping[str, Any]] | Any,
        fog: Fog,
        *,
        image: str = "image",
        inputs: Mapping[str, str] | None = None,
        seed: int = 0,
        keep: str | None = None,
    ) -> None:
        self.samples: Any = samples
        self.fog = fog
        self.image = image
        self.inputs = {"range_map": "range_map"} if inputs is None else dict(inputs)
        self.seed = seed
        self.keep = keep
        self._epoch: Any = 0

    def set_epoch(self, epoch: int) -> None:
        """Name the epoch, which changes every fog."""
        self._epoch = epoch

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: Any) -> Any:
        if not -len(self) <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        index %= len(self)
        sample = dict(self.samples[index])
        clear = sample[self.image]
        rng = np.random.default_rng([self.seed, int(self._epoch), index])
        given = {name: self.as_map(sample[key]) for name, key in self.inputs.items()}
        foggy = self.fog(self.as_picture(clear), rng=rng, **given)
        if self.keep is not None:
            sample[self.keep] = clear
        sample[self.image] = self.like(foggy, clear)
        return sample

    def as_picture(self, value: Any) -> np.ndarray:
        """The picture of a sample as an array (H, W, 3)."""
        return np.asarray(value)

    def as_map(self, value: Any) -> np.ndarray:
        """Another input as an array."""
        return np.asarray(value)

    def like(self, picture: np.ndarray, clear: Any) -> Any:
        """A foggy picture in the form of the clear one."""
        return picture
