"""Depth of one photograph by a network that the user brings as an ONNX file."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from fogpipe.kernels.arrays import require_maps
from fogpipe.kernels.srgb import srgb_from_linear
from fogpipe.ports import Depth, Image, RelativeDepth, Unit
from fogpipe.stage import stage

from fogpipe_onnx import network

Encoding = Literal["linear", "display"]
Side = Annotated[int, Ge(1), Unit("px")]
Colour = tuple[float, float, float]
Deviation = tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)], Annotated[float, Gt(0)]]
IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

ROUNDING = 1e-5
"""Relative spread of a map up to which it is a constant with rounding errors of float32."""


@stage("onnx.relative_depth")
def relative_depth(
    image: Image,
    *,
    model: str,
    sha256: str | None = None,
    encoding: Encoding = "linear",
    output: Literal["inverse-depth", "depth"] = "inverse-depth",
    side: Side = 518,
    multiple: Side = 14,
    mean: Colour = IMAGENET_MEAN,
    std: Deviation = IMAGENET_STD,
    tiles: Annotated[int, Ge(1), Le(16)] = 1,
    clip: Annotated[float, Ge(0), Le(10)] = 0.1,
) -> RelativeDepth:
    """Relative depth of one photograph, by a network such as Depth Anything V2 or MiDaS.

    Parameters
    ----------
    image : (H, W, 3) float; values outside [0, 1] count as the nearest bound.
    model : Path of the ONNX file. It takes (1, 3, height, width) float32 and its first output is a map.
    sha256 : Digest that the file must have. Give it where a cache is used, or a run must be replayed: a path alone does
        not tell one model from another.
    encoding : What the numbers of the image mean: ``"linear"`` light, as in a pipeline with ``color: linear``, or
        ``"display"`` values. Networks see display values.
    output : What the network gives: ``"inverse-depth"``, large is near, or ``"depth"``, large is far. Scale and shift
        do not matter.
    side : Shorter side of what the network sees, pixels, unless the model fixes the size.
    multiple : Both sides are multiples of this: 14 for Depth Anything, 32 for MiDaS.
    mean, std : Display values are normalised to (value − mean) / std; the defaults are those of ImageNet.
    tiles : Tiles along each side, for more detail: the network sees the whole and each tile, and each tile is fitted to
        the whole by a scale and a shift.
    clip : Share of the pixels, in percent, that may be beyond each end of the depth.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image, 0 near to 1 far; 0.5 where the network gives a constant. From an
        inverse depth it is one minus the inverse, to be made metres by ``depth.to_range`` with the law ``inverse``.

    Raises
    ------
    ValueError
        If the file is missing, no model or another one, if its output is not a map, or if the image is not finite.

    Notes
    -----
    Time and memory are the network's: 1 + tiles² runs. The runtime may give other last bits on another machine.

    References
    ----------
    Yang et al. 2024, *Depth Anything V2*; Ranftl et al. 2020, *Towards robust monocular depth estimation* (MiDaS).
    """
    found = _predicted(image, model, sha256, encoding, side, multiple, mean, std, tiles, align=True)
    low, high = np.percentile(found, [clip, 100 - clip])
    varies = high - low > ROUNDING * max(abs(low), abs(high))
    share = np.clip((found - low) / (high - low), 0, 1) if varies else np.full_like(found, 0.5)
    depth = 1 - share if output == "inverse-depth" else share
    return depth.astype(np.result_type(image, np.float32))


@stage("onnx.metric_depth")
def metric_depth(
    image: Image,
    *,
    model: str,
    sha256: str | None = None,
    encoding: Encoding = "linear",
    unit: Annotated[float, Gt(0), Unit("m")] = 1.0,
    far: Annotated[float, Gt(0), Unit("m")] | None = None,
    side: Side = 518,
    multiple: Side = 14,
    mean: Colour = IMAGENET_MEAN,
    std: Deviation = IMAGENET_STD,
    tiles: Annotated[int, Ge(1), Le(16)] = 1,
) -> Depth:
    """Planar depth of one photograph in metres, by a network that was trained for it.

    Parameters
    ----------
    image : (H, W, 3) float; values outside [0, 1] count as the nearest bound.
    model : Path of the ONNX file. It takes (1, 3, height, width) float32 and its first output is a map.
    sha256 : Digest that the file must have, as in :func:`relative_depth`.
    encoding : What the numbers of the image mean: ``"linear"`` light or ``"display"`` values.
    unit : Metres that a value of 1 stands for.
    far : Depth from which a point counts as sky, infinitely far; none for no sky.
    side : Shorter side of what the network sees, pixels, unless the model fixes the size.
    multiple : Both sides are multiples of this.
    mean, std : Display values are normalised to (value − mean) / std.
    tiles : Tiles along each side; the depth of tiles is blended as it is.

    Returns
    -------
    (H, W) float32, or float64 for a float64 image, metres along the optical axis; negative values count as 0.

    Raises
    ------
    ValueError
        As for :func:`relative_depth`.

    References
    ----------
    Yang et al. 2024, *Depth Anything V2*, the metric models.
    """
    found = _predicted(image, model, sha256, encoding, side, multiple, mean, std, tiles, align=False)
    depth = np.float32(unit) * np.maximum(found, 0)
    if far is not None:
        depth[depth >= far] = np.inf
    return depth.astype(np.result_type(image, np.float32))


def _predicted(
    image: Image,
    model: str,
    sha256: str | None,
    encoding: Encoding,
    side: int,
    multiple: int,
    mean: Colour,
    std: Deviation,
    tiles: int,
    *,
    align: bool,
) -> network.Map:
    require_maps(image=(image, 3))
    if not np.isfinite(image).all():
        raise ValueError("image holds NaN or infinite values; fill them first.")
    display = np.clip(image, 0, 1).astype(np.float32)
    if encoding == "linear":
        display = srgb_from_linear(display)
    opened = network.session(model, sha256)
    centre, spread = np.array(mean, np.float32), np.array(std, np.float32)
    return network.tiled(
        lambda part: network.predict(opened, part, side, multiple, centre, spread), display, tiles, align
    )
