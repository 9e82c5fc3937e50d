"""What the sample scene's surfaces look like: reflectance of painted solids and of the ground, radiance of the sky.

Reflectance is linear, in red, green and blue, chosen by eye in the range of real surfaces. Lengths are metres.
"""

from __future__ import annotations

import math

from numba import njit

from fogpipe.kernels.raycast import dot
from fogpipe.kernels.texture import fractal_noise, hash01, value_noise

PLAIN, LEAF, GLASS, LAMP, TILES, PLASTER, SIGN = range(7)


@njit(nogil=True, cache=True, error_model="numpy")
def surface_albedo(kind, colour, p, u, v, eye):
    """Reflectance of a surface: its tint under a pattern in metres on the surface (u, v) or in space (p)."""
    shade = 0.86 + 0.28 * value_noise(3.1 * (p[0] + p[2]), 3.1 * p[1] + 1.7 * p[2])
    if kind == TILES:
        row = math.floor(v / 0.22)
        tile = math.floor(u / 0.2 + 0.5 * (row % 2))
        edge = (v / 0.22) % 1.0
        shade = (0.72 + 0.5 * hash01(int(tile), int(row))) * (0.78 + 0.3 * edge)
    elif kind == PLASTER:
        along = p[0] + p[2]
        stains = fractal_noise(0.55 * along, 0.35 * p[1], 4)
        shade = (0.8 + 0.32 * stains) * (0.94 + 0.12 * value_noise(40 * along, 40 * p[1]))
        shade *= min(1.0, 0.72 + 0.6 * (p[1] + eye))  # splashes at the foot
    elif kind == SIGN:
        if 0.27 < math.hypot(u - 0.35, v - 0.35) < 0.338:
            return (0.55, 0.02, 0.025)
        return (0.03, 0.03, 0.03) if _thirty(u - 0.35, v - 0.35) else (0.8, 0.8, 0.8)
    return (colour[0] * shade, colour[1] * shade, colour[2] * shade)


@njit(nogil=True, cache=True, error_model="numpy")
def _thirty(x, y):
    """Whether a point of the sign is on the digits 30: two half rings and one ring."""
    zero = 0.75 < math.hypot((x - 0.1) / 0.075, y / 0.135) < 1.3
    bow = math.hypot((x + 0.13) / 0.085, (abs(y) - 0.068) / 0.068)
    return zero or (0.62 < bow < 1.25 and (x > -0.14 or abs(y) > 0.1))


@njit(nogil=True, cache=True, error_model="numpy")
def ground_albedo(x, z, road):
    """Asphalt with markings, a gravel shoulder with a ragged edge, grass, and fields beyond."""
    step = min(max(z, 0.0), road.size - 1.001)
    whole = int(step)
    centre = road[whole] + (step - whole) * (road[whole + 1] - road[whole])
    across = x - centre
    side = abs(across)
    near = 1 / (1 + (z / 28) ** 2)
    if side > 3.1 + 0.35 * (value_noise(2.3 * x, 2.3 * z) - 0.5):
        return _meadow_albedo(x, z, side, near)
    grain = 1 + 0.5 * near * (value_noise(70 * x, 70 * z) - 0.5)
    wear = fractal_noise(0.35 * across + 3, 0.06 * z, 3)
    tracks = 0.055 * math.exp(-(((side - 1.6) / 0.42) ** 2))
    shade = (0.135 + 0.06 * (wear - 0.5) - 0.4 * tracks) * grain
    crack = abs(fractal_noise(0.4 * x + 11, 0.4 * z, 5) - 0.5)
    if crack < 0.0022 and wear > 0.45:
        shade *= 1 - 0.45 * near
    dash = z % 9.0 < 3.6
    if (side < 0.065 and dash) or abs(side - 2.82) < 0.065:
        scuffed = value_noise(19 * x, 19 * z) * 0.6 + value_noise(5 * x, 3 * z) * 0.4
        paint = 0.62 if scuffed > 0.27 else 0.32
        return (paint, paint, 0.96 * paint)
    return (1.02 * shade, shade, 0.97 * shade)


@njit(nogil=True, cache=True, error_model="numpy")
def _meadow_albedo(x, z, side, near):
    blades = 1 + (0.25 + 0.75 * near) * (value_noise(31 * x, 9 * z) - 0.5) + 0.5 * (value_noise(5.3 * x, 2.1 * z) - 0.5)
    patches = fractal_noise(0.09 * x + 5, 0.05 * z, 4)
    field = fractal_noise(0.013 * x + 40, 0.016 * z + 9, 3)
    dry = min(max((field - 0.52) * 9, 0.0), 1.0) if side > 11 else 0.0
    dry = max(dry, 0.65 * min(max((patches - 0.55) * 5, 0.0), 1.0))
    furrows = 1 + 0.10 * math.sin(1.9 * x + 0.5 * z) * dry
    gravel = min(max((3.75 - side) / 0.5 + 2.2 * (value_noise(6 * x, 6 * z) - 0.5), 0.0), 1.0)
    green = ((0.082 + 0.03 * patches) * blades, (0.128 + 0.03 * patches) * blades, 0.030 * blades)
    straw = (0.30 * blades * furrows, 0.235 * blades * furrows, 0.085 * blades * furrows)
    stones = 0.20 * (0.7 + 0.6 * value_noise(33 * x, 33 * z))
    return (
        (green[0] * (1 - dry) + straw[0] * dry) * (1 - gravel) + stones * gravel,
        (green[1] * (1 - dry) + straw[1] * dry) * (1 - gravel) + 0.93 * stones * gravel,
        (green[2] * (1 - dry) + straw[2] * dry) * (1 - gravel) + 0.80 * stones * gravel,
    )


@njit(nogil=True, cache=True, error_model="numpy")
def sky(d, sun, clouds):
    """Radiance of the sky in direction ``d``: blue above, pale at the horizon, brighter towards the sun, thin cloud."""
    length = math.sqrt(dot(d, d))
    up = max(d[1] / length, 0.0)
    toward = max(dot(d, sun) / length, 0.0)
    pale = math.exp(-5.0 * up)
    glow = 0.30 * toward**6
    red = 0.115 + 0.63 * pale + glow
    green = 0.295 + 0.51 * pale + 0.9 * glow
    blue = 0.62 + 0.28 * pale + 0.7 * glow
    height = up + 0.10
    cx = 1.5 * d[0] / length / height + clouds[0]
    cy = 1.5 * d[2] / length / height + clouds[1]
    warp = 0.9 * fractal_noise(0.8 * cx + 3, 0.8 * cy + 8, 4)
    cover = fractal_noise(0.6 * cx + warp + 1.7, 0.95 * cy + warp, 7)
    cloud = min(max((cover - 0.55) * 4.5, 0.0), 1.0)
    cloud = cloud * cloud * (3 - 2 * cloud) * 0.9 * min(1.0, 8 * up)
    white = 0.86 - 0.55 * max(cover - 0.6, 0.0)
    return (
        red + cloud * (1.06 * white - red),
        green + cloud * (1.02 * white - green),
        blue + cloud * (1.02 * white - blue),
    )
