"""fogpipe adds fog and haze to images.

>>> import fogpipe
>>> result = fogpipe.load("hansard2019").run(image=image, range_map=range_map)  # doctest: +SKIP
>>> result["hazy"]  # doctest: +SKIP

Names are imported when they are first used, so that ``import fogpipe`` costs next to nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fogpipe.kernels.bands import set_threads
    from fogpipe.pipeline.shipped import shipped_pipelines
    from fogpipe.runtime.pipeline import Pipeline, Result, load

__version__ = "0.1.0"

_HOMES = {
    "Pipeline": "fogpipe.runtime.pipeline",
    "Result": "fogpipe.runtime.pipeline",
    "load": "fogpipe.runtime.pipeline",
    "set_threads": "fogpipe.kernels.bands",
    "shipped_pipelines": "fogpipe.pipeline.shipped",
}

__all__ = ["Pipeline", "Result", "__version__", "load", "set_threads", "shipped_pipelines"]


def __getattr__(name: str) -> Any:
    import importlib

    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'fogpipe' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
