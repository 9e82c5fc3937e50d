"""How bright the airlight is from one place of a picture to another, read off the sky."""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.dehazing.fading import is_even, reduced

EVEN = 0.012
"""Largest standard deviation of sky in 3 × 3 pixels of the reduced picture, as a share of their colour. The edge of
hills in haze is stronger; with 0.03 they would count as sky, and keep their haze."""
HUE = 0.02
"""How far the hue of sky is from that of the airlight, as a share of its colour."""
DARKEST, BRIGHTEST = 0.6, 1.4
"""Of the airlight, that sky may be."""
SAME = 0.05
"""How near the brightness of some of it has to be."""
LEAST = 0.02
"""Share of the picture. Less is no sky, but a patch of a wall."""
WIDTHS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Of the blurs, pixels of the reduced picture, whose sum takes what is known to where nothing is."""
UNKNOWN = 0.002
"""Weight of the mean brightness, 1, against the density of the sky around."""
SMOOTH = 1.5
"""Of a last blur, pixels of the reduced picture."""


def light(image: np.ndarray, airlight: FloatArray) -> FloatArray | None:
    """Brightness of the airlight over that of ``airlight`` (3,), as (H, W); None for a picture that shows no sky.

    Sky is what is even, of the hue of the airlight, and joined to some of its brightness by pixels that are both.
    Elsewhere the brightness is a mean of that of the sky, in which near sky counts most, and of 1.
    """
    import cv2

    small, power = reduced(image), airlight @ airlight
    if power <= 0:
        return None
    brightness = small @ airlight / power
    off = np.linalg.norm(small - brightness[..., None] * airlight, axis=2)
    sky = is_even(small, EVEN) & (off < HUE * brightness * np.sqrt(power))
    sky &= (brightness > DARKEST) & (brightness < BRIGHTEST)
    _, parts = cv2.connectedComponents(sky.astype(np.uint8), connectivity=4)
    sky &= np.isin(parts, parts[sky & (np.abs(brightness - 1) < SAME)])
    if sky.mean() < LEAST:
        return None
    weight = sky.astype(np.float32)
    seen, density = _spread(weight * brightness.astype(np.float32)), _spread(weight)
    known = cv2.GaussianBlur((seen + UNKNOWN) / (density + UNKNOWN), (0, 0), SMOOTH)
    return cv2.resize(known, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)


def _spread(values: FloatArray) -> FloatArray:
    import cv2

    total = np.zeros_like(values)
    for width in WIDTHS:
        total += cv2.GaussianBlur(values, (0, 0), width, borderType=cv2.BORDER_CONSTANT)
    return total
