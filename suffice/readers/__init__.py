"""Runs that somebody else's code made, read as a stream of snapshots.

Read `trajectory` (what every reader gives) and `clock` (the physical time of a snapshot). Then the readers: `text`,
`header`, `box`, `columns`, `restarts` and `dump` (LAMMPS and LIGGGHTS); `names` (what other codes call things),
`vtk_process` (VTK, kept apart), `pieces`, `parts`, `uniform` and `piece_run` (particles and fields from its datasets),
`series` and `vtk_files`, `hdf5` and `vtkhdf`, `foam_folders` and `openfoam`; `npz`, `datasets` and `arrays`. Last
`importing` (from the files to `run.h5`).
"""

from suffice.readers.importing import READERS, Imported, detect_format, import_run

__all__ = ["READERS", "Imported", "detect_format", "import_run"]
