"""Walls of a deck: every shape of a body is a region of its own, moved and turned by variables of time."""

from math import atan2
from typing import NamedTuple

import numpy as np

from sim import Scene
from sim.kernel import Array
from sim.motion import OSCILLATING, ROTATING, TRANSLATING, Bodies, rotation_about
from sim.shapes import BOX, CYLINDER, PLANE, SPHERE, TUBE
from suffice.engine.expressible import REMEDY
from suffice.refusal import Refusal

ALIGNED = 1e-9  # how far a direction may be off
TIME = "(step*dt)"  # s, as a deck calculates it


class Turned(NamedTuple):
    """A cylinder along a coordinate axis, and the turn that brings it to its place at time zero."""

    coordinate: int
    centre: Array  # (3,) m
    about: Array  # (3,) unit vector of the turn
    point: Array  # (3,) m on its axis
    angle: float  # rad


def number(value: float) -> str:
    """Write a number so that it is read back as the same double."""
    return f"{value:.17g}"


def numbers(values: Array) -> str:
    """Write several numbers, blanks between."""
    return " ".join(number(float(value)) for value in values)


def wall_commands(scene: Scene, walls: Bodies | None, laws: list[str]) -> str:
    """Return the commands of all walls: per body its variables, per shape a region and the fix that acts on particles.

    Raises Refusal for a shape or an orientation that LAMMPS has no region for.
    """
    if walls is None:
        return ""
    lines = [line for b in range(len(walls.motion)) for line in _displacement(b, walls)]
    for s in range(len(walls.kind)):
        lines += _region(s, scene.walls[walls.body[s]].name, walls)
        lines.append(f"fix shape{s} all wall/gran/region granular {laws[walls.body[s]]} region shape{s}")
    return "\n".join(lines)


def _displacement(b: int, walls: Bodies) -> list[str]:
    """Variables of where a body has moved (m): velocity times time, or amplitude (sin(ωt + φ) − sin φ)."""
    law = walls.law[b]
    if walls.motion[b] == TRANSLATING:
        along = [f"{number(law[k])}*{TIME}" for k in range(3)]
    elif walls.motion[b] == OSCILLATING:
        swing = f"(sin({number(law[3])}*{TIME}+{number(law[4])})-sin({number(law[4])}))"
        along = [f"{number(law[k])}*{swing}" for k in range(3)]
    else:
        return []
    return [f'variable body{b}{axis} equal "{formula}"' for axis, formula in zip("xyz", along, strict=True)]


def _region(s: int, name: str, walls: Bodies) -> list[str]:
    b, kind, p = int(walls.body[s]), walls.kind[s], walls.parameter[s]
    about, point, speed, angle = np.zeros(3), np.zeros(3), 0.0, 0.0
    if walls.motion[b] == ROTATING:
        about, point, speed = walls.law[b, :3], walls.law[b, 3:6], float(walls.law[b, 6])
    if kind == PLANE:
        style = f"plane {numbers(p[:6])}"
    elif kind == BOX:
        faces = np.stack([p[:3] - p[3:6], p[:3] + p[3:6]], axis=1).ravel()
        style = f"block {numbers(faces)}"
    elif kind == SPHERE:
        style = f"sphere {numbers(p[:3])} {number(p[3])}"
    elif kind in (TUBE, CYLINDER):
        turned = _turned(p[:3], p[3:6], about if speed else None, point, name)
        about, point, angle = turned.about, turned.point, turned.angle
        style = _cylinder(turned, p[6], p[7] if kind == CYLINDER else None)
    else:
        raise Refusal(f"walls {name!r}: LAMMPS has no region of its shape number {s}; {REMEDY}")
    side = "in" if kind == PLANE or walls.side[s] < 0.0 else "out"
    lines, command = [], f"region shape{s} {style} side {side} units box"
    if walls.motion[b] in (TRANSLATING, OSCILLATING):
        command += f" move v_body{b}x v_body{b}y v_body{b}z"
    if speed or angle:
        lines.append(f'variable turn{s} equal "{number(angle)}+{number(speed)}*{TIME}"')
        command += f" rotate v_turn{s} {numbers(point)} {numbers(about)}"
    return [*lines, command]


def _cylinder(turned: Turned, radius: float, half: float | None) -> str:
    """Region of a cylinder along a coordinate axis: the other two coordinates of its axis, radius and ends (m)."""
    k, centre = turned.coordinate, turned.centre
    ends = "INF INF" if half is None else f"{number(centre[k] - half)} {number(centre[k] + half)}"
    return f"cylinder {'xyz'[k]} {numbers(np.delete(centre, k))} {number(radius)} {ends}"


def _turned(centre: Array, axis: Array, about: Array | None, point: Array, name: str) -> Turned:
    """Find a coordinate axis e and a turn about `about`, which the body turns about, that takes e to `axis`.

    A body that does not rotate may be turned about anything, here about e × axis through the centre.
    """
    for k in range(3):
        e = np.eye(3)[k] * (1.0 if axis[k] >= 0.0 else -1.0)
        if np.allclose(e, axis, rtol=0.0, atol=ALIGNED):
            return Turned(k, centre, np.eye(3)[k] if about is None else about, point, 0.0)
    for k in range(3):
        e = np.eye(3)[k]
        turn = np.cross(e, axis) if about is None else about
        turn = turn / np.linalg.norm(turn)
        if abs(turn @ (axis - e)) < ALIGNED:
            through = centre if about is None else point
            angle = atan2(turn @ np.cross(e, axis), e @ axis - (e @ turn) * (axis @ turn))
            back = np.zeros((3, 3))
            rotation_about(turn, -angle, back)
            return Turned(k, back @ (centre - through) + through, turn, through, angle)
    raise Refusal(
        f"walls {name!r}: a cylinder along {axis.tolist()} turns about {np.asarray(about).tolist()}, and no turn about "
        f"that takes a coordinate axis to it, as LAMMPS' regions need; {REMEDY}"
    )
