"""What the arrays of other codes are called, and which of them is what here."""

import re
from collections.abc import Mapping, Sequence

from suffice.refusal import Refusal

# without case, underscores and units; LIGGGHTS, LAMMPS, Yade, MFiX, OpenFOAM, CFDEM
PARTICLES: Mapping[str, Sequence[str]] = {
    "id": ("id", "ids", "particleid", "globalid", "origid"),
    "velocity": ("velocity", "velocities", "v", "vel", "u", "linvelvec", "velocitylin", "translationalvelocity"),
    "angular_velocity": ("angularvelocity", "omega", "angvelvec", "velocityang", "rotationalvelocity", "angularvel"),
    "radius": ("radius", "radii", "particleradius"),
    "diameter": ("diameter", "d", "particlediameter"),
    "species": ("type", "species", "phaseid", "particlephaseid", "materialid", "typeid"),
}
CELLS: Mapping[str, Sequence[str]] = {
    "fluid.velocity": ("u", "velocity", "gasvelocity", "fluidvelocity"),
    "fluid.pressure": ("p", "pressure", "pg", "gaspressure", "fluidpressure"),
    "fluid.void_fraction": ("voidfraction", "epg", "porosity", "alphaphase"),
}
THREES: Mapping[str, Sequence[str]] = {
    "velocity": ("vx", "vy", "vz"),
    "angular_velocity": ("omegax", "omegay", "omegaz"),
    "fluid.velocity": ("U_G", "V_G", "W_G"),
}
BORN_AT = ("origprocid", "origproc")  # with origid: OpenFOAM numbers the parcels of every processor from 0
OTHERS = ("position", "time", "grid.origin", "grid.spacing", "cloud", "fluid")  # that --map knows as well
KNOWN = (*PARTICLES, *CELLS, *OTHERS)


def parse_map(texts: Sequence[str]) -> dict[str, str]:
    """Return what is called how, from texts such as `velocity=U.air`. Raises `Refusal` for anything else."""
    found: dict[str, str] = {}
    for text in texts:
        what, equals, name = text.partition("=")
        if not equals or not name or what not in KNOWN:
            raise Refusal(f"--map {text!r} is not understood; write WHAT=NAME, WHAT one of {', '.join(KNOWN)}")
        if what in found:
            raise Refusal(f"--map {what} is given twice; leave one out")
        found[what] = name
    return found


def find_names(
    known: Sequence[str], wanted: Mapping[str, Sequence[str]], mapped: Mapping[str, str], where: str
) -> dict[str, tuple[str, ...]]:
    """Return which arrays each wanted thing is made of, one or three, by `mapped` or else by their names.

    Raises `Refusal` where a mapped name is not among those known, or two could be meant.
    """
    found: dict[str, tuple[str, ...]] = {}
    for what, names in wanted.items():
        if what in mapped:
            found[what] = (_mapped(known, what, mapped[what], where),)
            continue
        meant = [name for name in known if plain(name) in names]
        if len(meant) > 1:
            raise Refusal(f"{where}: {' and '.join(meant)} may be {what}; say which one with --map {what}={meant[0]}")
        if meant:
            found[what] = (meant[0],)
        elif what in THREES and set(THREES[what]) <= set(known):
            found[what] = tuple(THREES[what])
    return found


def _mapped(known: Sequence[str], what: str, name: str, where: str) -> str:
    exact = [each for each in known if name in (each, each.partition(" [")[0])]
    if not exact:
        raise Refusal(f"--map {what}={name}: {where} has no such array; it has {', '.join(known) or 'none'}")
    return exact[0]


def find_ids(known: Sequence[str], id_name: str) -> tuple[str, ...]:
    """Return the arrays that together are the ids: of OpenFOAM also the processor where a parcel was born."""
    born_at = [name for name in known if plain(name) in BORN_AT]
    return (id_name, *born_at[:1]) if plain(id_name) == "origid" else (id_name,)


def plain(name: str) -> str:
    """Return a name without unit, phase, case and underscores: `u` of `U.air [m/s]`, `alphaphase` of `alpha.air`."""
    base, dot, _ = name.partition(" [")[0].partition(".")
    text = re.sub(r"[^a-z0-9]", "", base.lower())
    return f"{text}phase" if dot and text == "alpha" else text
