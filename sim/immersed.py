"""Walls immersed in the fluid: how much of every face is solid, and how fast the solid moves there.

Paper eqs. (18)–(20): u = (1 − α) u_f + α u_w. The share α of a face's control volume that lies behind the walls follows
from the signed distance φ at its middle, as if the wall were flat there; it enters the implicit velocity and the
pressure alike, so that no fluid crosses a wall.
"""

import numpy as np

from sim.grid import MARGIN, Grid, along, face_points, faces_of
from sim.kernel import Array, Flags, Indices, Vector, inlined, kernel
from sim.motion import Bodies
from sim.surface import distance_to_wall, wall_motion

FAR_AWAY, NEAR, WITHIN = range(3)  # where a cell is
CLOSEST = 0.02  # of a spacing: walls nearer than this, or behind a node, hold it as firmly


@inlined
def solid_share(distance: float, gx: float, gy: float, gz: float, spacing: Vector) -> float:
    """Share of a control volume behind a flat wall at a distance φ (m) from its middle, along ∇φ."""
    width = abs(gx) * spacing[0] + abs(gy) * spacing[1] + abs(gz) * spacing[2]
    if width > 0.0:
        return min(max(0.5 - distance / width, 0.0), 1.0)
    return 1.0 if distance < 0.0 else 0.0


@inlined
def closeness(along: float, spacing: float) -> float:
    """(h/s − 1)/h², 1/m², for a wall at a distance s (m) along an axis; 0 beyond the next node, bounded within it."""
    part = max(along / spacing, CLOSEST)
    return (1.0 / part - 1.0) / (spacing * spacing) if part < 1.0 else 0.0


@inlined
def wall_grip(distance: float, gx: float, gy: float, gz: float, spacing: Vector) -> float:
    """Friction of a flat wall at a distance φ (m) over that of the fluid, μ ∇²u, for a unit of u, 1/m².

    Along an axis the wall is at s = φ/|n|. With h/s − 1 in place of what lies beyond it, a velocity that is linear from
    the wall on solves the equations of differences, wherever the wall is between two nodes.
    """
    total = 0.0
    for slope, h in ((gx, spacing[0]), (gy, spacing[1]), (gz, spacing[2])):
        total += closeness(distance / max(abs(slope), 1e-12), h)
    return total


@kernel
def meet_body(
    walls: Bodies, b: int, x: float, y: float, z: float, spacing: Vector
) -> tuple[float, float, float]:  # fmt: skip
    """Share of a control volume about a point (m) in body b, its grip there, and its distance; shapes may overlap."""
    share, grip, nearest = 0.0, 0.0, np.inf
    for s in range(walls.kind.shape[0]):
        if walls.body[s] == b:
            d, gx, gy, gz = distance_to_wall(walls, s, x, y, z)
            share = max(share, solid_share(d, gx, gy, gz, spacing))
            grip = max(grip, wall_grip(d, gx, gy, gz, spacing))
            nearest = min(nearest, d)
    return share, grip, nearest


@kernel
def fill_body(
    a: int, b: int, walls: Bodies, lowest: Vector, spacing: Vector, stride: Indices, cells: Indices, place: Flags,
    by_body: Array, grip: Array, moving: Array,
) -> None:  # fmt: skip
    """Fill share and grip (bodies, size) of body b at the faces of component a, or in the cells (a = 3), and its u_w.

    `place` (bodies, size) is filled with where the cells are; it tells which faces need no look.
    """
    reach = 1.5 * max(spacing)
    for k in range(cells[2] + (a == 2)):
        z = lowest[2] + (k if a == 2 else k + 0.5) * spacing[2]
        for j in range(cells[1] + (a == 1)):
            y = lowest[1] + (j if a == 1 else j + 0.5) * spacing[1]
            for i in range(cells[0] + (a == 0)):
                x = lowest[0] + (i if a == 0 else i + 0.5) * spacing[0]
                n = (k + MARGIN) * stride[2] + (j + MARGIN) * stride[1] + (i + MARGIN)
                inside = (i, j, k)
                if a < 3 and 0 < inside[a] < cells[a] and place[b, n] == place[b, n - stride[a]] != NEAR:
                    by_body[b, n], grip[b, n] = 1.0 if place[b, n] == WITHIN else 0.0, 0.0
                else:
                    by_body[b, n], grip[b, n], distance = meet_body(walls, b, x, y, z, spacing)
                    if a == 3:
                        place[b, n] = WITHIN if by_body[b, n] == 1.0 else NEAR if distance < reach else FAR_AWAY
                if a < 3:
                    covers = by_body[b, n] > 0.0 or grip[b, n] > 0.0
                    moving[b, n] = wall_motion(walls, b, (x, y, z))[1][a] if covers else 0.0


