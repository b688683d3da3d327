"""The six sides of the fluid's box: what the margins of its fields hold.

A no-slip wall stands half a cell from the first faces inside, so that what is beyond it mirrors what is before it, with
the sign that makes the mean the wall's velocity. An inflow is a wall that fluid comes through.
"""

from math import prod
from typing import NamedTuple

import numpy as np

from sim.flow import SIDES, FluidTable, Inflow, NoSlip
from sim.grid import MARGIN, Frame, Grid, along, cells_of, face_points, faces_of
from sim.kernel import Array, Indices, inlined, kernel

PERIODIC, WALL, SLIP, OUTFLOW = range(4)
KINDS = {"wall": WALL, "inflow": WALL, "slip": SLIP, "outflow": OUTFLOW}


class Borders(NamedTuple):
    """Kinds of the sides −x, +x, −y, +y, −z, +z, and the velocities of their walls."""

    kind: Indices  # (6,)
    velocity: Array  # (6, 3) m/s, tangential


def borders_of(table: FluidTable, periodic: tuple[bool, bool, bool]) -> Borders:
    """Return the sides of the box as a scene gives them."""
    kind, velocity = np.full(6, WALL, np.int64), np.zeros((6, 3))
    for s, side in enumerate(SIDES):
        face = table.faces.get(side)
        if periodic[s // 2]:
            kind[s] = PERIODIC
        elif face is not None:
            kind[s] = KINDS[face.kind]
            if isinstance(face, NoSlip):
                velocity[s] = face.velocity
    return Borders(kind, velocity)


def inflow_speed(face: Inflow, time: float) -> float:
    """Mean speed (m/s) into the box at a time (s)."""
    if time >= face.ramp:
        return face.speed
    return face.start_speed + (face.speed - face.start_speed) * time / face.ramp


def fastest_side(table: FluidTable) -> float:
    """Largest speed (m/s) of a sliding wall, or of an inflow on its mean."""
    speeds = [float(np.linalg.norm(face.velocity)) for face in table.faces.values() if isinstance(face, NoSlip)]
    speeds += [max(face.speed, face.start_speed) for face in table.faces.values() if isinstance(face, Inflow)]
    return max(speeds, default=0.0)


def inflow_shape(face: Inflow, axis: int, grid: Grid) -> Array:
    """Speed of each face of a side relative to the mean over its region, 0 outside of it; shape as the side's faces."""
    points = face_points(axis, grid)
    low = grid.lowest if face.lowest is None else face.lowest
    size = [n * h for n, h in zip(grid.cells, grid.spacing, strict=True)]
    high = [a + b for a, b in zip(grid.lowest, size, strict=True)] if face.highest is None else face.highest
    shape = np.ones_like(points[0].take(0, axis=2 - axis))
    for across in range(3):
        if across == axis:
            continue
        share = (points[across].take(0, axis=2 - axis) - low[across]) / (high[across] - low[across])
        shape = shape * np.where((share > 0.0) & (share < 1.0), 1.0, 0.0)
        if face.profile == "parabolic" and not grid.periodic[across] and grid.cells[across] > 1:
            shape = shape * 6.0 * share * (1.0 - share)
    open_part = prod(high[a] - low[a] for a in range(3) if a != axis)
    area = prod(grid.spacing[a] for a in range(3) if a != axis)
    return np.asarray(shape * open_part / max(float(shape.sum()) * area, 1e-300))


def set_inflow_(velocity: Array, table: FluidTable, void: Array, grid: Grid, time: float) -> None:
    """Put the speeds of the inflows at a time (s) on the borders of `velocity` (3, size).

    As much enters as through clear fluid: between particles, in cells of void fraction `void` (size,), it is faster.
    """
    for s, side in enumerate(SIDES):
        face = table.faces.get(side)
        if isinstance(face, Inflow):
            axis, high = s // 2, s % 2
            speed = (-1.0 if high else 1.0) * inflow_speed(face, time) * inflow_shape(face, axis, grid)
            side_of = along(axis, -1 if high else 0)
            faces_of(velocity[axis], axis, grid)[side_of] = speed / cells_of(void, grid)[side_of]


def close_(field: Array, axis: int, borders: Borders, grid: Grid) -> None:
    """Set a component's field (size,) to 0 on the sides that are walls or inflows."""
    for high in (0, 1):
        if borders.kind[2 * axis + high] not in (PERIODIC, OUTFLOW):
            faces_of(field, axis, grid)[along(axis, -1 if high else 0)] = 0.0


@inlined
def place(axis: int, along: int, p: int, q: int, stride: Indices) -> int:
    """Place of a cell by its index along an axis, and by those, margins counted, along the next two (cyclic)."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    at: int = (along + MARGIN) * stride[axis] + p * stride[b] + q * stride[c]
    return at


@inlined
def mirrored(kind: int, inside: float, nearest: float, wall: float) -> float:
    """Value beyond a side, of a quantity that stands half a cell from it."""
    if kind == WALL:
        return 2.0 * wall - inside
    return inside if kind == SLIP else nearest


@kernel
def fill_along(
    field: Array, axis: int, on_faces: bool, frame: Frame, kind: Indices, wall: tuple[float, float], copies: bool
) -> None:
    """Fill the margins of a field at both ends of an axis.

    A component on faces across that axis keeps what stands on the borders, but for outflows where `copies` is set: they
    take the velocity of the next face inside.
    """
    n, s = frame.cells[axis], frame.stride
    low, high = kind[2 * axis], kind[2 * axis + 1]
    b, c = (axis + 1) % 3, (axis + 2) % 3
    for q in range(frame.cells[c] + 2 * MARGIN):
        for p in range(frame.cells[b] + 2 * MARGIN):
            at = place(axis, 0, p, q, s)
            end = at + (n - 1) * s[axis]
            step = s[axis]
            if low == PERIODIC:
                for m in range(MARGIN):  # by turns, so that a single cell repeats too
                    field[at - (m + 1) * step] = field[end - m * step]
                    field[end + (m + 1) * step] = field[at + m * step]
            elif on_faces:
                last = end + step
                if copies and low == OUTFLOW:
                    field[at] = field[at + step]
                if copies and high == OUTFLOW:
                    field[last] = field[end]
                for m in range(1, MARGIN + 1):
                    inside = at + min(m, n) * step
                    field[at - m * step] = field[at] if low == OUTFLOW else 2.0 * field[at] - field[inside]
                field[last + step] = field[last] if high == OUTFLOW else 2.0 * field[last] - field[end]
            else:
                for m in range(MARGIN):
                    inside = min(m, n - 1)
                    field[at - (m + 1) * step] = mirrored(low, field[at + inside * step], field[at], wall[0])
                    field[end + (m + 1) * step] = mirrored(high, field[end - inside * step], field[end], wall[1])


@kernel
def fill_velocity_margins(velocity: Array, frame: Frame, borders: Borders, moving: bool, copies: bool) -> None:
    """Fill the margins of a velocity (3, size); with walls at rest and not `moving` those of a change of velocity."""
    for a in range(3):
        for axis in range(3):
            wall = (0.0, 0.0)
            if moving:
                wall = (borders.velocity[2 * axis, a], borders.velocity[2 * axis + 1, a])
            fill_along(velocity[a], axis, a == axis, frame, borders.kind, wall, copies)


@kernel
def fill_level(field: Array, axis: int, frame: Frame, periodic: bool) -> None:
    """Fill the margins of a field of cells at both ends of an axis, by the nearest cell or by the period."""
    n, s = frame.cells[axis], frame.stride
    b, c = (axis + 1) % 3, (axis + 2) % 3
    for q in range(frame.cells[c] + 2 * MARGIN):
        for p in range(frame.cells[b] + 2 * MARGIN):
            at = place(axis, 0, p, q, s)
            end = at + (n - 1) * s[axis]
            for m in range(MARGIN):
                field[at - (m + 1) * s[axis]] = field[end - m * s[axis]] if periodic else field[at]
                field[end + (m + 1) * s[axis]] = field[at + m * s[axis]] if periodic else field[end]
