"""Scenes run by another program: dry ones on LAMMPS, over as many processes as MPI gives it.

Read `expressible` (what a deck can say of a scene), `regions` (its walls), `deck` (all of it), `lammps` (the program),
`observed` (what snapshots alone tell), `running` (from a scene to `run.h5`).
"""

from suffice.engine.running import check_options, simulate_on_lammps

__all__ = ["check_options", "simulate_on_lammps"]