class Immersed:
    """The bodies of a scene as the fluid sees them, where they stand now."""

    def __init__(self, walls: Bodies, immersed: list[bool], grid: Grid) -> None:
        self.walls, self.grid = walls, grid
        self.immersed = np.array(immersed, np.uint8)
        self.moves = bool(np.any((walls.motion > 0) & (self.immersed > 0)))
        self.share = np.zeros((4, grid.size))  # α of the faces of each component, and of the cells
        self.grip = np.zeros((4, grid.size))  # 1/m², friction of walls near by over that of the fluid
        self.wall = np.zeros((4, grid.size))  # u_w, m/s
        self.by_body = np.zeros((4, len(immersed), grid.size))
        self.grip_by_body = np.zeros((4, len(immersed), grid.size))
        self.part = np.zeros((3, len(immersed), grid.size))  # of each body in what holds a face
        self.speed = np.zeros((4, len(immersed), grid.size))  # u_w of each body, m/s, where it covers anything
        self.place = np.zeros((len(immersed), grid.size), np.uint8)
        self._fill(np.flatnonzero(self.immersed))

    def update_(self) -> None:
        """Bring the shares up to date with the places of the bodies that move."""
        self._fill(np.flatnonzero(self.immersed & (self.walls.motion > 0)))

    def _fill(self, bodies: Indices) -> None:
        grid, stride, cells = self.grid, np.array(self.grid.stride), np.array(self.grid.cells)
        for a in (3, 0, 1, 2):
            for b in bodies:
                fill_body(
                    a, int(b), self.walls, grid.lowest, grid.spacing, stride, cells, self.place, self.by_body[a],
                    self.grip_by_body[a], self.speed[a],
                )  # fmt: skip
            part, grip = self.by_body[a], self.grip_by_body[a]
            self.share[a], self.grip[a] = np.minimum(part.sum(axis=0), 1.0), grip.sum(axis=0)
            if a < 3:
                weight = part + grip / (grip + 1.0 / min(grid.spacing) ** 2)  # bodies may overlap, or be close
                total = weight.sum(axis=0)
                # nothing stays where a body has been, or a run would differ from one that goes on from a checkpoint
                self.part[a] = np.divide(weight, total, out=np.zeros_like(weight), where=total > 0.0)
                self.wall[a] = (self.part[a] * self.speed[a]).sum(axis=0)

    def tally_(self, axis: int, force: Array, share: float, given: Array) -> None:
        """Add to `given` (bodies, 7) what each body's part of a force (N/m³) on the faces of a component amounts to.

        `share` is the volume of a face's cell times the time (m³ s): impulse, angular impulse about the body's centre
        and work at its own velocity.
        """
        points = face_points(axis, self.grid)
        once = along(axis, slice(None, -1) if self.grid.periodic[axis] else slice(None))
        for b in np.flatnonzero(self.immersed):
            push = share * force * faces_of(self.part[axis, b], axis, self.grid)
            arm = [points[k] - self.walls.centre[b, k] - self.walls.shift[b, k] for k in range(3)]
            turn, velocity = self.walls.turn[b], self.walls.velocity[b]
            n, m = (axis + 1) % 3, (axis + 2) % 3
            speed = velocity[axis] + turn[n] * arm[m] - turn[m] * arm[n]
            push = push[once]
            given[b, axis] += push.sum()
            given[b, 3 + n] += (arm[m][once] * push).sum()
            given[b, 3 + m] -= (arm[n][once] * push).sum()
            given[b, 6] += (speed[once] * push).sum()
