"""Surrogates of the coefficients of the modes: regressors that predict c(t) from what the snapshots show.

Reading order: `surrogate` (the contract), `series` (what may be learnt), `interpolant` and its members `linear`,
`spline`, `hermite`, `rbf` (with `kernel`, `leave_one_out`, `windows`), `cost`. Over operating conditions instead
of time: `conditions` (the contract), `between_conditions`, `condition_rbf`, `condition_mlp`, `condition_table`.

Coefficients are arrays (snapshots, modes), times seconds:

    surrogate = SURROGATES["rbf"]().fit(times, coefficients)
    between = surrogate.predict(other_times)
"""

from collections.abc import Mapping
from types import MappingProxyType

from surrogates.condition_table import CONDITION_SURROGATES
from surrogates.conditions import ConditionSurrogate
from surrogates.cost import Cost, measure_cost
from surrogates.errors import InputError
from surrogates.hermite import Hermite, RawHermite
from surrogates.linear import Linear, RawLinear
from surrogates.rbf import Rbf
from surrogates.spline import Spline
from surrogates.surrogate import Surrogate

SURROGATES: Mapping[str, type[Surrogate]] = MappingProxyType(
    {member.name: member for member in (Rbf, Spline, Hermite, Linear, RawHermite, RawLinear)}
)

__all__ = [
    "CONDITION_SURROGATES",
    "SURROGATES",
    "ConditionSurrogate",
    "Cost",
    "Hermite",
    "InputError",
    "Linear",
    "RawHermite",
    "RawLinear",
    "Rbf",
    "Spline",
    "Surrogate",
    "measure_cost",
]
