"""Limits of the drag laws: a lone sphere in creeping flow, a packed bed, and what happens between them."""

from math import exp, log10, pi

import numpy as np
import pytest

from sim.drag import BLENDED, BLENDING, DENSE, DI_FELICE, DRAG_LAWS, ERGUN_WEN_YU, drag_coefficient

DIAMETER, DENSITY, VISCOSITY = 1e-3, 1.2, 1.8e-5
VOLUME = pi / 6 * DIAMETER**3
STOKES = 3 * pi * VISCOSITY * DIAMETER  # kg/s
VOIDS = [0.2, 0.4, 0.6, 0.75, 0.8, 0.85, 0.9, 1.0]
SLIPS = [0.0, 1e-9, 1e-3, 0.1, 10.0]


def kappa(law, slip, void):
    """Force for each m/s of slip, kg/s."""
    return drag_coefficient(law, slip, DIAMETER, void, DENSITY, VISCOSITY)


def slip_at(re, void=1.0):
    """Slip (m/s) of a Reynolds number."""
    return re * VISCOSITY / (DENSITY * DIAMETER * void)


def drag_number(law, re):
    """C_D Re of a lone sphere, from κ = C_D π/8 d² ρ |u|."""
    return kappa(law, slip_at(re), 1.0) * 8 / (pi * DIAMETER * VISCOSITY)


@pytest.mark.parametrize("law", [ERGUN_WEN_YU, BLENDED])
def test_lone_sphere_in_creeping_flow_feels_stokes_drag(law):
    """κ → 3πμd and C_D Re → 24, departing from it as 0.15 Re^0.687 does; at rest exactly so."""
    assert kappa(law, 0.0, 1.0) == pytest.approx(STOKES, rel=1e-14)
    for re in (1e-12, 1e-8, 1e-4):
        assert drag_number(law, re) / 24 - 1 == pytest.approx(0.15 * re**0.687, rel=1e-3, abs=1e-14)


def test_lone_sphere_in_fast_flow_has_the_drag_coefficient_of_newton():
    for re in (1001.0, 1e5):
        assert drag_number(ERGUN_WEN_YU, re) / re == pytest.approx(0.44, rel=1e-12)
    below, above = drag_number(ERGUN_WEN_YU, 1000.0), drag_number(ERGUN_WEN_YU, 1000.0 * (1 + 1e-12))
    print(f"\nC_D falls by {1 - above / below:.1%} at Re 1000")
    assert above == pytest.approx(below, rel=0.01)


def test_crowd_of_spheres_slows_the_fluid_by_the_power_of_wen_and_yu():
    for void in (0.81, 0.9, 0.99):
        assert kappa(ERGUN_WEN_YU, 0.0, void) == pytest.approx(STOKES * void**-2.65, rel=1e-13)


@pytest.mark.parametrize("void", [0.2, 0.4, 0.451335, 0.8])
@pytest.mark.parametrize("slip", SLIPS)
def test_packed_spheres_resist_as_ergun_measured(slip, void):
    """∇p = β |u − v| / ε of fixed spheres: 150 μ (1−ε)²/ε³ U/d² + 1.75 ρ (1−ε)/ε³ U²/d at U = ε |u − v|."""
    beta = kappa(ERGUN_WEN_YU, slip, void) * (1 - void) / VOLUME
    speed = void * slip
    viscous = 150 * VISCOSITY * (1 - void) ** 2 / void**3 * speed / DIAMETER**2
    inertial = 1.75 * DENSITY * (1 - void) / void**3 * speed**2 / DIAMETER
    assert beta * slip / void == pytest.approx(viscous + inertial, rel=1e-13)


def test_published_beds_have_the_pressure_drops_of_their_table():
    """ε 0.451335 and 15.6 mm of 1 mm beads in a fluid of 10 kg/m³, 1.5e-4 m²/s: 23.0, 115.1, 230.5 Pa."""
    for speed, drop in ((0.002, 23.0), (0.01, 115.1), (0.02, 230.5)):
        slip = speed / 0.451335
        beta = drag_coefficient(ERGUN_WEN_YU, slip, 1e-3, 0.451335, 10.0, 1.5e-3) * (1 - 0.451335) / VOLUME
        assert beta * slip / 0.451335 * 0.0156 == pytest.approx(drop, abs=0.06)


@pytest.mark.parametrize("slip", SLIPS)
def test_drag_jumps_where_ergun_hands_over_to_wen_and_yu_unless_it_is_blended(slip):
    def jump(law, void):
        return kappa(law, slip, void + 1e-12) / kappa(law, slip, void) - 1

    print(f"\nslip {slip:g} m/s: at a void fraction of {DENSE} drag jumps by {jump(ERGUN_WEN_YU, DENSE):+.1%}")
    assert abs(jump(ERGUN_WEN_YU, DENSE)) > 0.01
    voids = np.linspace(DENSE - BLENDING, DENSE + BLENDING, 201)
    assert all(abs(jump(BLENDED, void)) < 1e-9 for void in voids)
    low, high = kappa(BLENDED, slip, 0.7), kappa(BLENDED, slip, 0.9)
    assert low == kappa(ERGUN_WEN_YU, slip, 0.7)
    assert high == kappa(ERGUN_WEN_YU, slip, 0.9)


@pytest.mark.parametrize("void", VOIDS)
@pytest.mark.parametrize("re", [1e-2, 1.0, 31.6227766, 1e3, 1e5])
def test_di_felice_is_the_published_formula(re, void):
    """F = C_D π/8 d² ρ (ε |u − v|)² ε^−χ, in which the superficial slip also makes Re."""
    slip = slip_at(re, void)
    coefficient = (0.63 + 4.8 / re**0.5) ** 2
    power = 3.7 - 0.65 * exp(-((1.5 - log10(re)) ** 2) / 2)
    force = coefficient * pi / 8 * DIAMETER**2 * DENSITY * (void * slip) ** 2 * void**-power
    assert kappa(DI_FELICE, slip, void) == pytest.approx(force / slip, rel=1e-12)


@pytest.mark.parametrize("law", DRAG_LAWS.values())
@pytest.mark.parametrize("void", VOIDS)
def test_fluid_that_does_not_slip_leaves_drag_finite_and_positive(law, void):
    """Also at the least void fraction and with a slip of exactly 0, where C_D alone is infinite."""
    at_rest, nearly = kappa(law, 0.0, void), kappa(law, 1e-15, void)
    assert 0 < at_rest < 1e3 * STOKES
    assert nearly == pytest.approx(at_rest, rel=1e-6)


@pytest.mark.parametrize("law", DRAG_LAWS.values())
def test_drag_rises_with_slip_and_with_crowding(law):
    slips = np.geomspace(1e-6, 10, 60)
    slow = slips * DENSITY * DIAMETER / VISCOSITY < 990  # C_D has a small jump at 1000
    for void in VOIDS:
        found = np.array([kappa(law, slip, void) for slip in slips])
        assert (np.diff(found * slips) > 0).all()
        assert law == DI_FELICE or (np.diff(found[slow]) >= 0).all()  # its exponent dips near Re 30: κ falls there
    packed = [kappa(law, 0.1, void) for void in np.linspace(0.2, 0.79, 30)]
    assert (np.diff(packed) < 0).all()
