"""What a snapshot is worth physically: overlaps, energy, mixing, void fraction, bed height, beads beside the rotor."""

from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.averaging import cell_width
from sim.mixing import lacey_index
from suffice.run import Run
from suffice.setting import Axis, Setting, setting_of
from suffice.solids import (
    Bins,
    Profile,
    frame_of,
    free_volumes,
    share_below,
    shells,
    slabs,
    void_fraction,
    wall_distances,
)
from suffice.swept import distance_from
from suffice.touching import pair_overlaps, wrapped

Array = NDArray[np.float64]
Observables = Mapping[str, float | Profile]


class Meaning(NamedTuple):
    """What an observable is, and how its error is counted."""

    text: str
    unit: str
    error: Literal[
        "created", "relative", "absolute"
    ]  # prediction less truth, in the unit, in % of the truth, or its size

    @property
    def error_unit(self) -> str:
        """Unit of the error."""
        return "%" if self.error == "relative" else self.unit


OBSERVABLES: Mapping[str, Meaning] = {
    "overlap.largest": Meaning("largest overlap of two particles", "d", "created"),
    "overlap.mean": Meaning("overlap of touching particles, mean over the pairs", "d", "created"),
    "overlap.pairs": Meaning("touching pairs per particle", "1", "created"),
    "overlap.walls": Meaning("largest overlap of a particle and a wall", "d", "created"),
    "kinetic_energy": Meaning("kinetic energy of translation", "J", "relative"),
    "mixing": Meaning("Lacey's mixing index", "1", "absolute"),
    "void_fraction.height": Meaning("void fraction against height, rms over slabs", "1", "absolute"),
    "void_fraction.axis": Meaning("void fraction along the axis, rms over slabs", "1", "absolute"),
    "void_fraction.radius": Meaning("void fraction against distance from the axis, rms over shells", "1", "absolute"),
    "bed_height": Meaning("bed height, that 99 % of the centres are below", "m", "relative"),
    "rotor_side": Meaning("share of the mass within a diameter outside what the rotor sweeps", "1", "absolute"),
}
# as the run's own series `bed_height` has it; the centre of mass, linear in positions, averages all errors away
SURFACE = 0.99
UNITS_OF_ENERGY = {"kg": "J", "m³": "J per kg/m³", "1": "m²/s² per particle"}


class Watch(NamedTuple):
    """What is observed in every snapshot of a run, prepared once."""

    setting: Setting
    bins: Mapping[str, Bins]  # of each void fraction profile
    floor: float  # m along gravity's axis, below which no particle reaches
    kinds: Mapping[
        str, tuple[NDArray[np.bool_], NDArray[np.bool_]]
    ]  # of each mixing index: who takes part, who is first
    corner: Array  # (3,) m from which cells of mixing are counted
    left_out: Mapping[str, str]  # observable -> reason
    notes: tuple[str, ...]  # how what is observed is meant in this run


class Room(NamedTuple):
    """The walls at one moment."""

    time: float  # s
    free: Mapping[str, Array]  # (bins,) m³ of each profile


def meaning_of(name: str) -> Meaning:
    """Return the meaning of an observable; `mixing.a.b` is the mixing index of species a and b."""
    return OBSERVABLES["mixing" if name.startswith("mixing") else name]


def watch_of(run: Run, snapshots: Iterable[int]) -> Watch:
    """Prepare the observation of a run, whose particles reach no farther than in these snapshots and the first.

    What the run does not support is named in `left_out` with its reason.
    """
    setting = setting_of(run)
    first = np.asarray(run.snapshot(0).values["position"], dtype=np.float64)
    places = [wrapped(first, setting.period)]
    places += [wrapped(np.asarray(run.snapshot(k).values["position"], np.float64), setting.period) for k in snapshots]
    left_out = _left_out(run, setting)
    bins = _bins(setting, places) if setting.diameter else {}
    up, corner = setting.up, np.min([place.min(axis=0) for place in places], axis=0)
    floor = 0.0 if up is None else min(float((place @ up).min()) for place in places) - 0.5 * (setting.diameter or 0.0)
    kinds, how = _kinds(setting, places[0])
    notes = [*how, *([f"weights: {setting.missing['density']}"] if "density" in setting.missing else [])]
    return Watch(setting, bins, floor, kinds if setting.diameter else {}, corner, left_out, tuple(notes))


