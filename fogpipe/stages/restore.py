"""Scenes behind haze: the haze equation read backwards once airlight and transmission are known."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Gt, Le

from fogpipe.kernels.arrays import require_finite
from fogpipe.ports import Airlight, Image, Transmission
from fogpipe.stage import stage

Floor = Annotated[float, Gt(0), Le(1)]


@stage("restore.invert")
def invert(
    image: Image, airlight: Airlight, transmission: Transmission, *, floor: Floor = 0.1, clip: bool = True
) -> Image:
    """Plain inversion of the haze equation, L = B + (I − B) / max(t, t0).

    Parameters
    ----------
    image : (H, W, 3) float, the hazy image I.
    airlight : (3,) or (H, W, 3) float, B.
    transmission : (H, W) float, t in [0, 1].
    floor : t0. Noise of the image is multiplied by 1 / t, so at most by 1 / t0; haze thicker than that stays in part.
    clip : Limit the result to [0, 1], what a display shows. Without it noise below black and above white
        survives, as do the values of an HDR image.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image.

    Raises
    ------
    ValueError
        If the image or airlight is not finite, the transmission is unknown (NaN) somewhere, or the sizes differ.

    Notes
    -----
    One pass, about 1.5 ns per pixel. It is the exact inverse of ``composite.naive`` where t ≥ t0.

    References
    ----------
    Yan, Xu and Jia 2013, *Dense scattering layer removal*, eq. 2; t0 after He, Sun and Tang 2009, eq. 16.
    """
    from fogpipe.kernels.dehazing import model

    require_finite(image=image, airlight=airlight, transmission=transmission)
    scene = model.invert(image, airlight, transmission, floor)
    return np.clip(scene, 0, 1, out=scene) if clip else scene
