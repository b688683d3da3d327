"""Runs that somebody else's code made, read as a stream of snapshots.

Read `trajectory` (what every reader gives), `text` (plain or compressed files), `dump` (LAMMPS and LIGGGHTS), `clock`
(the physical time of a snapshot), `importing` (from the files to `run.h5`).
"""

from suffice.readers.importing import READERS, Imported, detect_format, import_run

__all__ = ["READERS", "Imported", "detect_format", "import_run"]
