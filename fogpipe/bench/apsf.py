"""Atmospheric point spread functions: how true their shapes are, and time against error of blur that follows the fog.

Shapes are held against a Monte Carlo of photons (:mod:`fogpipe.bench.photons`); their error is the share of the
light that is at the wrong angle. The yardstick of time is one FFT convolution by SciPy of the same
float32 RGBA frame with one kernel of the size of the frame, and the reference is the same sum of kernels in float64
with a tolerance of 1e-7, or on a small frame the sum over all pairs of pixels.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from fogpipe.bench.blur import premultiplied, rms
from fogpipe.bench.photons import borders, energies, misplaced
from fogpipe.bench.table import Row
from fogpipe.bench.timing import alternating
from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import threads
from fogpipe.kernels.scattering import measured, profiles
from fogpipe.kernels.scattering.convolution import Form
from fogpipe.kernels.scattering.pixels import weights
from fogpipe.kernels.scattering.varying import by_thickness

FOG = 0.9
THICKEST = 4.0
FORMS: tuple[Form, ...] = ("scatter", "gather")
TOLERANCES = (1e-2, 3e-3, 1e-3, 1e-4)
YARDSTICK = "scipy.signal.fftconvolve with one kernel of the size of the frame"


def measure(quick: bool) -> Iterator[Row]:
    """Shapes against photons, then time against error on two frames, and a small frame against the direct sum."""
    for q in (0.9,) if quick else (0.0, 0.5, 0.7, 0.85, 0.9, 0.95):
        for thickness in (1.2, 2.0, 4.0) if quick else (0.1, 0.5, 1.2, 2.0, 4.0, 8.0):
            yield from shapes(q, thickness, 300_000 if quick else 3_000_000)
    # Small frames show what a call costs at any size.
    for height, width in ((280, 400),) if quick else ((280, 400), (1120, 1600)):
        for name in ("motorcycle", "outdoor:640x400" if quick else "outdoor"):
            layer, ratio = premultiplied(name, height, width)
            case = f"{name} {width}×{height}"
            tolerances = TOLERANCES[::2] if quick else TOLERANCES
            yield from against_converged(case, layer, THICKEST * ratio, tolerances, 3)
    yield from against_direct(*premultiplied("motorcycle", *((28, 40) if quick else (42, 60))))


def shapes(q: float, thickness: float, photons: int) -> Iterator[Row]:
    """Share of the light that each kernel puts at a wrong angle of the front hemisphere."""
    angles = borders()
    truth = energies(q, thickness, photons, angles, seed=5)
    kernels: dict[str, Callable[[], FloatArray]] = {"measured": lambda: measured.profiles(q, np.array(thickness))[0]}
    if thickness > 1:
        kernels["series"] = lambda: profiles.legendre(q, thickness)
    if q > 0:
        kernels["gaussian"] = lambda: profiles.generalised_gaussian(q, thickness)
    for way, make in kernels.items():
        started = time.perf_counter()
        profile = make()
        seconds = time.perf_counter() - started
        share = profiles.energy_between(profile, angles)
        own, true = half_angle(share, angles), half_angle(truth, angles)
        yield Row(
            f"shape, q {q:g}, T {thickness:g}",
            way,
            seconds,
            error=misplaced(share, truth),
            note=f"error: share at a wrong angle; half of the light within {own:.1f}°, of the photons {true:.1f}°",
        )


def half_angle(shares: FloatArray, angles: FloatArray) -> float:
    """Angle in degrees within which half of the energy arrives."""
    return float(np.degrees(np.interp(0.5, np.append(0, np.cumsum(shares)), angles)))


def against_converged(
    case: str, layer: FloatArray, thickness: FloatArray, tolerances: Sequence[float], repeats: int
) -> Iterator[Row]:
    """The fast solver in both forms, at several tolerances."""
    planes, focal = planes_of(layer), 0.866 * layer.shape[1]
    ways: dict[str, Callable[[], FloatArray]] = {YARDSTICK: partial(one_kernel, layer, focal)}
    for form in FORMS:
        for tolerance in tolerances:
            way = partial(by_thickness, planes, thickness, FOG, focal, form, tolerance)
            ways[f"{form} {tolerance:g}"] = way
    times = alternating(ways, repeats)
    double, thickness64 = planes.astype(np.float64), thickness.astype(np.float64)
    exact = {form: by_thickness(double, thickness64, FOG, focal, form, 1e-7) for form in FORMS}
    for way, call in ways.items():
        if way == YARDSTICK:
            yield Row(case, "one kernel for all", times[way], 1.0, YARDSTICK)
            continue
        difference = call() - exact["scatter" if way.startswith("scatter") else "gather"]
        largest = float(np.abs(difference).max())
        yield Row(case, way, times[way], times[way] / times[YARDSTICK], YARDSTICK, rms(difference), largest)


def against_direct(layer: FloatArray, ratio: FloatArray) -> Iterator[Row]:
    """A small frame against the sum over all pairs of pixels."""
    planes, focal, thickness = planes_of(layer), 0.866 * layer.shape[1], THICKEST * ratio
    for form in FORMS:
        started = time.perf_counter()
        exact = by_thickness(planes, thickness, FOG, focal, form, exact=True)
        slow = time.perf_counter() - started
        for tolerance in TOLERANCES:
            started = time.perf_counter()
            difference = by_thickness(planes, thickness, FOG, focal, form, tolerance) - exact
            seconds = time.perf_counter() - started
            largest = float(np.abs(difference).max())
            ratio_to = seconds / slow
            case = f"direct, {layer.shape[1]}×{layer.shape[0]}"
            yield Row(case, f"{form} {tolerance:g}", seconds, ratio_to, "the direct sum", rms(difference), largest)


def planes_of(layer: FloatArray) -> FloatArray:
    """(C, H, W) planes of an (H, W, C) layer."""
    return np.ascontiguousarray(layer.transpose(2, 0, 1))


def one_kernel(layer: FloatArray, focal: float) -> FloatArray:
    """The frame with the kernel of one thickness, cropped to the size of the frame, for its time."""
    from scipy import fft, signal

    height, width = layer.shape[:2]
    quadrant, _ = weights(measured.profiles(FOG, np.array(2.0))[0], focal, height // 2, width // 2)
    kernel = np.pad(quadrant.astype(np.float32), ((height // 2, 0), (width // 2, 0)), mode="reflect")
    with fft.set_workers(threads()):
        return signal.fftconvolve(layer, kernel[..., None], mode="same", axes=(0, 1))
