"""The Motorcycle of the Middlebury 2014 stereo benchmark, as scikit-image ships it."""

from __future__ import annotations

import numpy as np

from fogpipe.io.camera import CameraFile
from fogpipe.io.samples import SampleFrame
from fogpipe.kernels.rays import planar_to_radial

BASELINE, DOFFS = 0.193001, 31.086
CAMERA = CameraFile(
    matrix=np.array([[994.978, 0, 311.193], [0, 994.978, 254.877], [0, 0, 1]]),
    baseline=BASELINE,
    doffs=DOFFS,
    size=(741, 500),
    source="Middlebury calibration at quarter size",
)
"""The public calibration of the left camera at a quarter of the original size, as scikit-image documents it [1]_.

.. [1] D. Scharstein et al., "High-resolution stereo datasets with subpixel-accurate ground truth", GCPR 2014.
"""


def motorcycle() -> SampleFrame:
    """The left image, 741×500, and its range from the true disparity d: ``Z = baseline·fx/(d + doffs)``.

    Planar depths are 2.11 to 5.02 m. Disparities that scikit-image's file marks as undefined (+inf) are real
    holes of the measurement, 7.3 % of the pixels, and become NaN. Needs no download.
    """
    from skimage.data import stereo_motorcycle

    left, _, disparity = stereo_motorcycle()
    depth = BASELINE * CAMERA.matrix[0, 0] / (disparity.astype(np.float64) + DOFFS)
    depth[~np.isfinite(disparity)] = np.nan
    range_map = planar_to_radial(depth, CAMERA.matrix).astype(np.float32)
    return SampleFrame(left, range_map, CAMERA)
