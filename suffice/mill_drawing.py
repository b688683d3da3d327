"""Dimensions of a mill: a drawing of its vessel and rotor along their axis and from the side (paper Figure 4)."""

import numpy as np
from numpy.typing import NDArray

from sim import Scene
from sim.vessel import Rotation
from suffice.mill_views import Mill, end_view, mm, row_steps, rows_of, side_view, tip_of
from suffice.rods import Rod, rods_of
from suffice.viewpoint import down_of, frame_along
from suffice.wording import escape

Array = NDArray[np.float64]

MM = 1e3
ALIGNED = 1e-6  # sine or cosine of an angle that is rounding


def mill_of(scene: Scene) -> Mill | None:
    """Return what can be drawn of a scene: cylinders along and across the axis of its widest vessel.

    None where no cylinder holds particles.
    """
    found = rods_of(scene)
    cylinders = [rod for rod in found.rods if rod.other_radius is None]
    cones = [f"cone of wall {rod.wall}" for rod in found.rods if rod.other_radius is not None]
    vessels = sorted((rod for rod in cylinders if rod.hollow), key=lambda rod: -rod.radius)
    if not vessels:
        return None
    down = down_of(scene)
    frame = frame_along(vessels[0].axis, down)
    origin = MM * vessels[0].centre
    rods = [rod.scaled(MM, frame, frame @ (MM * rod.centre - origin)) for rod in cylinders]
    along, pins, askew = [], [], []
    for rod in rods:
        if np.linalg.norm(rod.axis[:2]) < ALIGNED:
            along.append(rod)
        elif abs(rod.axis[2]) < ALIGNED and rod.length is not None and not rod.hollow:
            pins.append(rod)
        else:
            askew.append(f"cylinder of wall {rod.wall} that stands oblique to the vessel's axis")
    return Mill(
        sorted((rod for rod in along if rod.hollow), key=lambda rod: -rod.radius),
        [rod for rod in along if not rod.hollow],
        pins,
        list(dict.fromkeys([*cones, *found.others, *askew])),
        _turn(scene, vessels[0].axis),
        max((MM * table.largest for table in scene.particles), default=None),
        None if down is None else frame @ down,
    )


def _turn(scene: Scene, axis: Array) -> float | None:
    """Return 1/min of the one body that turns about this axis, counter-clockwise seen from where it points to."""
    moving = [wall.motion for wall in scene.walls if isinstance(wall.motion, Rotation) and wall.motion.rpm]
    if len(moving) != 1 or np.linalg.norm(np.cross(moving[0].axis, axis)) > ALIGNED * np.linalg.norm(moving[0].axis):
        return None
    return moving[0].rpm * float(np.sign(np.dot(moving[0].axis, axis)))


def mill_drawing(scene: Scene) -> str:
    """Return both views as HTML, with dimensions in mm, and in words what the scene has that is not drawn."""
    mill = mill_of(scene)
    if mill is None:
        return '<p class="quiet">Not drawn: no cylinder of the scene holds particles.</p>'
    missing = f" Not drawn: {escape('; '.join(mill.missing))}." if mill.missing else ""
    return (
        f'<div class="drawings">{end_view(mill)}{side_view(mill)}</div>'
        f'<p class="quiet">All lengths in mm. {_inventory(mill)}{missing}</p>'
    )


def _size(rod: Rod) -> str:
    length = "through" if rod.length is None else f"× {mm(rod.length)}"
    return f"Ø {mm(2.0 * rod.radius)} {length}"


def _inventory(mill: Mill) -> str:
    """Say in words what is drawn, and how fast it turns."""
    kinds = [("vessel", mill.vessels), ("shaft", mill.shafts), ("pin", mill.pins)]
    said = []
    for name, rods in kinds:
        sizes = [_size(rod) for rod in rods]
        for size in dict.fromkeys(sizes):
            count = sizes.count(size)
            said.append(f"{name} {size}" if count == 1 else f"{count} {name}s {size}")
    words = "; ".join(said).capitalize().replace("ø", "Ø")
    rows = rows_of(mill)
    words += f", in {len(rows)} rows" if len(rows) > 1 else ""
    words += f" at {', '.join(map(mm, rows))} from the middle" if rows and row_steps(mill) is None else ""
    words += f", tips {mm(tip_of(mill))} from the axis" if mill.pins else ""
    return words + (f"; {abs(mill.rpm):g} rpm." if mill.rpm else ".")
