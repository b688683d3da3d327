"""Surrogates of the coefficients of the modes: regressors that predict c(t) from what the snapshots show.

Reading order: `surrogate` (the contract), `series` (what may be learnt), `interpolant` and its members `linear`,
`spline`, `hermite`, `rbf` (with `kernel`, `leave_one_out`, `windows`), `gp` (with `matern`, `kalman`), `persistence`,
`ballistic`; `state_map` and its members `dmd` (with `past`, `companion`) and `rbf_map`; `network` (with `training`,
`regression`, `training_state`) and its members `mlp` and `lstm` (with `autoregression`); `cost`. Over operating
conditions instead of time: `conditions` (the contract), `between_conditions`, `condition_rbf`, `condition_mlp`,
`condition_table`.

Coefficients are arrays (snapshots, modes), times seconds:

    >>> times = [0.0, 0.1, 0.2, 0.3]
    >>> coefficients = [[t**2, 1.0 - t] for t in times]
    >>> surrogate = SURROGATES["spline"]().fit(times, coefficients)
    >>> surrogate
    Spline(), fitted from 0 to 0.3 s, every 0.1 s
    >>> surrogate.predict([0.05, 0.25]).round(6).tolist()
    [[0.0025, 0.95], [0.0625, 0.75]]
"""

from collections.abc import Mapping
from types import MappingProxyType

from surrogates.ballistic import Ballistic
from surrogates.condition_table import CONDITION_SURROGATES
from surrogates.conditions import ConditionSurrogate
from surrogates.cost import Cost, measure_cost
from surrogates.dmd import Dmd
from surrogates.errors import InputError
from surrogates.gp import Gp
from surrogates.hermite import Hermite, RawHermite
from surrogates.linear import Linear, RawLinear
from surrogates.lstm import Lstm
from surrogates.mlp import Mlp
from surrogates.network import Network
from surrogates.persistence import Persistence
from surrogates.rbf import Rbf
from surrogates.rbf_map import RbfMap
from surrogates.spline import Spline
from surrogates.state_map import StateMap
from surrogates.surrogate import Surrogate

SURROGATES: Mapping[str, type[Surrogate]] = MappingProxyType(
    {
        member.name: member
        for member in (
            *(Rbf, Spline, Hermite, Gp, Linear),
            *(Dmd, RbfMap),
            *(Mlp, Lstm),
            *(RawHermite, RawLinear, Ballistic, Persistence),
        )
    }
)

__all__ = [
    "CONDITION_SURROGATES",
    "SURROGATES",
    "Ballistic",
    "ConditionSurrogate",
    "Cost",
    "Dmd",
    "Gp",
    "Hermite",
    "InputError",
    "Linear",
    "Lstm",
    "Mlp",
    "Network",
    "Persistence",
    "RawHermite",
    "RawLinear",
    "Rbf",
    "RbfMap",
    "Spline",
    "StateMap",
    "Surrogate",
    "measure_cost",
]
