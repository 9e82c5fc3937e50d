"""A random fog on one picture, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fogpipe
import numpy as np
from fogpipe.batch.variation import parse_sample
from fogpipe.kernels.srgb import linear_from_srgb, srgb_from_linear, srgb_levels_from_linear


@dataclass(frozen=True)
class Draw:
    """One fog of the many that a :class:`Fog` may put on a picture.

    Attributes
    ----------
    settings : the parameters that were drawn, by name.
    seed : of everything else that is random in the pipeline.
    """

    settings: Mapping[str, Any]
    seed: int


@dataclass(frozen=True)
class Fog:
    """A pipeline with parameters that are drawn anew for each picture.

    Parameters
    ----------
    pipeline : name of a shipped pipeline or path of a YAML file.
    sample : parameters to draw, each as on the command line: ``"fog.visibility=loguniform(50, 500)"``.
    settings : parameters that stay, by name.
    output : the output of the pipeline that is the picture.
    plugins : local folders of stages.

    Raises
    ------
    fogpipe.errors.RequestError, fogpipe.errors.PipelineError
        At once, and not in the first training step, if a distribution or the pipeline is not valid.
    """

    pipeline: str | Path = "hansard2019"
    sample: Sequence[str] = ("fog.visibility=loguniform(50, 500)",)
    settings: Mapping[str, Any] = field(default_factory=dict)
    output: str = "hazy"
    plugins: Sequence[str | Path] = ()

    def __post_init__(self) -> None:
        self._load(self.draw(np.random.default_rng(0))).plan([self.output])

    def draw(self, rng: np.random.Generator) -> Draw:
        """Draw a fog."""
        drawn = {sample.parameter: sample.draw(rng) for sample in map(parse_sample, self.sample)}
        return Draw(drawn, int(rng.integers(2**53)))

    def apply(self, image: np.ndarray, draw: Draw, **inputs: Any) -> np.ndarray:
        """The picture in this fog.

        Parameters
        ----------
        image : (H, W, 3). Display values as training libraries have them: uint8, uint16, or floats where 1 is white.
        draw : of :meth:`draw`.
        **inputs : what else the pipeline takes, such as ``range_map``, (H, W) float, metres along the ray; NaN where
            unknown, +inf for sky.

        Returns
        -------
        (H, W, 3) of the dtype of ``image``, display values. Floats above 1 stay as they are.

        Raises
        ------
        fogpipe.errors.InputError
            If an input is missing or not what the pipeline takes.
        fogpipe.errors.StageError
            If a stage fails.
        """
        pipeline = self._load(draw)
        linear = pipeline.graph.color == "linear"
        image = np.asarray(image)
        if linear and np.issubdtype(image.dtype, np.floating):
            image = linear_from_srgb(image)
        foggy = pipeline.run(to=[self.output], image=image, **inputs)[self.output]
        return _display(foggy, np.asarray(image).dtype, linear)

    def __call__(self, image: np.ndarray, *, rng: np.random.Generator, **inputs: Any) -> np.ndarray:
        """The picture in a fog that is drawn from ``rng``; see :meth:`apply`."""
        return self.apply(image, self.draw(rng), **inputs)

    def _load(self, draw: Draw) -> fogpipe.Pipeline:
        settings = {**self.settings, **draw.settings}
        return fogpipe.load(self.pipeline, set=settings, seed=draw.seed, plugins=self.plugins)


def _display(picture: np.ndarray, dtype: np.dtype[Any], linear: bool) -> np.ndarray:
    """Working values as display values of this dtype."""
    if np.issubdtype(dtype, np.floating):
        return (srgb_from_linear(picture) if linear else picture).astype(dtype, copy=False)
    if linear:
        return srgb_levels_from_linear(picture, 8 * dtype.itemsize)
    return np.rint(np.clip(picture, 0, 1) * np.iinfo(dtype).max).astype(dtype)
