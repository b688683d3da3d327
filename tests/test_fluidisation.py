"""A bed that a slowly rising stream lifts: its pressure drop stops at its weight, where Ergun's equation says."""

from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

from sim.coupled import CoupledSimulation

pytestmark = pytest.mark.physics

G = 9.81


class Bed:
    """Beads in a column that repeats in x and z, and the stream that fluidises them."""

    def __init__(self, diameter, density, width, count, fluid, viscosity, slow, fast, stiffness, step, settling, ramp):
        self.diameter, self.width, self.count, self.slow, self.fast = diameter, width, count, slow, fast
        self.density, self.fluid, self.viscosity = density, fluid, viscosity
        self.stiffness, self.step, self.settling, self.ramp = stiffness, step, settling, ramp
        self.solid = count * pi / 6 * diameter**3 / width**2  # m, height of all beads melted

    def run(self, scene_of):
        """Settle in the slow stream, then ramp it: speeds (m/s), pressure drops (Pa), heights (m), ε in the bed."""
        high = round(3.2 * self.solid / 1.5 / self.diameter) * 1.5 * self.diameter
        corner = [self.width, high, self.width]
        scene = scene_of(
            seed=1,
            particles=[{"diameter": self.diameter, "density": self.density, "count": self.count}],
            contact={"stiffness": self.stiffness, "restitution": 0.9},
            gravity={"acceleration": [0, -G, 0]},
            time={"duration": self.settling + self.ramp, "step": self.step},
            output={"interval": 0.005, "precision": "double"},
            filling={"lowest": [0, 0, 0], "highest": [self.width, 1.9 * self.solid, self.width]},
            periodic={"directions": ["x", "z"], "lowest": [0, 0, 0], "highest": corner},
            limits={"max_overlap": 0.1},
            walls=[{"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 1, 0]}]}],
            fluid={
                "density": self.fluid, "viscosity": self.viscosity, "lowest": [0, 0, 0], "highest": corner,
                "cells": [round(x / self.diameter / 1.5) for x in corner], "velocity": [0, self.slow, 0],
                "faces": {"-y": {"kind": "inflow", "speed": self.fast, "start_speed": self.slow,
                                 "ramp": self.settling + self.ramp}, "+y": {"kind": "outflow"}},
            },
            drag={},
        )  # fmt: skip
        run, rows = CoupledSimulation(scene), []
        for n in range(run.snapshots):
            run.advance_to(n * run.steps_per_snapshot)
            series, void = run.series(), run.fields().void_fraction.mean(axis=(0, 2))
            speed = self.slow + (self.fast - self.slow) * run.time / (self.settling + self.ramp)
            middle = void[2 : int(0.6 * self.solid / (high / len(void))) + 3].mean()
            rows.append((speed, series["fluid.pressure_drop"], series["bed_height"], middle, run.time))
        self.last = run
        return np.array(rows).T

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
