"""Which snapshot interval Δτ is dense enough, decided before any surrogate is trained.

Reading order: `intervals` (which snapshots a candidate keeps), `gram` (the snapshots as inner products), `consistency`
(projection errors and their ratio R_c), `feasibility` (n_lr, n_c, K_f and the verdict), `resolution` (R_a), `sweep`
(all of it for every Δτ in one pass); `allocation` (what each of several variables gets under a limit they share).
"""

from selection.allocation import Allocation, allocate, allocate_alike
from selection.consistency import Consistency, Projection, consistency, project_from_factor, project_from_gram
from selection.errors import InputError
from selection.feasibility import Thresholds, consistent_mode, feasibility_index, least_reconstructable_mode
from selection.gram import ArraySnapshots, Snapshots
from selection.intervals import default_intervals, dense_interval
from selection.resolution import resolution_ratio
from selection.sweep import Candidate, Sweep, sweep

__all__ = [
    "Allocation",
    "ArraySnapshots",
    "Candidate",
    "Consistency",
    "InputError",
    "Projection",
    "Snapshots",
    "Sweep",
    "Thresholds",
    "allocate",
    "allocate_alike",
    "consistency",
    "consistent_mode",
    "default_intervals",
    "dense_interval",
    "feasibility_index",
    "least_reconstructable_mode",
    "project_from_factor",
    "project_from_gram",
    "resolution_ratio",
    "sweep",
]
