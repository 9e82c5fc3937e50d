"""The brightest even colour that other things in the picture fade into."""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray

WIDTH = 160
"""Pixels along the longer side of the reduced picture that is searched, in which there is little noise."""
EVEN = 0.03
"""Largest standard deviation in 3 × 3 pixels, as a share of their colour, of what may be airlight."""
CELL = 0.06
"""Two even colours nearer than this are taken together, as a share of the brightest."""
NEAR, FAR = 0.05, 0.12
"""How far, as a share of the airlight, the colours are that are on their way to it."""
LEAST = 0.001
"""Smallest share of the reduced picture that is a candidate."""
SIZE_MATTERS = 0.2
"""Power of the share of the picture that has the colour: a sky of ten times the size may be a third darker."""


def colour_faded_into(image: np.ndarray, fading: float) -> FloatArray:
    """Pixels (count, 3) of the reduced picture that show the airlight; all of them where nothing is even.

    Each even colour scores its dark channel times the power 0.2 of the share of the picture that has it, times
    the share that is on its way to it up to ``fading``, above which more says no more. The highest score wins.

    Parameters
    ----------
    image : (H, W, 3) float.
    fading : Share of the picture on its way to a colour that is evidence enough.
    """
    small = reduced(image)
    pixels, even = small.reshape(-1, 3), is_even(small, EVEN).reshape(-1)
    best, most = pixels, -1.0
    for members in _groups(pixels, even):
        colour = np.median(pixels[members], axis=0)
        apart = pixels - colour
        distance = np.sqrt(np.einsum("pc,pc->p", apart, apart)) / max(np.linalg.norm(colour), 1e-6)
        evidence = min(np.mean((distance >= NEAR) & (distance < FAR)) / fading, 1)
        score = colour.min() * np.mean(distance < NEAR) ** SIZE_MATTERS * evidence
        if score > most:
            best, most = pixels[members], score
    return best


def reduced(image: np.ndarray) -> FloatArray:
    """A picture of at most ``WIDTH`` pixels along its longer side, float32 of 0 or more."""
    import cv2

    factor = min(1.0, WIDTH / max(image.shape[:2]))
    size = tuple(max(1, round(factor * side)) for side in image.shape[1::-1])
    small = cv2.resize(np.asarray(image, np.float32), size, interpolation=cv2.INTER_AREA)
    return np.maximum(small.reshape(size[1], size[0], 3), 0)


def is_even(small: FloatArray, deviation: float) -> np.ndarray:
    """Where the standard deviation in 3 × 3 pixels is at most that share of their colour."""
    import cv2

    mean = cv2.blur(small, (3, 3))
    variance = np.maximum(cv2.blur(small**2, (3, 3)) - mean**2, 0).sum(axis=2)
    return variance <= deviation**2 * (mean**2).sum(axis=2)


def _groups(pixels: FloatArray, even: np.ndarray) -> list[np.ndarray]:
    """Places of the even pixels, by colour."""
    if not even.any():
        return []
    cell = max(CELL * float(pixels[even].max()), 1e-6)
    red, green, blue = np.floor(pixels[even] / cell).astype(np.int64).T
    side = int(1 / CELL) + 2
    _, label = np.unique((red * side + green) * side + blue, return_inverse=True)
    places = np.flatnonzero(even)
    groups = [places[label == number] for number in range(label.max() + 1)]
    return [group for group in groups if group.size >= LEAST * even.size]
