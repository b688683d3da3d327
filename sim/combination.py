"""Solids made of solids: union, intersection and difference of signed distance functions.

φ of a union is the least of its members', of an intersection the largest; what is cut away enters with −φ. The
gradient is that of the member that decides, so its length is 1 and the normal force of paper eqs. (14)–(17) holds as it
stands. The result is the true distance only outside of a union, and inside of an intersection; elsewhere, as beyond
an edge that was cut, it bounds the distance from below. A particle that touches such an edge from outside thus meets
the two faces produced to where they cross instead of a round edge: a sharp corner of width r(√2 − 1) at most for faces
at right angles. Where members pass the lead, ∇φ jumps and the force with it, at continuous φ: energy is kept, since
½ k (φ − r)² is continuous, to the accuracy of a step that meets a jump.
"""

from typing import NamedTuple

import numpy as np

from sim.errors import InputError
from sim.gridded import gridded_distance
from sim.kernel import Array, inlined, kernel
from sim.shapes import COMBINATION, MESH, PARAMETERS, signed_distance

KIND, SIDE, OPERATION = PARAMETERS, PARAMETERS + 1, PARAMETERS + 2  # columns of a program beside a member's numbers
LEAST, MOST, MEMBER = range(3)
DEPTH = 4  # values that wait for an operation, as on a pocket calculator
Distance = tuple[float, float, float, float]  # φ (m) and its gradient


class Solid(NamedTuple):
    """A shape: its kind, its numbers, and 1 where particles are outside of it, −1 inside."""

    kind: int
    parameter: Array  # (10,)
    side: float


class Combined(NamedTuple):
    """The least (union) or the largest (intersection) of its members' signed distances."""

    operation: int  # LEAST or MOST
    members: "list[Solid | Combined]"


def complement(solid: Solid | Combined) -> Solid | Combined:
    """Return what is outside as the inside: −φ, by De Morgan for a combination."""
    if isinstance(solid, Solid):
        return solid._replace(side=-solid.side)
    return Combined(MOST if solid.operation == LEAST else LEAST, [complement(m) for m in solid.members])


def _steps(solid: Solid | Combined) -> tuple[list[Array], int]:
    """Return a program in postfix order, and how many values wait at most."""
    if isinstance(solid, Solid):
        return [np.array([*solid.parameter, solid.kind, solid.side, MEMBER])], 1
    members = sorted((_steps(m) for m in solid.members), key=lambda program: -program[1])  # the deepest first
    rows, depth = [], 0
    for k, (steps, waiting) in enumerate(members):
        rows += steps
        depth = max(depth, waiting + min(k, 1))
        if k:
            rows.append(np.array([0.0] * (PARAMETERS + 2) + [solid.operation]))
    return rows, depth


def rows_of(solids: list[Solid | Combined]) -> tuple[list[Solid], Array | None]:
    """Return a row for each shape and the program (steps, 13) of all combinations, None where there are none.

    The row of a combination holds where its steps begin and end. Raises InputError where more than four members would
    wait for one another.
    """
    rows: list[Solid] = []
    program: list[Array] = []
    for solid in solids:
        if isinstance(solid, Solid):
            rows.append(solid)
            continue
        steps, waiting = _steps(solid)
        if waiting > DEPTH:
            raise InputError(
                f"walls: a combination nests so that {waiting} shapes wait for one another (at most {DEPTH}); "
                "list more members at one level"
            )
        limits = [len(program), len(program) + len(steps)]
        rows.append(Solid(COMBINATION, np.array(limits + [0.0] * (PARAMETERS - 2)), 1.0))
        program += steps
    return rows, np.array(program) if program else None


@kernel
def member_distance(
    kind: int, p: Array, s: int, blocks: Array | None, spline: Array | None, x: float, y: float, z: float
) -> Distance:
    """Distance to a single solid, negative inside, and the gradient."""
    if blocks is not None and spline is not None and kind == MESH:
        return gridded_distance(p, s, blocks, spline, x, y, z)
    return signed_distance(kind, p, s, x, y, z)


@kernel
def combined_distance(
    first: int, last: int, p: Array, blocks: Array | None, spline: Array | None, x: float, y: float, z: float
) -> Distance:
    """Run the steps first to last (excluded) of a program: φ of a combination and its gradient."""
    top = second = third = fourth = (0.0, 0.0, 0.0, 0.0)
    for step in range(first, last):
        operation = int(p[step, OPERATION])
        if operation == MEMBER:
            side = p[step, SIDE]
            d, nx, ny, nz = member_distance(int(p[step, KIND]), p, step, blocks, spline, x, y, z)
            second, third, fourth = top, second, third
            top = (side * d, side * nx, side * ny, side * nz)
        else:
            if (second[0] < top[0]) == (operation == LEAST):
                top = second
            second, third = third, fourth
    return top


@inlined
def shape_distance(
    kind: int,
    p: Array,
    program: Array | None,
    blocks: Array | None,
    spline: Array | None,
    s: int,
    x: float,
    y: float,
    z: float,
) -> Distance:
    """Distance φ of a point to shape s in its body's frame, and ∇φ; what a scene has none of is not compiled."""
    if program is not None and kind == COMBINATION:
        return combined_distance(int(p[s, 0]), int(p[s, 1]), program, blocks, spline, x, y, z)
    if blocks is not None and spline is not None and kind == MESH:
        return gridded_distance(p, s, blocks, spline, x, y, z)
    return signed_distance(kind, p, s, x, y, z)
