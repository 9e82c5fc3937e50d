"""A PyTorch data set in fog."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch.utils.data import Dataset  # pyright: ignore[reportMissingImports]

from fogpipe_torch.samples import FoggySamples


class FogDataset(FoggySamples, Dataset[dict[str, Any]]):
    """A map-style data set whose pictures are put in fog when they are asked for.

    It takes what :class:`~fogpipe_torch.samples.FoggySamples` takes, and tensors too: a picture (3, H, W), which stays
    a tensor on its device, and maps (1, H, W) or (H, W). ``samples`` may be another data set.

    Notes
    -----
    In a loader with several workers pass ``worker_init_fn=one_thread``: each worker then computes in one thread, and
    the cores are not fought over.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._epoch = torch.zeros((), dtype=torch.int64).share_memory_()  # workers that live on see it change

    def set_epoch(self, epoch: int) -> None:
        """Name the epoch, which changes every fog; also while workers live on between epochs."""
        self._epoch.fill_(epoch)

    def as_picture(self, value: Any) -> np.ndarray:
        """A tensor (3, H, W), or an array, as an array (H, W, 3)."""
        return _array(value).transpose(1, 2, 0) if isinstance(value, torch.Tensor) else super().as_picture(value)

    def as_map(self, value: Any) -> np.ndarray:
        """A tensor (1, H, W) or (H, W), or an array, as an array."""
        if not isinstance(value, torch.Tensor):
            return super().as_map(value)
        array = _array(value)
        return array[0] if array.ndim == 3 and array.shape[0] == 1 else array

    def like(self, picture: np.ndarray, clear: Any) -> Any:
        """An array (H, W, 3) as a tensor (3, H, W) on its device, where the clear picture is one."""
        if not isinstance(clear, torch.Tensor):
            return super().like(picture, clear)
        return torch.from_numpy(np.ascontiguousarray(picture.transpose(2, 0, 1))).to(clear.device)


def one_thread(worker: int) -> None:
    """Let a worker of a data loader compute in one thread (a ``worker_init_fn``)."""
    from fogpipe import set_threads

    set_threads(1)


def _array(tensor: Any) -> np.ndarray:
    return tensor.detach().cpu().numpy()
