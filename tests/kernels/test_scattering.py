"""Point spread functions: the series against many digits, the table against photons, and weights of pixels."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest

from fogpipe.bench.photons import borders, energies, misplaced
from fogpipe.kernels import bands
from fogpipe.kernels.scattering import measured, profiles
from fogpipe.kernels.scattering.legendre import coefficients, number_of_terms, series
from fogpipe.kernels.scattering.pixels import period_sum, weights

COSINES = (-1.0, -0.8125, -0.25, 0.0, 0.5, 0.9375, 1.0)
"""Binary fractions, the same number in both arithmetics."""


def series_with_50_digits(q: float, thickness: float, mu: float, terms: int) -> float:
    """T²·I as the formula has it, term by term in decimal arithmetic."""
    with localcontext(prec=50):
        q_, t, x = Decimal(q), Decimal(thickness), Decimal(mu)

        def g(m: int) -> Decimal:
            if m == 0:
                return Decimal(0)
            beta = Decimal(2 * m + 1) / m * (1 - (q_ ** (m - 1) if m > 1 else 1))
            return (-beta * t - (m + 1) * t.ln()).exp()

        total, before, now, here = Decimal(0), Decimal(1), x, g(0)
        for m in range(terms):
            polynomial = before if m == 0 else now
            following = g(m + 1)
            total += (here + following) * polynomial
            here = following
            if m > 0:
                before, now = now, ((2 * m + 1) * x * now - m * before) / (m + 1)
        return float(total * t * t)


@pytest.mark.parametrize(
    ("q", "thickness"), [(0.0, 1.2), (0.2, 4.0), (0.7, 1.05), (0.9, 1.2), (0.95, 2.0), (0.99, 50.0)]
)
def test_the_series_is_right_to_ten_digits(q, thickness):
    # Twice the terms, so that the reference has no share in the bound that chose their number.
    terms = 2 * number_of_terms(q, thickness, 1e-11)
    exact = [series_with_50_digits(q, thickness, mu, terms) for mu in COSINES]
    np.testing.assert_allclose(series(q, thickness, np.array(COSINES), 1e-11), exact, rtol=0, atol=1e-10)


@pytest.mark.parametrize("thickness", [1.002, 1.01, 1.2, 4.0, 50.0])
@pytest.mark.parametrize("q", [0.0, 0.9, 0.999, 1.0])
def test_the_series_has_a_spherical_mean_of_1_and_vanishes_straight_backwards(q, thickness):
    # P_0 alone has a mean, and its factor is T² (g_0 + g_1) = 1; Gauss's rule is exact up to twice its order.
    terms = number_of_terms(q, thickness, 1e-10)
    if terms < 2000:
        nodes, parts = np.polynomial.legendre.leggauss(terms // 2 + 2)
        assert series(q, thickness, nodes) @ parts / 2 == pytest.approx(1, abs=1e-10)
    assert coefficients(q, thickness, 2)[1] == 1
    # At µ = −1 the sum telescopes; what is left is the term after the last one, and rounding of each term.
    assert abs(series(q, thickness, np.array([-1.0]))[0]) < 1e-9


def test_the_tail_bound_is_a_bound_and_not_a_wasteful_one():
    for q, thickness in ((0.0, 1.05), (0.9, 1.2), (0.9, 2.0)):
        terms = number_of_terms(q, thickness, 1e-6)
        g = coefficients(q, thickness, 20_000)
        rest = np.cumsum((g[:-1] + g[1:])[::-1])[::-1]  # at µ = 1, where every P_m is 1
        assert rest[terms] <= 1e-6
        needed = int(np.argmax(rest <= 1e-6))
        assert terms <= 1.6 * needed + 10


@pytest.mark.parametrize("thickness", [1.0, 0.7, 0.0, -1.0, np.nan, np.inf])
def test_the_series_is_refused_where_it_diverges(thickness):
    with pytest.raises(ValueError, match=r'above 1, not .* Use the kernel "gaussian" or scattering.blur'):
        profiles.legendre(0.9, thickness)


def test_a_thickness_that_is_hardly_above_1_is_refused_with_the_number_of_terms():
    with pytest.raises(ValueError, match=r"more than 200000 terms at an optical thickness of 1\.00000"):
        profiles.legendre(0.9, 1 + 1e-6)


@pytest.mark.parametrize("thickness", [0.1, 0.5, 1.0, 1.2, 4.0, 50.0])
@pytest.mark.parametrize("q", [0.01, 0.5, 0.9, 0.99])
def test_a_generalised_gaussian_falls_and_holds_all_its_energy(q, thickness):
    profile = profiles.generalised_gaussian(q, thickness)
    radiance = profile[1:] / np.sin(profiles.ANGLES[1:])
    assert (np.diff(radiance) <= 1e-12 * radiance[0]).all()  # rounding
    assert profiles.energy(profile) == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize(("q", "thickness"), [(0.0, 1.0), (1.0, 1.0), (0.5, 0.0)])
def test_a_generalised_gaussian_without_a_width_is_refused(q, thickness):
    with pytest.raises(ValueError, match="must be above 0"):
        profiles.generalised_gaussian(q, thickness)


# At entries of the table and between them, and with other random numbers than the table was made with.
@pytest.mark.parametrize(
    ("q", "thickness"),
    [(0.9, 1.2), (0.9, 2.0), (0.9, 4.0)]
    + [(q, thickness) for q in (0.0, 0.3, 0.65, 0.94, 0.98) for thickness in (0.1, 0.85, 3.3, 8.0)],
)
def test_the_table_has_the_shape_of_photons(q, thickness):
    angles = borders(60)
    truth = energies(q, thickness, 300_000, angles, seed=1)
    shape = profiles.energy_between(measured.profiles(q, np.array(thickness))[0], angles)
    assert misplaced(shape, truth) <= 0.02  # of which 0.6 % are the noise of these photons


def test_the_series_is_far_too_wide():
    angles = borders(60)
    truth = energies(0.9, 1.2, 300_000, angles)
    shape = profiles.energy_between(profiles.legendre(0.9, 1.2), angles)
    assert 0.6 < misplaced(shape, truth) < 0.66


def test_photons_do_not_depend_on_the_number_of_threads():
    before = bands.threads()
    found = []
    for count in (1, 2):
        bands.set_threads(count)
        found.append(energies(0.8, 1.5, 300_000, borders()))
    bands.set_threads(before)
    assert found[0].tobytes() == found[1].tobytes()


def test_photons_scattered_once_by_a_thin_isotropic_fog_are_known():
    # ∫ ds / r² along the chord is the angle that it fills at the centre, π − 2θ, over T sin θ: p ∝ π − 2θ.
    angles = borders(40)
    exact = np.diff(1 - (1 - 2 * angles / np.pi) ** 2)
    found = energies(0.0, 0.001, 1_000_000, angles)
    # Noise 0.2 %, and a thousandth of the light scatters twice.
    assert misplaced(found, exact) < 0.005
    shape = profiles.energy_between(measured.profiles(0.0, np.array(0.001))[0], angles)
    assert misplaced(shape, exact) < 0.01  # the table ends at T = 0.02


@pytest.mark.parametrize("q", [0.0, 0.5, 0.9, 0.99])
def test_kernels_are_nowhere_negative_and_grow_wider_with_thickness(q):
    found = measured.profiles(q, np.geomspace(0.01, 100, 40))
    assert (found >= 0).all()
    np.testing.assert_allclose(profiles.energy(found), 1, rtol=1e-12)
    inner = np.array([profiles.energy_between(profile, np.radians([0, 10]))[0] for profile in found])
    # The share within 10° falls, but for the noise of the table; beyond both its ends it stays.
    assert (np.diff(inner) < 0.005).all()
    assert inner[0] == inner[1]
    assert inner[-1] == inner[-2]


@pytest.mark.parametrize("q", [-0.1, 0.991, 1.0, np.nan])
def test_an_asymmetry_outside_the_table_is_refused(q):
    with pytest.raises(ValueError, match=r"asymmetry must be in \[0, 0.99\]"):
        measured.profiles(q, np.array([1.0]))


@pytest.mark.parametrize("focal", [0.01, 0.5, 3.0, 40.0, 3000.0])
@pytest.mark.parametrize("size", [(20, 30), (1, 50), (1, 1)])
def test_weights_hold_all_of_the_energy(focal, size):
    for profile in (measured.profiles(0.9, np.array(1.0))[0], profiles.legendre(0.9, 1.2)):
        quadrant, beyond = weights(profile, focal, *size)
        assert period_sum(quadrant) + beyond == pytest.approx(1, rel=1e-12)
        assert 0 <= beyond <= 1
        assert quadrant.min() >= -1e-6  # the series is below 0 by rounding, where it is below 1e-6 of its peak


def gauss(low, high, parts):
    """Places and shares of Gauss's rule with 16 places in each part."""
    places, shares = np.polynomial.legendre.leggauss(16)
    half = (high - low) / parts / 2
    middles = low + half * np.arange(1, 2 * parts, 2)
    return (middles[:, None] + half * places).ravel(), np.tile(half * shares, parts)


