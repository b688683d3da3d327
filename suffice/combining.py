"""From a run to a combined model: each variable with its own Δτ and number of modes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from suffice.combined import TOLD, begin, check_combined_place, check_plan, finish, read_told_card, tells
from suffice.door import InterruptedRunError
from suffice.lock import only_writer_in
from suffice.model import read_model_card, training_stands
from suffice.planning import Part, Plan, Wanted, parse_limits, plan_parts
from suffice.progress import Reporter
from suffice.quantities import whole_of
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.training import Wish, check_wish, train_model
from suffice.variables import default_variables


class Request(NamedTuple):
    """What is trained, and how long."""

    surrogate: str
    variables: list[str] | None = None  # default the components of position and of velocity
    intervals: list[float] | None = None  # s, one or several to choose from
    max_error: list[str] | None = None  # such as 0.05d, one for each unit
    finest: bool = False
    modes: int | None = None  # of a single variable at a single Δτ
    energy: float | None = None
    seed: int = 0
    max_seconds: float | None = None
    resume: bool = False


def train(source: Path, folder: Path, request: Request, reporter: Reporter) -> dict[str, Any]:
    """Train what is asked for and return its card: an ordinary model of one variable, a combined one of several.

    The run is opened once, so that all parts are of the same snapshots where it grows or is replaced meanwhile.
    Raises Refusal, and the InputErrors of pod and surrogates, for what cannot be used.
    """
    with Run(source) as run:
        names = default_variables(run) if request.variables is None else list(dict.fromkeys(request.variables))
        limits = parse_limits(request.max_error, run)
        _check(run, names, request, limits)
        check_combined_place(folder)
        with only_writer_in(folder):
            wanted = Wanted(names, request.surrogate, request.intervals, limits, request.finest, request.energy)
            plan = _plan(run, wanted, request, reporter)
            if len(plan.parts) == 1 and not plan.derived:
                return train_model(run, folder, _wish(plan.parts[0], request), reporter)
            return _combined(run, folder, (plan, request, _asked(run, wanted, request)), reporter)


def _plan(run: Run, wanted: Wanted, request: Request, reporter: Reporter) -> Plan:
    single = len(wanted.variables) == 1 and request.max_error is None
    if single and request.intervals is not None and len(request.intervals) == 1:
        return Plan([Part(wanted.variables[0], request.intervals[0], request.modes)], {}, {})
    with reporter.stage("plan", "variables") as advance:
        return plan_parts(run, wanted, advance)


def _check(run: Run, names: list[str], request: Request, limits: Mapping[str, float]) -> None:
    for name in names:
        run.variable(name)
        if name != whole_of(name) and whole_of(name) in names:
            raise Refusal(
                f"--variable {name} is a component of {whole_of(name)}, which is given, too; give one of them"
            )
    if not names:
        raise Refusal(f"{run.path} has no variables to train on")
    check_wish(request.surrogate)
    if request.finest and limits:
        raise Refusal("--finest belongs to the rule, and --max-error decides without it; give one of them")
    if request.modes is not None and (len(names) > 1 or limits or len(request.intervals or ()) != 1):
        raise Refusal(
            "--modes is the number of one variable at one --interval; leave it out, each variable gets its own number"
        )


def _asked(run: Run, wanted: Wanted, request: Request) -> dict[str, Any]:
    """Return what decides the outcome of a training, in plain types."""
    return {
        "run": str(run.path),
        "snapshots": run.n_snapshots,
        "digest": run.digest(),
        "variable": list(wanted.variables),
        "surrogate": wanted.surrogate,
        "interval": None if wanted.intervals is None else list(wanted.intervals),
        "max-error": None if request.max_error is None else list(request.max_error),
        "finest": wanted.finest,
        "energy": wanted.energy,
        "seed": request.seed,
    }


def _wish(part: Part, request: Request) -> Wish:
    energy = thresholds_of(part.variable, None if request.energy is None else {"energy": request.energy}).energy
    wish = Wish(part.variable, part.interval, request.surrogate, part.modes, energy)
    return wish._replace(seed=request.seed, max_seconds=request.max_seconds, resume=request.resume)


def _combined(run: Run, folder: Path, what: tuple[Plan, Request, dict[str, Any]], reporter: Reporter) -> dict[str, Any]:
    """Train part after part into folders of their names, then write the card."""
    plan, request, asked = what
    if request.resume:
        check_plan(folder, asked)
        if (done := read_told_card(folder)) is not None:
            return done
    else:
        begin(folder, asked, [part.variable for part in plan.parts])
    try:
        cards = {part.variable: _trained(run, folder / part.variable, part, request, reporter) for part in plan.parts}
    except KeyboardInterrupt:
        raise InterruptedRunError(
            f"interrupted; finished parts stand in {folder}, the same command with --resume goes on"
        ) from None
    card = _card(plan, cards, asked)
    finish(folder, card)
    return card


def _trained(run: Run, place: Path, part: Part, request: Request, reporter: Reporter) -> dict[str, Any]:
    """Train one part, or return the card of one that a resumed training has already finished."""
    wish = _wish(part, request)
    done = read_model_card(place) if request.resume else None
    if done is not None:
        if not tells(done, (*TOLD, "velocity_rmse")):
            raise Refusal(f"--resume: the card of {place} is damaged; remove that folder, it is then trained again")
        return done
    return train_model(run, place, wish._replace(resume=request.resume and training_stands(place)), reporter)


def _card(plan: Plan, cards: Mapping[str, Mapping[str, Any]], asked: dict[str, Any]) -> dict[str, Any]:
    """Say what the combined model is made of, how wrong each variable is, and what all take."""
    derived = {
        velocity: {"of": position, "unit": "m/s", "rmse": cards[position]["velocity_rmse"]}
        for velocity, position in plan.derived.items()
    }
    windows = [card["window"] for card in cards.values()]
    return {
        "run": asked["run"],
        "surrogate": asked["surrogate"],
        "window": [max(first for first, _ in windows), min(last for _, last in windows)],
        "parts": {name: {key: card[key] for key in TOLD} for name, card in cards.items()},
        "derived": derived,
        "limits": dict(plan.limits),
        "storage_bytes": sum(card["storage_bytes"] for card in cards.values()),
        "asked": asked,
    }
