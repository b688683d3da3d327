"""Which snapshot interval Δτ is dense enough, decided before any surrogate is trained.

Reading order: `intervals` (which snapshots a candidate keeps), `gram` (the snapshots as inner products), `consistency`
(projection errors and their ratio R_c), `feasibility` (n_lr, n_c, K_f and the verdict), `resolution` (R_a), `candidate`
(all of it for one Δτ), `sweep` (for every Δτ in one pass), `coarse` (a run without a denser one beside it), `forecast`
(a run that goes on), `allocation` (what each of several variables gets under a limit they share).
"""

from selection.allocation import Allocation, allocate, allocate_alike
from selection.candidate import Candidate
from selection.coarse import Bounded, Coarse, intervals_without_truth, without_truth
from selection.consistency import Consistency, Projection, consistency, project_from_factor, project_from_gram
from selection.errors import InputError
from selection.feasibility import Thresholds, consistent_mode, feasibility_index, least_reconstructable_mode
from selection.forecast import Forecast, Foreseen, Growth, check_duration, forecast, growth_of_modes
from selection.gram import ArraySnapshots, InnerProducts, Snapshots, inner_products, square_root
from selection.intervals import default_intervals, dense_interval
from selection.resolution import interpolated, promise_ratio, resolution_ratio, spline_errors
from selection.sweep import Sweep, is_sufficient, judge, sweep

__all__ = [
    "Allocation",
    "ArraySnapshots",
    "Bounded",
    "Candidate",
    "Coarse",
    "Consistency",
    "Forecast",
    "Foreseen",
    "Growth",
    "InnerProducts",
    "InputError",
    "Projection",
    "Snapshots",
    "Sweep",
    "Thresholds",
    "allocate",
    "allocate_alike",
    "check_duration",
    "consistency",
    "consistent_mode",
    "default_intervals",
    "dense_interval",
    "feasibility_index",
    "forecast",
    "growth_of_modes",
    "inner_products",
    "interpolated",
    "intervals_without_truth",
    "is_sufficient",
    "judge",
    "least_reconstructable_mode",
    "project_from_factor",
    "project_from_gram",
    "promise_ratio",
    "resolution_ratio",
    "spline_errors",
    "square_root",
    "sweep",
    "without_truth",
]
