"""What a scene would do, before it is run: its terms and their cost, the time step, and advice."""

from typing import Any

import numba

from sim import InputError, Scene, simulation_of
from sim.assembly import walls_of
from sim.cost import StepCost, memory_of, step_cost
from sim.filling import BULK_SOLIDS, Region, region_of, solid_fraction
from sim.impact import SMALL_OVERLAP, expected_speeds, overlaps_at, stiffness_for
from sim.simulation import Simulation
from sim.timestep import time_limits
from suffice import layout
from suffice.quantities import QUANTITIES
from suffice.recording import values_of
from suffice.refusal import Refusal
from suffice.starting import read_start
from suffice.store import DTYPES
from suffice.thinning import finest_halving
from suffice.watching import UNWATCHED, Watching
from suffice.wording import bytes_text, number, seconds_text


def explain(scene: Scene, watching: Watching = UNWATCHED) -> dict[str, Any]:
    """Return, in plain types, what a scene is made of, what it costs and what is advised; nothing is written.

    The cost is measured over the first steps; of watching the memory is told. Raises InputError or Refusal for a scene
    that cannot start, and LimitError where a limit is violated in those steps.
    """
    run = simulation_of(scene, read_start(scene))
    if not isinstance(run, Simulation):
        raise Refusal("--explain: the scene has no particles; run it, its steps are those of the fluid alone")
    answer = {
        "particles": _particles(run),
        "time_step": _time_step(run),
        "impact": _impact(run),
        "terms": [],
        "left_out": _left_out(scene),
    }
    watch, tolerance = watching.by(run, list(values_of(run.snapshot()))), watching.tolerance(run)
    if watch is not None:
        found = {"variables": list(watch.variables), "checks": watch.checks, "memory_bytes": watch.bytes_needed}
        answer["watching"] = found
    if tolerance is not None:
        times = 1 << finest_halving(run.steps_per_snapshot)
        answer["keeping"] = {"tolerance": tolerance, "finest_interval": scene.output.interval / times, "room": times}
    memory = memory_of(run)
    cost = step_cost(run)
    return answer | {"terms": _terms(scene, memory, cost), "cost": _cost(run, cost)}


def _region(run: Simulation) -> Region | None:
    try:
        return region_of(run.scene, walls_of(run.scene))
    except InputError:
        return None


def _particles(run: Simulation) -> dict[str, Any]:
    p = run.particles
    species = []
    for k, name in enumerate(run.scene.species):
        radius = p.radius[p.species == k]
        sizes = [2.0 * float(radius.min()), 2.0 * float(radius.max())] if len(radius) else []
        species.append({"name": name, "count": len(radius), "diameters": sizes})
    fraction = solid_fraction(run.scene, walls_of(run.scene), p.radius)
    degree = None if fraction is None else fraction / BULK_SOLIDS
    return {"count": len(p.radius), "species": species, "volume_fraction": fraction, "filling_degree": degree}


def _time_step(run: Simulation) -> dict[str, Any]:
    limits = time_limits(run.scene)
    binding = min(limits, key=lambda limit: limit.advised)
    return {
        "step": run.dt,
        "asked_for": run.scene.time.step,
        "binding": binding.term,
        "limits": [
            {"term": one.term, "advised": _finite(one.advised), "largest": _finite(one.largest)} for one in limits
        ],
        "steps": (run.snapshots - 1) * run.steps_per_snapshot,
        "steps_per_snapshot": run.steps_per_snapshot,
    }


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None


def _impact(run: Simulation) -> dict[str, Any]:
    """Say how fast particles may meet, how deep they overlap then, and what stiffness would keep it to 2 %."""
    speeds = expected_speeds(run.scene, run.particles, run.walls, _region(run))
    if not speeds:
        return {"speeds": [], "largest": None, "overlap": {}, "stiffness": {}}
    largest = max(speeds)
    return {
        "speeds": [one._asdict() for one in speeds],
        "largest": largest.speed,
        "overlap": overlaps_at(run.scene, largest.speed),
        "stiffness": stiffness_for(run.scene, largest.speed),
    }


