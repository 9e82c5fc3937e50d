"""A PyTorch data set in fog."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch.utils.data import Dataset  # pyright: ignore[reportMissingImports]

from fogpipe_torch.fog import Fog


class FogDataset(Dataset[dict[str, Any]]):
    """A map-style data set whose pictures are put in fog when they are asked for.

    The fog of a sample depends on ``seed``, the epoch and the index of the sample, and on nothing else: neither the
    number of workers nor the order of the samples changes a pixel, and each epoch has other fogs.

    Parameters
    ----------
    samples : the data set in clear air. Each sample is a mapping; all of it but the picture is passed on as it is.
    fog : what to put on them.
    image : key of the picture: an array (H, W, 3), or a tensor (3, H, W), which stays a tensor.
    inputs : key in a sample of each further input of the pipeline; a tensor (1, H, W) or (H, W) will do.
    seed : of everything random.
    keep : where a foggy sample keeps the clear picture (for training a dehazer), or None.

    Notes
    -----
    In a loader with several workers pass ``worker_init_fn=one_thread``: each worker then computes in one thread, and
    the cores are not fought over.
    """

    def __init__(
        self,
        samples: Sequence[Mapping[str, Any]] | Dataset[Any],
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
        self._epoch = torch.zeros((), dtype=torch.int64).share_memory_()  # workers that live on see it change

    def set_epoch(self, epoch: int) -> None:
        """Name the epoch, which changes every fog; also while workers live on between epochs."""
        self._epoch.fill_(epoch)

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> dict[str, Any]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        index %= len(self)
        sample = dict(self.samples[index])
        clear = sample[self.image]
        rng = np.random.default_rng([self.seed, int(self._epoch), index])
        given = {name: _map(sample[key]) for name, key in self.inputs.items()}
        foggy = self.fog(_rows_first(clear), rng=rng, **given)
        if self.keep is not None:
            sample[self.keep] = clear
        sample[self.image] = _like(foggy, clear)
        return sample


def one_thread(worker: int) -> None:
    """Let a worker of a data loader compute in one thread (a ``worker_init_fn``)."""
    from fogpipe import set_threads

    set_threads(1)


def _rows_first(picture: Any) -> np.ndarray:
    """A tensor (3, H, W) as an array (H, W, 3)."""
    return (
        picture.detach().cpu().numpy().transpose(1, 2, 0) if isinstance(picture, torch.Tensor) else np.asarray(picture)
    )


def _like(picture: np.ndarray, clear: Any) -> Any:
    if not isinstance(clear, torch.Tensor):
        return picture
    return torch.from_numpy(np.ascontiguousarray(picture.transpose(2, 0, 1))).to(clear.device)


def _map(values: Any) -> np.ndarray:
    array = values.detach().cpu().numpy() if isinstance(values, torch.Tensor) else np.asarray(values)
    return array[0] if array.ndim == 3 and array.shape[0] == 1 and isinstance(values, torch.Tensor) else array
