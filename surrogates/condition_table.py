"""The regressors over conditions by name."""

from collections.abc import Mapping
from types import MappingProxyType

from surrogates.between_conditions import LinearCondition, NearestCondition
from surrogates.condition_mlp import MlpCondition
from surrogates.condition_rbf import RbfCondition
from surrogates.conditions import ConditionSurrogate

CONDITION_SURROGATES: Mapping[str, type[ConditionSurrogate]] = MappingProxyType(
    {member.name: member for member in (NearestCondition, LinearCondition, RbfCondition, MlpCondition)}
)