def integral_over_pixel(profile, focal, y, x):
    """Energy in one pixel, in polar coordinates for the pixel in the middle, where they have no cusp."""

    def radiance(r):
        angle = np.arctan(r / focal)
        return np.interp(angle, profiles.ANGLES, profile) / np.sin(angle) * np.cos(angle) ** 3 / focal**2

    if x == y == 0:
        azimuths, turns = gauss(0, np.pi / 4, 4)
        roots, steps = gauss(0, 1, 400)  # r ∝ root², dense where the angles of the profile are
        reach = 0.5 / np.cos(azimuths)[:, None]
        r = reach * roots**2
        return 8 * turns @ (radiance(r) * r * reach * 2 * roots) @ steps
    rows, heights = gauss(y - 0.5, y + 0.5, 20)
    columns, widths = gauss(x - 0.5, x + 0.5, 20)
    return heights @ radiance(np.hypot(rows[:, None], columns)) @ widths


@pytest.mark.parametrize("focal", [60.0, 340.0, 1400.0])
@pytest.mark.parametrize(("q", "thickness"), [(0.9, 0.1), (0.9, 4.0), (0.0, 8.0), (0.98, 1.0)])
def test_weights_are_integrals_over_pixels(q, thickness, focal):
    profile = measured.profiles(q, np.array(thickness))[0]
    quadrant, _ = weights(profile, focal, 40, 40)
    for y, x in ((0, 1), (1, 1), (1, 4), (0, 5), (7, 0), (20, 11), (12, 11), (39, 30)):
        # Parts of r/24 and a profile that is r⁻⁴ at the steepest: (1/24)²/24 · 4² = 0.1 %.
        assert quadrant[y, x] == pytest.approx(integral_over_pixel(profile, focal, y, x), rel=1e-3)
    # What the rule misses of all other pixels goes to the one in the middle.
    middle = integral_over_pixel(profile, focal, 0, 0)
    assert quadrant[0, 0] == pytest.approx(middle, abs=1e-3 * (1 - middle))