def room_at(watch: Watch, time: float) -> Room:
    """Return what the walls leave free at a time (s); the same for every prediction of that moment."""
    return Room(time, {name: free_volumes(bins, watch.setting.walls, time) for name, bins in watch.bins.items()})


def observe(watch: Watch, room: Room, position: Array, velocity: Array | None = None) -> dict[str, float | Profile]:
    """Return the observables of one snapshot by name, in the units of `OBSERVABLES`.

    position: (n, 3) m; velocity: (n, 3) m/s, without which there is no kinetic energy.
    """
    s = watch.setting
    place = wrapped(position, s.period)
    found: dict[str, float | Profile] = {}
    if s.diameter:
        found |= _overlaps(s, room, position, place)
        found |= {
            f"void_fraction.{name}": void_fraction(bins, place, s.radius, room.free[name])
            for name, bins in watch.bins.items()
        }
        found |= _mixing(watch, place)
    if velocity is not None:
        found["kinetic_energy"] = 0.5 * float(s.weight @ np.einsum("ij,ij->i", velocity, velocity))
    if s.up is not None:
        found["bed_height"] = float(np.quantile(place @ s.up, SURFACE)) - watch.floor
    if s.axis is not None and s.swept is not None and s.diameter:
        found["rotor_side"] = rotor_side(s.axis, s.swept, s.diameter, place, s.radius, s.weight)
    return found


def rotor_side(axis: Axis, swept: float, diameter: float, position: Array, radius: Array, weight: Array) -> float:
    """Share of the weight that lies within a diameter (m) outside the radius that the rotor sweeps (m).

    A particle that is partly in the layer counts by its volume there, so that the share is smooth in its place.
    """
    away = distance_from(axis.point, axis.along, position)
    inside = share_below(away, radius, swept + diameter) - share_below(away, radius, swept)
    return float(weight @ inside) / float(weight.sum())


def observable_errors(truth: Observables, predicted: Observables) -> dict[str, float]:
    """Return the error of each observable that both have, in the unit of `meaning_of(name).error_unit`.

    Overlaps: prediction less truth, which is what the surrogate has created; kinetic energy and bed height: the same in
    % of the truth, NaN where that is zero; a profile: rms over its bins, weighted by the volume that walls leave free;
    others: prediction less truth.
    """
    return {name: _error(name, truth[name], predicted[name]) for name in truth if name in predicted}


def _error(name: str, truth: float | Profile, predicted: float | Profile) -> float:
    if isinstance(truth, Profile) and isinstance(predicted, Profile):
        known = np.isfinite(truth.values)
        miss = (predicted.values - truth.values)[known]
        return float(np.sqrt(np.average(miss**2, weights=truth.room[known])))
    assert not isinstance(truth, Profile)
    assert not isinstance(predicted, Profile)
    if meaning_of(name).error == "relative":
        return 100.0 * (predicted - truth) / truth if truth else float("nan")
    return predicted - truth


def _overlaps(s: Setting, room: Room, position: Array, place: Array) -> dict[str, float]:
    pairs = pair_overlaps(position, s.radius, s.period)
    found = {
        "overlap.largest": float(pairs.max(initial=0.0)),
        "overlap.mean": float(pairs.mean()) if len(pairs) else 0.0,
        "overlap.pairs": len(pairs) / len(position),
    }
    if s.walls is not None:
        deep = 0.5 * (1.0 - wall_distances(place, s.walls, room.time) / s.radius)
        found["overlap.walls"] = max(float(deep.max()), 0.0)
    return found


