"""Surrogates of the coefficients of the modes: regressors that predict c(t) from what the snapshots show.

Reading order: `surrogate` (the contract), `series` (what may be learnt), `interpolant` and its members `linear`,
`spline`, `hermite`, `rbf` (with `kernel`, `leave_one_out`, `windows`), `state_map`, `network` (with `training`,
`regression`, `training_state`) and its members `mlp`, `lstm` (with `autoregression`), `cost`.

Coefficients are arrays (snapshots, modes), times seconds:

    surrogate = SURROGATES["rbf"]().fit(times, coefficients)
    between = surrogate.predict(other_times)
"""

from collections.abc import Mapping
from types import MappingProxyType

from surrogates.cost import Cost, measure_cost
from surrogates.errors import InputError
from surrogates.hermite import Hermite, RawHermite
from surrogates.linear import Linear, RawLinear
from surrogates.lstm import Lstm
from surrogates.mlp import Mlp
from surrogates.network import Network
from surrogates.rbf import Rbf
from surrogates.spline import Spline
from surrogates.surrogate import Surrogate

SURROGATES: Mapping[str, type[Surrogate]] = MappingProxyType(
    {member.name: member for member in (Rbf, Spline, Hermite, Linear, Mlp, Lstm, RawHermite, RawLinear)}
)

__all__ = [
    "SURROGATES",
    "Cost",
    "Hermite",
    "InputError",
    "Linear",
    "Lstm",
    "Mlp",
    "Network",
    "RawHermite",
    "RawLinear",
    "Rbf",
    "Spline",
    "Surrogate",
    "measure_cost",
]
