"""The stage of a study in which surrogates are trained and compared."""

from typing import Any

from pydantic import Field

from suffice.beyond import compare_beyond
from suffice.choice import Limits
from suffice.compare import compare, decided, known_surrogates
from suffice.making import is_trained
from suffice.progress import Reporter
from suffice.run import Run
from suffice.stages import Settings
from suffice.watched import compare_observables
from surrogates import SURROGATES


class Networks(Settings):
    """Which networks are trained beside the other surrogates, and where: each takes seconds."""

    surrogates: list[str] = Field(default=["mlp", "lstm"], min_length=1)
    variables: list[str] = Field(min_length=1)
    intervals: list[float] = Field(min_length=1, description="Δτ, s")
    seeds: int = Field(default=1, ge=1, description="trainings of each")
    training_seconds: float | None = Field(default=None, gt=0, description="of each training at most, s")


class Comparing(Settings):
    """What is trained and compared."""

    variables: list[str] | None = None
    intervals: list[float] | None = Field(default=None, description="Δτ, s")
    surrogates: list[str] | None = None
    max_error: float | None = Field(default=None, gt=0, description="in diameters")
    max_seconds: float | None = Field(default=None, gt=0, description="per snapshot, s")
    max_bytes: float | None = Field(default=None, gt=0, description="to keep, of one variable")
    networks: Networks | None = None
    observables: list[float] = Field(default=[], description="Δτ at which observables are compared, s")
    beyond: list[float] = Field(default=[], description="Δτ at which what follows the first two thirds is predicted, s")

    def check(self) -> None:
        """Raise Refusal for a surrogate that there is not."""
        known_surrogates(self.surrogates)
        if self.networks is not None:
            known_surrogates(self.networks.surrogates)


def compare_as_wished(run: Run, wish: Comparing, seed: int, reporter: Reporter) -> dict[str, Any]:
    """Compare surrogates, networks where wanted, observables, and what lies beyond the window; ready for JSON."""
    with reporter.stage("compare", "cases") as advance:
        answer: dict[str, Any] = compare(
            run,
            wish.variables,
            wish.intervals,
            wish.surrogates,
            max_error=wish.max_error,
            error_unit="d",
            max_seconds=wish.max_seconds,
            max_bytes=wish.max_bytes,
            seed=seed,
            progress=advance,
        )
    if wish.networks is not None:
        answer = _with_networks(run, answer, wish.networks, seed, reporter)
    watched = []
    for interval in wish.observables:
        with reporter.stage("observe", "surrogates") as advance:
            watched.append(compare_observables(run, interval, wish.surrogates, seed=seed, progress=advance))
    return {**answer, "observables": watched, "beyond": _foreseen(run, wish, seed, reporter)}


def _foreseen(run: Run, wish: Comparing, seed: int, reporter: Reporter) -> list[dict[str, Any]]:
    """Predict beyond the window at each Δτ that is wanted, with all surrogates that need no training."""
    quick, found = [name for name in SURROGATES if not is_trained(name)], []
    for interval in wish.beyond:
        with reporter.stage("foresee", "variables") as advance:
            found.append(compare_beyond(run, wish.variables, interval, quick, seed=seed, progress=advance))
    return found


def _with_networks(run: Run, answer: dict[str, Any], wish: Networks, seed: int, reporter: Reporter) -> dict[str, Any]:
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
