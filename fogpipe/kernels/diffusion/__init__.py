"""Inhomogeneous diffusion of an RGBA layer to a blur scale that varies over the image: Hansard 2019, eq. 8.

To add a solver, write a function that takes a layer (H, W, 4), the wanted standard deviation σ(x) in pixels (H, W), the
standard deviation σ0 that the layer has already, the largest rate ρmax of a published step and the tolerance, and name
it in :data:`SOLVERS`. No light crosses the border of the image.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion.choice import auto, reference
from fogpipe.kernels.diffusion.implicit import adi
from fogpipe.kernels.diffusion.mipmap import mipmap
from fogpipe.kernels.diffusion.published import euler, fed, invariant, invariant_corrected

Solver = Callable[[np.ndarray, np.ndarray, float, float, float], FloatArray]

SOLVERS: dict[str, Solver] = {
    "auto": lambda layer, scale, finest, max_rate, tolerance: auto(layer, scale, finest, tolerance),
    "invariant": lambda layer, scale, finest, max_rate, tolerance: invariant(layer, scale, finest, max_rate),
    "invariant-corrected": lambda layer, scale, finest, max_rate, tolerance: invariant_corrected(
        layer, scale, finest, max_rate
    ),
    "euler": lambda layer, scale, finest, max_rate, tolerance: euler(layer, scale, finest, max_rate),
    "fed": lambda layer, scale, finest, max_rate, tolerance: fed(layer, scale, finest, max_rate),
    "adi": lambda layer, scale, finest, max_rate, tolerance: adi(layer, scale, finest),
    "mipmap": lambda layer, scale, finest, max_rate, tolerance: mipmap(layer, scale, finest),
    "reference": lambda layer, scale, finest, max_rate, tolerance: reference(layer, scale, finest),
}
"""Solvers by the name that the stage gives them."""