def _terms(scene: Scene, memory: dict[str, int], cost: StepCost) -> list[dict[str, Any]]:
    """Rows of term, what it is, bytes, and seconds per step."""
    law = scene.contact
    rubs = f"friction {law.friction:g}" if law.friction else "no friction"
    rolls = f", rolling friction {law.rolling.friction:g}" if law.rolling else ""
    pairs = f", {len(scene.pair_contact)} pairs of species with their own" if scene.pair_contact else ""
    what = f"linear spring, restitution {law.restitution:g}, {rubs}{rolls}{pairs}"
    rows = [("contact", what, memory["pairs"], cost.pairs)]
    if scene.walls:
        moving = [table.name for table in scene.walls if table.motion is not None]
        bodies = (
            f"{len(scene.walls)} bod{'ies' if len(scene.walls) > 1 else 'y'}, moving: {', '.join(moving) or 'none'}"
        )
        bounce = ", ".join(f"{e:g}" for e in sorted({contact.restitution for contact in scene.contacts_with_walls}))
        what = f"{bodies}; restitution {bounce}"
        rows.append(("walls", what, memory["walls"], cost.walls))
    rows.append(("lists", "who may touch whom, when particles have moved", 0, cost.lists))
    repeats = f", periodic in {', '.join(scene.periodic.directions)}" if scene.periodic else ""
    weight = f"velocity Verlet{', gravity' if scene.gravity else ''}{repeats}"
    rows.append(("motion", weight, memory["particles"] + memory["forces"], cost.motion))
    rows += _of_fluid(scene, memory, cost)
    return [{"term": t, "what": w, "bytes": b, "seconds_per_step": s} for t, w, b, s in rows]


def _of_fluid(scene: Scene, memory: dict[str, int], cost: StepCost) -> list[tuple[str, str, int, float]]:
    """Rows of the terms of the fluid."""
    if scene.fluid is None:
        return []
    x, y, z = scene.fluid.cells
    drag = "none" if scene.drag is None else f"{scene.drag.law}, {scene.drag.coupling}"
    bodies = ", ".join(wall.name for wall in scene.walls if wall.immersed)
    what = {
        "momentum": f"{x} x {y} x {z} cells, convection {scene.fluid.convection}, implicit viscosity",
        "pressure": "conjugate gradients, multigrid",
        "exchange": f"drag {drag}",
        "immersed": f"bodies {bodies}" if bodies else "",
    }
    rows = [(name, what[name], memory["fluid"] if name == "momentum" else 0, cost.fluid[name]) for name in what]
    return [row for row in rows if row[1]]


def _left_out(scene: Scene) -> list[str]:
    """Names of the tables that the scene does not have, and of friction where nothing rubs."""
    absent = [name for name in Scene.model_fields if getattr(scene, name) is None or getattr(scene, name) == []]
    return [*absent, *([] if scene.turns else ["friction and spin"])]


def _cost(run: Simulation, cost: StepCost) -> dict[str, Any]:
    n, steps = len(run.particles.radius), (run.snapshots - 1) * run.steps_per_snapshot
    variables = ["position", "velocity", *(["angular_velocity"] if run.particles.spin is not None else [])]
    shapes = [layout.shape_of(QUANTITIES[name], run.snapshots, n, None) for name in variables]
    return {
        "measured_steps": cost.steps,
        "threads": numba.get_num_threads(),
        "seconds_per_step": cost.whole,
        "particle_steps_per_second": n / cost.whole,
        "seconds": cost.whole * steps,
        "snapshots": run.snapshots,
        "file_bytes": layout.bytes_of(shapes, DTYPES[run.scene.output.precision].itemsize),
        "memory_bytes": sum(memory_of(run).values()),
    }


def explanation_text(name: str, answer: dict[str, Any]) -> str:
    """Return the explanation as lines of at most 100 columns."""
    lines = [name, *_about_particles(answer["particles"]), *_about_terms(answer), *_about_step(answer["time_step"])]
    lines += [*_about_impact(answer["impact"]), *_about_cost(answer["cost"])]
    return "\n".join([*lines, *_about_watching(answer)])


