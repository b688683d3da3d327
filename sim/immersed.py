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


@inlined
def solid_share(distance: float, gx: float, gy: float, gz: float, spacing: Vector) -> float:
    """Share of a control volume behind a flat wall at a distance φ (m) from its middle, along ∇φ."""
    width = abs(gx) * spacing[0] + abs(gy) * spacing[1] + abs(gz) * spacing[2]
    if width > 0.0:
        return min(max(0.5 - distance / width, 0.0), 1.0)
    return 1.0 if distance < 0.0 else 0.0


@kernel
def fill_plane(
    k: int, a: int, walls: Bodies, immersed: Flags, lowest: Vector, spacing: Vector, stride: Indices, faces: Indices,
    share: Array, by_body: Array, wall_velocity: Array,
) -> None:  # fmt: skip
    """Do plane k of component a (3: of the cells) for `fill_solid_share`."""
    px = lowest[0] + (0.0 if a == 0 else 0.5 * spacing[0])
    py = lowest[1] + (0.0 if a == 1 else 0.5 * spacing[1])
    z = lowest[2] + k * spacing[2] + (0.0 if a == 2 else 0.5 * spacing[2])
    for j in range(faces[1]):
        y = py + j * spacing[1]
        for i in range(faces[0]):
            x = px + i * spacing[0]
            n = (k + MARGIN) * stride[2] + (j + MARGIN) * stride[1] + (i + MARGIN)
            total, moving = 0.0, 0.0
            for b in range(by_body.shape[0]):
                by_body[b, n] = 0.0
            for s in range(walls.kind.shape[0]):
                b = walls.body[s]
                if not immersed[b]:
                    continue
                d, gx, gy, gz = distance_to_wall(walls, s, x, y, z)
                part = solid_share(d, gx, gy, gz, spacing)
                if part > by_body[b, n]:  # shapes of a body overlap: what one of them covers is covered
                    by_body[b, n] = part
            for b in range(by_body.shape[0]):
                total += by_body[b, n]
            scale = 1.0 / total if total > 1.0 else 1.0
            for b in range(by_body.shape[0]):
                by_body[b, n] *= scale
                if by_body[b, n] > 0.0 and a < 3:
                    velocity = wall_motion(walls, b, (x, y, z))[1]
                    moving += by_body[b, n] * velocity[a]
            share[n] = min(total, 1.0)
            wall_velocity[n] = moving


@kernel
def fill_solid_share(
    a: int, walls: Bodies, immersed: Flags, lowest: Vector, spacing: Vector, stride: Indices, faces: Indices,
    share: Array, by_body: Array, wall_velocity: Array,
) -> None:  # fmt: skip
    """Fill α (size,), each body's part of it (bodies, size) and α u_w (size,), m/s, of a component, or of cells (3)."""
    for k in range(faces[2]):
        fill_plane(k, a, walls, immersed, lowest, spacing, stride, faces, share, by_body, wall_velocity)


class Immersed:
    """The bodies of a scene as the fluid sees them, where they stand now."""

    def __init__(self, walls: Bodies, immersed: list[bool], grid: Grid) -> None:
        self.walls, self.grid = walls, grid
        self.immersed = np.array(immersed, np.uint8)
        self.moves = bool(np.any((walls.motion > 0) & (self.immersed > 0)))
        self.share = np.zeros((4, grid.size))  # α of the faces of each component, and of the cells
        self.wall = np.zeros((4, grid.size))  # α u_w, m/s
        self.by_body = np.zeros((4, len(immersed), grid.size))
        self.update_()

    def update_(self) -> None:
        """Bring the shares up to date with the bodies' places."""
        for a in range(4):
            faces = np.array([n + (axis == a) for axis, n in enumerate(self.grid.cells)])
            fill_solid_share(
                a, self.walls, self.immersed, self.grid.lowest, self.grid.spacing, np.array(self.grid.stride), faces,
                self.share[a], self.by_body[a], self.wall[a],
            )  # fmt: skip

    def tally_(self, axis: int, force: Array, share: float, given: Array) -> None:
        """Add to `given` (bodies, 7) what each body's part of a force (N/m³) on the faces of a component amounts to.

        `share` is the volume of a face's cell times the time (m³ s): impulse, angular impulse about the body's centre
        and work at its own velocity.
        """
        points = face_points(axis, self.grid)
        total = faces_of(self.share[axis], axis, self.grid)
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
