"""Memory that a run takes at least, and that of the machine: a scene that cannot fit is refused before it is filled."""

import os

from sim.errors import InputError

OF_PARTICLE = 400  # bytes: state, forces and pair list of a particle with few neighbours
OF_CELL = 550  # bytes: fields of the fluid and its levels of the pressure solver


def machine_memory() -> int:
    """Return the bytes of memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_memory(field: str, count: int, each: int) -> None:
    """Raise InputError where so many particles or cells of so many bytes cannot fit into the machine."""
    if count * each > (most := machine_memory()):
        raise InputError(
            f"{field}: {count:.3g} of them take {count * each / 1e9:.3g} GB at least, and this machine has "
            f"{most / 1e9:.3g} GB of memory; ask for fewer than {most / each:.2g}, or use a larger machine"
        )
