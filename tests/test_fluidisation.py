"""A bed that a slowly rising stream lifts: its pressure drop stops at its weight, where Ergun's equation says."""

from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

from sim import simulate
from sim.coupled import CoupledSimulation
from sim.start import StartState

pytestmark = pytest.mark.physics

G = 9.81


class Bed:
    """Beads in a column that repeats in x and z, and the stream that fluidises them."""

    def __init__(self, diameter, density, width, count, fluid, viscosity, slow, fast, stiffness, step,
                 fluid_step, settling, ramp):  # fmt: skip
        self.diameter, self.width, self.count, self.slow, self.fast = diameter, width, count, slow, fast
        self.density, self.fluid, self.viscosity = density, fluid, viscosity
        self.stiffness, self.step, self.fluid_step = stiffness, step, fluid_step
        self.settling, self.ramp = settling, ramp
        self.solid = count * pi / 6 * diameter**3 / width**2  # m, height of all beads melted

    def scene(self, scene_of, duration, fast):
        """The bed in a stream that is ramped from the slow speed to a fast one (m/s) over its duration (s)."""
        high = round(2.6 * self.solid / self.diameter) * self.diameter
        corner = [self.width, high, self.width]
        return scene_of(
            seed=1,
            particles=[{"diameter": self.diameter, "density": self.density, "count": self.count}],
            contact={"stiffness": self.stiffness, "restitution": 0.9},
            gravity={"acceleration": [0, -G, 0]},
            time={"duration": duration, "step": self.step},
            output={"interval": 0.005, "precision": "double"},
            filling={"lowest": [0, 0, 0], "highest": [self.width, 1.95 * self.solid, self.width]},
            periodic={"directions": ["x", "z"], "lowest": [0, 0, 0], "highest": corner},
            limits={"max_overlap": 0.1},
            walls=[{"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 1, 0]}]}],
            fluid={
                "density": self.fluid, "viscosity": self.viscosity, "lowest": [0, 0, 0], "highest": corner,
                "cells": [round(x / self.diameter) for x in corner], "velocity": [0, self.slow, 0],
                "step": self.fluid_step,
                "faces": {"-y": {"kind": "inflow", "speed": fast, "start_speed": self.slow, "ramp": duration},
                          "+y": {"kind": "outflow"}},
            },
            drag={"kernel": 1.0},
        )  # fmt: skip

    def run(self, scene_of):
        """Settle dry, then ramp the stream: speeds (m/s), pressure drops (Pa), heights (m), ε in the bed."""
        dry = self.scene(scene_of, self.settling, self.slow)
        contact = dry.contact.model_copy(update={"restitution": 0.5})
        time = dry.time.model_copy(update={"step": None})
        changes = {"fluid": None, "drag": None, "contact": contact, "time": time}
        last = list(simulate(dry.model_copy(update=changes)))[-1]
        rows = []
        n = len(last.position)
        start = StartState(last.position, last.velocity, None, np.full(n, self.diameter / 2), np.zeros(n, int))
        run = CoupledSimulation(self.scene(scene_of, self.ramp, self.fast), start)
        for k in range(run.snapshots):
            run.advance_to(k * run.steps_per_snapshot)
            series, void = run.series(), run.fields().void_fraction.mean(axis=(0, 2))
            speed = self.slow + (self.fast - self.slow) * run.time / self.ramp
            middle = void[2 : int(self.solid / run.fluid.grid.spacing[1])].mean()
            rows.append((speed, series["fluid.pressure_drop"], series["bed_height"], middle))
        self.last = run
        return np.array(rows[1:]).T

    @property
    def weight(self):
        """Pressure drop (Pa) that carries the beads, N V_p (ρ_p − ρ_f) g/A."""
        return self.solid * (self.density - self.fluid) * G

    def ergun(self, void, speed):
        """−dp/dz, Pa/m."""
        d, mu = self.diameter, self.viscosity
        inertial = 1.75 * self.fluid * (1 - void) / void**3 * speed**2 / d
        return 150 * mu * (1 - void) ** 2 / void**3 * speed / d**2 + inertial

    def lifting_speed(self, void):
        """U_mf (m/s) by Ergun's equation."""
        carried = (1 - void) * (self.density - self.fluid) * G
        return brentq(lambda u: self.ergun(void, u) - carried, 1e-9, 10.0)


def lifted(bed, speed, drop, height, void):
    """U_mf (m/s), where the line of the fixed bed meets the weight; that bed's mean ε, by its height, and ε within."""
    rising = (drop > 0.4 * bed.weight) & (drop < 0.85 * bed.weight)
    slope, offset = np.polyfit(speed[rising], drop[rising], 1)
    top = height[rising].mean() + bed.diameter / 2  # of the beads
    return (bed.weight - offset) / slope, 1 - bed.solid / top, void[rising].mean()


def check(name, bed, found, plateau, onset, reference=None):
    """Compare the plateau with the weight and U_mf with Ergun's, and with a reference (m/s), within shares."""
    speed, drop, height, void = found
    start, packed, within = lifted(bed, speed, drop, height, void)
    expected = bed.lifting_speed(packed)
    flat = drop[speed > 1.25 * start]
    print(f"\n{name}: {len(bed.last.particles.radius)} beads, plateau {flat.mean():.1f} ± {flat.std():.1f} Pa of "
          f"{bed.weight:.1f} ({flat.mean() / bed.weight - 1:+.2%}); U_mf {start:.4f} m/s, by Ergun {expected:.4f} at ε "
          f"{packed:.3f} ({start / expected - 1:+.1%}), {bed.lifting_speed(within):.4f} at the {within:.3f} within; "
          f"{bed.last.step} and {bed.last.fluid_steps} steps, overlap {bed.last.tally[:, 1].max():.3f}")  # fmt: skip
    assert len(flat) >= 5
    assert flat.mean() == pytest.approx(bed.weight, rel=plateau)
    assert start == pytest.approx(expected, rel=onset)
    assert reference is None or start == pytest.approx(reference, rel=onset)


def test_liquid_lifts_a_bed_at_the_speed_of_ergun_and_then_carries_its_weight(scene_of):
    """1 mm beads of 2000 kg/m³ in 10 kg/m³, 1.5e-4 m²/s; 10,000 on π (13.85 mm)² weigh 169.6 Pa. 3 %, and 10 %."""
    bed = Bed(1e-3, 2000.0, 5.48912e-3, 500, 10.0, 1.5e-3, 0.002, 0.02, 50.0, 1.2e-5, 6e-4, 0.1, 0.3)
    assert bed.weight == pytest.approx(169.6, abs=0.1)
    check("liquid", bed, bed.run(scene_of), 0.03, 0.10)


def test_gas_lifts_a_bed_at_the_speed_of_wen_and_yu_and_then_carries_its_weight(scene_of):
    """0.5 mm beads of 1000 kg/m³ in gas of 1 kg/m³, 1e-5 m²/s, Archimedes number 12250: U_mf 0.135 m/s. 5 %, 15 %."""
    bed = Bed(5e-4, 1000.0, 3e-3, 900, 1.0, 1e-5, 0.02, 0.2, 10.0, 8e-6, 4e-4, 0.05, 0.15)
    archimedes = 5e-4**3 * 1.0 * 999.0 * G / 1e-5**2
    assert archimedes == pytest.approx(12250, rel=1e-3)
    check("gas", bed, bed.run(scene_of), 0.05, 0.15, 0.135)
