"""Fog while training: :class:`Fog` on arrays, and adapters to PyTorch and Albumentations.

Names are imported when they are first used, so that one of the two libraries is enough.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fogpipe_torch.dataset import FogDataset, one_thread
    from fogpipe_torch.fog import Draw, Fog
    from fogpipe_torch.samples import FoggySamples
    from fogpipe_torch.transform import FogTransform

_HOMES = {
    "Draw": "fogpipe_torch.fog",
    "Fog": "fogpipe_torch.fog",
    "FogDataset": "fogpipe_torch.dataset",
    "FoggySamples": "fogpipe_torch.samples",
    "FogTransform": "fogpipe_torch.transform",
    "one_thread": "fogpipe_torch.dataset",
}

__all__ = ["Draw", "Fog", "FogDataset", "FogTransform", "FoggySamples", "one_thread"]


def __getattr__(name: str) -> Any:
    import importlib

    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'fogpipe_torch' has no attribute {name!r}")