def _mixing(watch: Watch, place: Array) -> dict[str, float]:
    """Lacey's index of every two kinds in cubes of four diameters, which stay where they are."""
    cube = np.floor((place - watch.corner) / cell_width(watch.setting.radius)).astype(np.int64)
    _, cell = np.unique(cube, axis=0, return_inverse=True)
    cell = np.asarray(cell.reshape(-1), np.int64)
    return {name: lacey_index(first[part].astype(np.uint8), cell[part]) for name, (part, first) in watch.kinds.items()}


def _kinds(s: Setting, first: Array) -> tuple[dict[str, tuple[NDArray[np.bool_], NDArray[np.bool_]]], list[str]]:
    """Who mixes with whom: every two species, or the halves that one species had in the first snapshot."""
    if len(s.species) > 1:
        pairs = combinations(s.species.items(), 2)
        return {f"mixing.{a}.{b}": (one | other, one) for (a, one), (b, other) in pairs}, []
    spread = first.max(axis=0) - first.min(axis=0)
    along = np.eye(3)[int(np.argmax(spread))] if s.up is None else s.up
    what = "gravity" if s.up is not None else "xyz"[int(np.argmax(spread))]
    height = first @ along
    note = f"mixing of one species: of its two halves in the first snapshot along {what}"
    return {"mixing": (np.ones(len(first), bool), height > np.median(height))}, [note]


def _bins(s: Setting, places: list[Array]) -> dict[str, Bins]:
    """Slabs and shells within the box that the particles reach, or that repeats."""
    found, diameter = {}, s.diameter or 0.0
    direction = s.up if s.up is not None else None if s.axis is None else s.axis.along
    if direction is not None:
        frame = frame_of(direction)
        lowest, highest = _box([place @ frame.T for place in places], s)
        if s.period is not None:
            lowest, highest = _repeating(frame, s.period, lowest, highest)
        found["height" if s.up is not None else "axis"] = slabs(direction, lowest, highest, diameter)
    if s.axis is not None:
        axis, big = s.axis, float(s.radius.max())
        reach = max(float(distance_from(axis.point, axis.along, place).max()) for place in places) + big
        along = [(place - axis.point) @ axis.along for place in places]
        low, high = min(float(a.min()) for a in along) - big, max(float(a.max()) for a in along) + big
        found["radius"] = shells(axis, reach, low, high, diameter)
    return found


def _box(places: list[Array], s: Setting) -> tuple[Array, Array]:
    edge = s.radius[:, None]
    lowest = np.min([(place - edge).min(axis=0) for place in places], axis=0)
    return lowest, np.max([(place + edge).max(axis=0) for place in places], axis=0)


def _repeating(frame: Array, period: tuple[Array, Array], lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Cut the box to the period in directions of the frame that lie along one that repeats."""
    low, length = period
    axis = np.argmax(np.abs(frame), axis=1)
    repeats = (np.abs(frame).max(axis=1) > 1.0 - 1e-9) & (length[axis] > 0.0)
    ends = np.array([frame @ low, frame @ (low + length)])
    return np.where(repeats, ends.min(axis=0), lowest), np.where(repeats, ends.max(axis=0), highest)


def _left_out(run: Run, s: Setting) -> dict[str, str]:
    """Name what the run does not support, and why."""
    found: dict[str, str] = {}
    if not s.diameter:
        reason = "the run does not know every radius; import it again with its diameter"
        found = dict.fromkeys(("overlap", "void_fraction", "mixing", "rotor_side"), reason)
    elif s.walls is None:
        found["overlap.walls"] = f"walls: {s.missing['walls']}"
    if "velocity" not in run.quantities:
        found["kinetic_energy"] = "the run holds no velocities to compare with"
    if s.up is None:
        found["bed_height"] = f"gravity: {s.missing['gravity']}"
    if s.axis is None:
        found |= dict.fromkeys(("void_fraction.radius", "rotor_side"), f"axis: {s.missing['axis']}")
    elif s.swept is None:
        found["rotor_side"] = f"rotor: {s.missing['rotor']}"
    if s.up is None and s.axis is None:
        found["void_fraction.height"] = "neither gravity nor an axis gives a direction"
    return found
