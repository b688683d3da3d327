"""What a surrogate costs: seconds to fit, seconds to ask, bytes to keep."""

from statistics import median
from time import perf_counter
from typing import NamedTuple

from numpy.typing import ArrayLike

from surrogates.series import checked_times
from surrogates.surrogate import Surrogate


class Cost(NamedTuple):
    """Measured cost of one fitted surrogate."""

    fit_seconds: float  # wall time of the last `fit`; NaN in a loaded model
    single_seconds: float  # one prediction of one snapshot
    batch_seconds: float  # one snapshot when all are asked for at once
    model_bytes: int  # arrays that `state` saves; of a raw baseline, the snapshots themselves


def measure_cost(
    surrogate: Surrogate, times: ArrayLike, start: ArrayLike | None = None, *, beyond: bool = False, repeats: int = 3
) -> Cost:
    """Cost of a fitted surrogate asked for `times` (at least one,) s: medians of `repeats` runs."""
    asked = checked_times(times)
    middle = asked[len(asked) // 2 :][:1]

    def seconds(batch: ArrayLike) -> float:
        begin = perf_counter()
        surrogate.predict(batch, start, beyond=beyond)
        return perf_counter() - begin

    return Cost(
        surrogate.fit_seconds_,
        median(seconds(middle) for _ in range(repeats)),
        median(seconds(asked) for _ in range(repeats)) / len(asked),
        sum(array.nbytes for array in surrogate.arrays().values()),
    )
