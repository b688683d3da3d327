"""Walls immersed in the fluid: how much of every face is solid, and how fast the solid moves there.

Paper eqs. (18)–(20): u = (1 − α) u_f + α u_w. The share α of a face's control volume that lies behind the walls follows
from the signed distance φ at its middle, as if the wall were flat there; it enters the implicit velocity and the
pressure alike, so that no fluid crosses a wall.
"""

import numpy as np

from sim.grid import MARGIN, Grid, along, face_points, faces_of
from sim.kernel import Array, Indices, Vector, inlined, kernel
from sim.motion import Bodies
from sim.surface import distance_to_wall, wall_motion


@inlined
def solid_share(distance: float, gx: float, gy: float, gz: float, spacing: Vector) -> float:
    """Share of a control volume behind a flat wall at a distance φ (m) from its middle, along ∇φ."""
    width = abs(gx) * spacing[0] + abs(gy) * spacing[1] + abs(gz) * spacing[2]
    if width > 0.0:
        return min(max(0.5 - distance / width, 0.0), 1.0)
    return 1.0 if distance < 0.0 else 0.0


@inlined
def is_sure(cells: Array, b: int, n: int, step: int) -> bool:
    """Whether both cells beside a face are wholly in body b, or wholly out of it; then so is the face."""
    here, before = cells[b, n], cells[b, n - step]
    sure: bool = here == before and here in (0.0, 1.0)
    return sure


@kernel
def body_share(walls: Bodies, b: int, x: float, y: float, z: float, spacing: Vector) -> float:
    """Share of a control volume about a point (m) that lies in body b; shapes of a body may overlap."""
    most = 0.0
    for s in range(walls.kind.shape[0]):
        if walls.body[s] == b:
            d, gx, gy, gz = distance_to_wall(walls, s, x, y, z)
            most = max(most, solid_share(d, gx, gy, gz, spacing))
    return most


@kernel
def fill_body_share(
    a: int, b: int, walls: Bodies, lowest: Vector, spacing: Vector, stride: Indices, cells: Indices, of_cells: Array,
    by_body: Array, moving: Array,
) -> None:  # fmt: skip
    """Fill the share (bodies, size) of body b of the faces of component a, or of the cells (a = 3), and its u_w, m/s.

    That of the cells, `of_cells` (bodies, size), tells which faces need no look.
    """
    for k in range(cells[2] + (a == 2)):
        z = lowest[2] + (k if a == 2 else k + 0.5) * spacing[2]
        for j in range(cells[1] + (a == 1)):
            y = lowest[1] + (j if a == 1 else j + 0.5) * spacing[1]
            for i in range(cells[0] + (a == 0)):
                x = lowest[0] + (i if a == 0 else i + 0.5) * spacing[0]
                n = (k + MARGIN) * stride[2] + (j + MARGIN) * stride[1] + (i + MARGIN)
                inside = (i, j, k)
                if a < 3 and 0 < inside[a] < cells[a] and is_sure(of_cells, b, n, stride[a]):
                    by_body[b, n] = of_cells[b, n]
                else:
                    by_body[b, n] = body_share(walls, b, x, y, z, spacing)
                if a < 3 and by_body[b, n] > 0.0:
                    moving[b, n] = wall_motion(walls, b, (x, y, z))[1][a]


class Immersed:
    """The bodies of a scene as the fluid sees them, where they stand now."""

    def __init__(self, walls: Bodies, immersed: list[bool], grid: Grid) -> None:
        self.walls, self.grid = walls, grid
        self.immersed = np.array(immersed, np.uint8)
        self.moves = bool(np.any((walls.motion > 0) & (self.immersed > 0)))
        self.share = np.zeros((4, grid.size))  # α of the faces of each component, and of the cells
        self.wall = np.zeros((4, grid.size))  # α u_w, m/s
        self.by_body = np.zeros((4, len(immersed), grid.size))
        self.speed = np.zeros((4, len(immersed), grid.size))  # u_w of each body, m/s, where it covers anything
        self._fill(np.flatnonzero(self.immersed))

    def update_(self) -> None:
        """Bring the shares up to date with the places of the bodies that move."""
        self._fill(np.flatnonzero(self.immersed & (self.walls.motion > 0)))

    def _fill(self, bodies: Indices) -> None:
        grid, stride, cells = self.grid, np.array(self.grid.stride), np.array(self.grid.cells)
        for a in (3, 0, 1, 2):
            for b in bodies:
                fill_body_share(
                    a, int(b), self.walls, grid.lowest, grid.spacing, stride, cells, self.by_body[3], self.by_body[a],
                    self.speed[a],
                )  # fmt: skip
            part = self.by_body[a]
            total = part.sum(axis=0)
            self.share[a] = np.minimum(total, 1.0)
            self.wall[a] = (part * self.speed[a]).sum(axis=0) / np.maximum(total, 1.0)  # bodies may overlap as well

    def tally_(self, axis: int, force: Array, share: float, given: Array) -> None:
        """Add to `given` (bodies, 7) what each body's part of a force (N/m³) on the faces of a component amounts to.

        `share` is the volume of a face's cell times the time (m³ s): impulse, angular impulse about the body's centre
        and work at its own velocity.
        """
        points = face_points(axis, self.grid)
        total = faces_of(self.by_body[axis].sum(axis=0), axis, self.grid)
        once = along(axis, slice(None, -1) if self.grid.periodic[axis] else slice(None))
        for b in np.flatnonzero(self.immersed):
            part = faces_of(self.by_body[axis, b], axis, self.grid)
            push = share * force * np.divide(part, total, out=np.zeros_like(part), where=total > 0.0)
            arm = [points[k] - self.walls.centre[b, k] - self.walls.shift[b, k] for k in range(3)]
            turn, velocity = self.walls.turn[b], self.walls.velocity[b]
            n, m = (axis + 1) % 3, (axis + 2) % 3
            speed = velocity[axis] + turn[n] * arm[m] - turn[m] * arm[n]
            push = push[once]
            given[b, axis] += push.sum()
            given[b, 3 + n] += (arm[m][once] * push).sum()
            given[b, 3 + m] -= (arm[n][once] * push).sum()
            given[b, 6] += (speed[once] * push).sum()