def _about_watching(answer: dict[str, Any]) -> list[str]:
    lines = []
    if found := answer.get("watching"):
        asked = f"judged {len(found['checks'])} times at most, from {found['checks'][0]} snapshots on"
        held = f"{bytes_text(found['memory_bytes'])} more memory"
        lines.append(f"  {'watching':<10} {', '.join(found['variables'])}: {asked}; {held}")
    if found := answer.get("keeping"):
        looked = f"looked at every {seconds_text(found['finest_interval'])} where needed"
        room = f"the file has room for {found['room']} times its snapshots until it is whole"
        lines.append(f"  {'keeping':<10} within {number(found['tolerance'])} m, {looked}; {room}")
    return lines


def _about_particles(found: dict[str, Any]) -> list[str]:
    lines = []
    for species in found["species"]:
        low, high = [f"{1e3 * d:.4g}" for d in species["diameters"]] or ["–", "–"]
        size = low if low == high else f"{low} to {high}"
        lines.append(f"  {'particles':<10} {species['count']} of {size} mm ({species['name']})")
    if found["volume_fraction"] is not None:
        share = f"{100 * found['volume_fraction']:.1f} % of the free volume is solid"
        lines.append(f"  {'packing':<10} {share}, a filling degree of {100 * found['filling_degree']:.0f} %")
    return lines


def _about_terms(answer: dict[str, Any]) -> list[str]:
    whole = answer["cost"]["seconds_per_step"]
    lines = ["", f"  {'term':<10} {'':<56} {'memory':>10} {'per step':>10} {'share':>6}"]
    for row in answer["terms"]:
        share = f"{100 * row['seconds_per_step'] / whole:.0f} %"
        memory = bytes_text(row["bytes"]) if row["bytes"] else "–"
        spent = seconds_text(row["seconds_per_step"])
        lines.append(f"  {row['term']:<10} {row['what'][:56]:<56} {memory:>10} {spent:>10} {share:>6}")
    measured = f"measured over {answer['cost']['measured_steps']} steps from the start; a denser flow costs more"
    return [*lines, f"  {'left out':<10} {', '.join(answer['left_out']) or 'nothing'}", f"  {'':<10} {measured}"]


def _about_step(found: dict[str, Any]) -> list[str]:
    asked = "" if found["asked_for"] is None else f" (asked for: {seconds_text(found['asked_for'])})"
    step = f"{seconds_text(found['step'])}{asked}, {found['steps_per_snapshot']} a snapshot, {found['steps']} in all"
    lines = ["", f"  {'time step':<10} {step}"]
    for limit in sorted(found["limits"], key=lambda one: one["advised"] or float("inf")):
        label = "binds" if limit["term"] == found["binding"] else ""
        sizes = f"advised {seconds_text(limit['advised']):>8}, at most {seconds_text(limit['largest']):>8}"
        lines.append(f"  {label:<10} {limit['term']:<46} {sizes}")
    return lines


def _about_impact(found: dict[str, Any]) -> list[str]:
    lines = [""]
    lines += [f"  {'speed':<10} {number(one['speed'])} m/s: {one['source']}" for one in found["speeds"]]
    for name, overlap in found["overlap"].items():
        deep = f"{100 * overlap:.2g} % of a diameter at {number(found['largest'])} m/s"
        advised = f"{100 * SMALL_OVERLAP:.0f} % needs {name}.stiffness = {number(found['stiffness'][name], 2)} N/m"
        lines.append(f"  {'overlap':<10} {deep}; {advised}")
    return lines if len(lines) > 1 else []


def _about_cost(found: dict[str, Any]) -> list[str]:
    speed = f"{found['particle_steps_per_second'] / 1e6:.3g} million particle-steps/s with --threads {found['threads']}"
    return [
        "",
        f"  {'run':<10} about {seconds_text(found['seconds'])} at {speed}",
        f"  {'file':<10} {bytes_text(found['file_bytes'])} for {found['snapshots']} snapshots",
        f"  {'memory':<10} {bytes_text(found['memory_bytes'])}",
    ]
