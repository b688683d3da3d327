"""What stands around the particles of a run, as far as its scene says: weights, gravity, what turns, walls, period."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import InputError, Scene, parse_scene
from sim.assembly import walls_of
from sim.motion import Bodies
from sim.vessel import Rotation
from suffice.run import Run
from suffice.swept import swept_radius

Array = NDArray[np.float64]


class Axis(NamedTuple):
    """A line that something turns about, or along which it is measured."""

    point: Array  # (3,) m
    along: Array  # (3,) unit vector


class Setting(NamedTuple):
    """The surroundings of n particles; what is None is unknown or absent, and `missing` says why."""

    radius: Array  # (n,) m, NaN where unknown
    weight: Array  # (n,) in `weight_unit`
    weight_unit: str  # kg; m³ where the density is unknown; 1 (a particle each) where the radius is, too
    species: Mapping[str, NDArray[np.bool_]]  # which of the particles (n,) are of each kind
    up: Array | None  # (3,) unit vector against gravity
    axis: Axis | None  # that a body turns about
    swept: float | None  # m, radius that a turning body sweeps among the particles
    period: tuple[Array, Array] | None  # lowest corner and length of each direction, (3,) m; length 0: no period
    walls: Bodies | None  # where they stand at time zero
    missing: Mapping[str, str]  # `density`, `gravity`, `axis`, `rotor`, `walls` -> why it is not known
    scene: Scene | None = None  # that made the run

    @property
    def diameter(self) -> float | None:
        """Mean diameter in m, None where a radius is unknown."""
        known = len(self.radius) > 0 and bool((self.radius > 0).all())
        return 2.0 * float(self.radius.mean()) if known else None


def setting_of(run: Run) -> Setting:
    """Return the surroundings of a run's particles, from the scene that made it; without one, what the run itself says.

    The scene is the text `scene` of the run's provenance: an imported run has none.
    """
    scene, why = scene_of(run)
    weight, unit = _weights(run, scene)
    walls, damage = _walls(scene)
    axis, swept = _turning(scene, meshes=not damage)
    up = _up(scene)
    reasons = {
        "density": (unit == "kg", "the scene has no density for every species of the run"),
        "gravity": (up is not None, "the scene has none"),
        "axis": (axis is not None, "no wall of the scene turns"),
        "rotor": (swept is not None, "nothing of a known reach turns among the particles"),
        "walls": (walls is not None, damage or "the scene has none"),
    }
    return Setting(
        np.asarray(run.radius, dtype=np.float64),
        weight,
        unit,
        _kinds(run, scene),
        up,
        axis,
        swept,
        _period(scene),
        walls,
        {name: why or reason for name, (known, reason) in reasons.items() if not known},
        scene,
    )


def scene_of(run: Run) -> tuple[Scene | None, str]:
    """Return the scene that made the run; or None, and why."""
    text = run.provenance.get("scene")
    if text is None:
        return None, "the run holds no scene"
    try:
        return parse_scene(text, "of the run"), ""
    except InputError as error:
        return None, f"the run's scene cannot be read: {error}"


def _weights(run: Run, scene: Scene | None) -> tuple[Array, str]:
    """Mass of each particle in kg; its volume in m³ where a density is unknown; 1 each where a radius is, too."""
    radius = np.asarray(run.radius, dtype=np.float64)
    if not (radius > 0).all():
        return np.ones(len(radius)), "1"
    volume = 4.0 / 3.0 * np.pi * radius**3
    density = [] if scene is None else [table.density for table in scene.particles]
    if not len(run.species) or not 0 <= run.species.min() <= run.species.max() < len(density):
        return volume, "m³"
    return volume * np.array(density)[run.species], "kg"


def _kinds(run: Run, scene: Scene | None) -> dict[str, NDArray[np.bool_]]:
    names = [] if scene is None else scene.species
    found = {int(k): names[k] if 0 <= k < len(names) else f"species {k}" for k in np.unique(run.species)}
    return {name: run.species == k for k, name in found.items()}


def _up(scene: Scene | None) -> Array | None:
    if scene is None or scene.gravity is None:
        return None
    down = np.array(scene.gravity.acceleration)
    size = float(np.linalg.norm(down))
    return -down / size if size else None


def _turning(scene: Scene | None, meshes: bool) -> tuple[Axis | None, float | None]:
    """Axis of what turns and the radius swept among the particles: of a rotor rather than of a turning vessel.

    Without the `meshes` of a scene the radius is unknown.
    """
    found: list[tuple[Axis, float | None]] = []
    for wall in () if scene is None else scene.walls:
        if isinstance(wall.motion, Rotation):
            along = np.array(wall.motion.axis) / np.linalg.norm(wall.motion.axis)
            found.append((Axis(np.array(wall.motion.point), along), swept_radius(wall) if meshes else None))
    return max(found, key=lambda pair: pair[1] or 0.0, default=(None, None))


def _period(scene: Scene | None) -> tuple[Array, Array] | None:
    if scene is None or scene.periodic is None:
        return None
    return np.array(scene.periodic.lowest), np.array(scene.periodic.period)


def _walls(scene: Scene | None) -> tuple[Bodies | None, str]:
    try:
        return (None, "") if scene is None else (walls_of(scene), "")
    except (InputError, OSError) as error:  # a mesh that is no longer where it was
        return None, f"the walls cannot be built again: {error}"
