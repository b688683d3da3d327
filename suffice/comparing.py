"""The stage of a study in which surrogates are trained and compared."""

from collections.abc import Mapping
from typing import Any, TypedDict

from pydantic import Field

from suffice.beyond import compare_beyond
from suffice.choice import DIAMETERS, Limits, parse_error
from suffice.compare import compare, decided, known_surrogates
from suffice.making import is_trained
from suffice.progress import Reporter
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.stages import Positive, Settings
from suffice.watched import compare_observables
from surrogates import SURROGATES


class Networks(Settings):
    """Which networks are trained beside the other surrogates, and where: each takes seconds."""

    surrogates: list[str] = Field(default=["mlp", "lstm"], min_length=1)
    variables: list[str] = Field(min_length=1)
    intervals: list[Positive] = Field(min_length=1, description="Δτ, s")
    seeds: int = Field(default=1, ge=1, description="trainings of each")
    training_seconds: float | None = Field(default=None, gt=0, description="of each training at most, s")


class Comparing(Settings):
    """What is trained and compared."""

    variables: list[str] | None = Field(default=None, description="absent: components of position and velocity")
    intervals: list[Positive] | None = Field(default=None, description="Δτ, s; absent: ten to two dense intervals")
    surrogates: list[str] | None = Field(default=None, description="absent: all that need no training")
    max_error: Positive | str | None = Field(
        default=None, description='RMSE: a number of diameters, or text with a unit, "0.05d" or "0.1m/s"'
    )
    max_seconds: float | None = Field(default=None, gt=0, description="per snapshot, s")
    max_bytes: float | None = Field(default=None, gt=0, description="to keep, of one variable")
    networks: Networks | None = None
    observables: list[Positive] = Field(default=[], description="Δτ at which observables are compared, s")
    beyond: list[Positive] = Field(
        default=[], description="Δτ at which what follows the first two thirds is predicted, s"
    )

    @property
    def error_limit(self) -> tuple[float | None, str]:
        """Limit on the error and its unit, `d` for diameters. Raises Refusal for text that is no error."""
        return parse_error(self.max_error) if isinstance(self.max_error, str) else (self.max_error, DIAMETERS)

    def check(self) -> None:
        """Raise Refusal for a surrogate that there is not, or a limit that is none."""
        self.error_limit  # noqa: B018 - it raises
        known_surrogates(self.surrogates)
        if self.networks is not None:
            known_surrogates(self.networks.surrogates)


class Means(TypedDict, total=False):
    """What n_lr and n_c mean where a study has thresholds of its own; absent: the paper's."""

    energy: float
    consistency: float


def compare_as_wished(
    run: Run, wish: Comparing, thresholds: Mapping[str, float], seed: int, reporter: Reporter
) -> dict[str, Any]:
    """Compare surrogates, networks where wanted, observables, and what lies beyond the window; ready for JSON.

    thresholds: those of the verdict that a study changes, so that n_lr and n_c mean the same in both.
    """
    means, (max_error, unit) = _means(thresholds), wish.error_limit
    with reporter.stage("compare", "cases") as advance:
        answer: dict[str, Any] = compare(
            run,
            wish.variables,
            wish.intervals,
            wish.surrogates,
            max_error=max_error,
            error_unit=unit,
            max_seconds=wish.max_seconds,
            max_bytes=wish.max_bytes,
            seed=seed,
            progress=advance,
            **means,
        )
    if wish.networks is not None:
        answer = _with_networks(run, answer, wish.networks, means, seed, reporter)
    watched = []
    for interval in wish.observables:
        with reporter.stage("observe", "surrogates") as advance:
            watched.append(
                compare_observables(
                    run,
                    interval,
                    wish.surrogates,
                    energy=thresholds_of("position", thresholds).energy,
                    seed=seed,
                    progress=advance,
                )
            )
    return {**answer, "observables": watched, "beyond": _foreseen(run, wish, means, seed, reporter)}


def _means(thresholds: Mapping[str, float]) -> Means:
    found = Means()
    if "energy" in thresholds:
        found["energy"] = thresholds["energy"]
    if "consistency" in thresholds:
        found["consistency"] = thresholds["consistency"]
    return found


def _foreseen(run: Run, wish: Comparing, means: Means, seed: int, reporter: Reporter) -> list[dict[str, Any]]:
    """Predict beyond the window at each Δτ that is wanted, with all surrogates that need no training."""
    quick, found = [name for name in SURROGATES if not is_trained(name)], []
    for interval in wish.beyond:
        with reporter.stage("foresee", "variables") as advance:
            found.append(compare_beyond(run, wish.variables, interval, quick, seed=seed, progress=advance, **means))
    return found


def _with_networks(
    run: Run, answer: dict[str, Any], wish: Networks, means: Means, seed: int, reporter: Reporter
) -> dict[str, Any]:
    """Add networks to a comparison; fronts, winners and choices are those of all rows."""
    with reporter.stage("train", "cases") as advance:
        more = compare(
            run,
            wish.variables,
            wish.intervals,
            wish.surrogates,
            seed=seed,
            seeds=wish.seeds,
            training_seconds=wish.training_seconds,
            progress=advance,
            **means,
        )
    rows, limits = answer["rows"] + more["rows"], Limits(**answer["limits"])
    known = {(base["variable"], base["interval"], base["basis"]) for base in answer["bases"]}
    return {
        **answer,
        "seeds": wish.seeds,
        "rows": rows,
        "bases": answer["bases"]
        + [b for b in more["bases"] if (b["variable"], b["interval"], b["basis"]) not in known],
        "left_out": answer["left_out"] + more["left_out"],
        **decided(rows, answer["choice"], limits, answer["diameter"]),
    }
