"""Commands that train surrogates, ask them, and compare them.

Packages that compute are imported inside the commands, so that `suffice --help` answers at once.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

from suffice.options import Json, RunFile, Variables, tell

TASKS = {  # of compare, and the options that each heeds
    "between": "variables interval surrogate max_error max_seconds max_bytes precision seed seeds training_seconds",
    "beyond": "variables interval surrogate seed observables",
    "unseen": "surrogate held_out seed seeds",
    "observables": "interval surrogate seed",
    "timescales": "variables interval surrogate max_error",
}
HEEDED_BY_ALL = {"runs", "task", "json"}
Seed = Annotated[int, typer.Option(help="of whatever is random in training")]


def train(
    context: typer.Context,
    run_file: RunFile,
    surrogate: Annotated[str, typer.Option(help="name, such as hermite, spline, rbf, mlp, lstm")],
    variables: Annotated[
        list[str] | None,
        typer.Option("--variable", help="such as position.x or fluid.velocity; default positions and velocities"),
    ] = None,
    interval: Annotated[
        str | None,
        typer.Option(help="Δτ, s; default for each variable the largest that suffices, of 10 to 2 dense ones"),
    ] = None,
    max_error: Annotated[
        list[str] | None,
        typer.Option(help="instead: the fewest bytes within this RMSE, such as 0.05d or 0.1m/s; one for each unit"),
    ] = None,
    finest: Annotated[bool, typer.Option("--finest", help="take the finest Δτ where none suffices")] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="default ./VARIABLE-SURROGATE, of several ./RUN-SURROGATE"),
    ] = None,
    modes: Annotated[int | None, typer.Option(help="their number; default n_c, no fewer than n_lr")] = None,
    energy: Annotated[float | None, typer.Option(help="that n_lr modes hold; default 0.999, fluid 0.99")] = None,
    seed: Seed = 0,
    max_seconds: Annotated[float | None, typer.Option(help="longest training of a network, s")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on where an interrupted training stopped")] = False,
    json: Json = None,
) -> None:
    """Fit a surrogate to the modes of a variable and write it as a model; of several as one combined model."""
    from suffice.combining import Request
    from suffice.combining import train as train_run
    from suffice.tables import show_combined, show_facts

    name = variables[0] if variables is not None and len(variables) == 1 else run_file.stem
    folder = output or Path(f"{name}-{surrogate}")
    request = Request(
        surrogate, variables, _intervals(interval), max_error, finest, modes, energy, seed, max_seconds, resume
    )
    answer = train_run(run_file, folder, request, context.obj)
    if tell(answer, json):
        (show_combined if "parts" in answer else show_facts)(str(folder), answer)


def predict(
    context: typer.Context,
    models: Annotated[list[Path], typer.Argument(metavar="MODEL...", help="folders that train wrote")],
    times: Annotated[str, typer.Option(metavar="A:B:S", help="first:last:step or a list, s")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN", help="such as predicted.h5")],
    beyond: Annotated[bool, typer.Option("--beyond", help="answer outside the window of training, too")] = False,
    json: Json = None,
) -> None:
    """Write what models predict at any times as a run, which ParaView opens."""
    from suffice.predicting import parse_times, predict_run
    from suffice.tables import show_facts

    answer = predict_run(models, parse_times(times), output, beyond, context.obj)
    if tell(answer, json):
        show_facts(str(output), answer)


def compare(
    context: typer.Context,
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="one run; of --task unseen one per speed")],
    task: Annotated[
        str, typer.Option(help="between snapshots, beyond the window, unseen speed, observables, or timescales")
    ] = ("between"),
    variables: Variables = None,
    interval: Annotated[
        str | None, typer.Option(help="Δτ as for select --intervals, s; default 10 to 2 dense ones")
    ] = None,
    surrogate: Annotated[
        list[str] | None, typer.Option(help="name; may be repeated; default: all that need no training")
    ] = None,
    max_error: Annotated[
        str | None,
        typer.Option(help="largest RMSE: 0.05d in diameters, or in the variable's unit; timescales: 0.05d,0.1m/s"),
    ] = None,
    max_seconds: Annotated[float | None, typer.Option(help="longest time for one snapshot, s")] = None,
    max_bytes: Annotated[str | None, typer.Option(help="most to keep of a variable, such as 500kB or 2MB")] = None,
    precision: Annotated[
        list[str] | None,
        typer.Option(help="double, single, half, int16 or int8; may be repeated; default: the integers"),
    ] = None,
    held_out: Annotated[str | None, typer.Option(help="of --task unseen: speeds no surrogate is shown, 1/min")] = None,
    seed: Seed = 0,
    seeds: Annotated[int, typer.Option(help="trainings of each network, their spread is shown")] = 1,
    training_seconds: Annotated[float | None, typer.Option(help="longest training of a network, s")] = None,
    observables: Annotated[
        bool, typer.Option("--observables", help="of --task beyond: what the predicted snapshots are worth, too")
    ] = False,
    json: Json = None,
) -> None:
    """Train surrogates and baselines and compare them: error against cost, and the cheapest that keeps a limit."""
    from suffice.refusal import Refusal

    if task not in TASKS:
        raise Refusal(f"--task {task!r} is not known; use {', '.join(TASKS)}")
    _check_heeded(context, task)
    if task == "unseen":
        _compare_unseen(context, runs, held_out, surrogate, (seed, seeds), json)
        return
    if len(runs) != 1:
        raise Refusal(f"--task {task} compares within one run, {len(runs)} are given; name one")
    how = {"surrogates": surrogate, "seed": seed}
    if task == "beyond":
        _compare_beyond(context, runs[0], (variables, interval, observables), how, json)
    elif task == "observables":
        _compare_observables(context, runs[0], interval, how, json)
    elif task == "timescales":
        _compare_timescales(context, runs[0], (variables, interval, max_error), surrogate, json)
    else:
        effort = {"seeds": seeds, "training_seconds": training_seconds, "precisions": precision}
        limits = (max_error, max_seconds, max_bytes)
        _compare_between(context, runs[0], (variables, interval), limits, how | effort, json)


def _check_heeded(context: typer.Context, task: str) -> None:
    """Raise Refusal for an option given that the task would not heed."""
    from suffice.refusal import Refusal

    for name in sorted(set(context.params) - HEEDED_BY_ALL - set(TASKS[task].split())):
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            flag = "--variable" if name == "variables" else "--" + name.replace("_", "-")
            heeding = " or ".join(other for other, heeded in TASKS.items() if name in heeded.split())
            raise Refusal(f"{flag} belongs to --task {heeding}, not to {task}; leave it out, or name another task")


def _compare_between(
    context: typer.Context,
    path: Path,
    asked: tuple[list[str] | None, str | None],
    limits: tuple[str | None, float | None, str | None],
    how: dict[str, Any],
    json: Any,
) -> None:
    from suffice.choice import parse_bytes, parse_error
    from suffice.compare import compare as compare_run
    from suffice.doubts import warn_of_comparisons
    from suffice.run import Run
    from suffice.tables import show_comparison

    (variables, interval), (max_error, max_seconds, max_bytes) = asked, limits
    error, unit = (None, "m") if max_error is None else parse_error(max_error)
    size, steps = None if max_bytes is None else parse_bytes(max_bytes), _intervals(interval)
    how |= {"max_error": error, "error_unit": unit, "max_seconds": max_seconds, "max_bytes": size}
    with Run(path) as run, context.obj.stage("compare", "cases") as advance:
        answer = compare_run(run, variables, steps, progress=advance, **how)
    warn_of_comparisons(context.obj, answer)
    if tell(answer, json):
        show_comparison(answer)


def _compare_beyond(
    context: typer.Context, path: Path, asked: tuple[list[str] | None, str | None, bool], how: Any, json: Any
) -> None:
    from suffice.beyond import compare_beyond
    from suffice.doubts import warn_of_comparisons
    from suffice.foreseen import observe_beyond
    from suffice.foresight import show_beyond
    from suffice.run import Run
    from suffice.show_foreseen import show_foreseen

    variables, interval, observables = asked
    step, watched = _one_interval("beyond", interval), {}
    with Run(path) as run:
        if observables:
            with context.obj.stage("observe", "surrogates") as advance:
                watched = {"observables": observe_beyond(run, step, progress=advance, **how)}
        with context.obj.stage("compare", "variables") as advance:
            answer = compare_beyond(run, variables, step, progress=advance, **how) | watched
    warn_of_comparisons(context.obj, answer)
    if tell(answer, json):
        show_beyond(answer)
        if observables:
            show_foreseen(answer["observables"])


def _compare_timescales(
    context: typer.Context,
    path: Path,
    asked: tuple[list[str] | None, str | None, str | None],
    surrogate: list[str] | None,
    json: Any,
) -> None:
    from suffice.refusal import Refusal
    from suffice.run import Run
    from suffice.show_timescales import show_timescales
    from suffice.timescales import compare_timescales

    variables, interval, max_error = asked
    if surrogate is not None and len(surrogate) != 1:
        raise Refusal("--task timescales takes one --surrogate, the same for all variables; name one")
    limits = None if max_error is None else [max_error]
    name = None if surrogate is None else surrogate[0]
    with Run(path) as run, context.obj.stage("compare", "variables") as advance:
        answer = compare_timescales(run, variables, _intervals(interval), name, limits, advance)
    if tell(answer, json):
        show_timescales(answer)


def _compare_observables(context: typer.Context, path: Path, interval: str | None, how: Any, json: Any) -> None:
    from suffice.doubts import warn_of_comparisons
    from suffice.run import Run
    from suffice.show_observables import show_observables
    from suffice.watched import compare_observables

    step = _one_interval("observables", interval)
    with Run(path) as run, context.obj.stage("compare", "surrogates") as advance:
        answer = compare_observables(run, step, progress=advance, **how)
    warn_of_comparisons(context.obj, answer)
    if tell(answer, json):
        show_observables(answer)


def _compare_unseen(
    context: typer.Context,
    paths: Sequence[Path],
    held_out: str | None,
    surrogates: list[str] | None,
    chance: tuple[int, int],
    json: Any,
) -> None:
    from suffice.refusal import Refusal
    from suffice.run import Run
    from suffice.unseen import compare_unseen
    from suffice.unseen_tables import show_unseen

    if held_out is None:
        raise Refusal("--task unseen needs --held-out, the speeds in 1/min that no surrogate is shown; such as 800")
    try:
        speeds = [float(part) for part in held_out.split(",")]
    except ValueError:
        raise Refusal(f"--held-out {held_out!r}: not speeds in 1/min; give 800, or 600,1200") from None
    seed, seeds = chance
    with ExitStack() as stack, context.obj.stage("compare", "cases") as advance:
        runs = [stack.enter_context(Run(path)) for path in paths]
        answer = compare_unseen(runs, speeds, seed, advance, surrogates=surrogates, seeds=seeds)
    if tell(answer, json):
        show_unseen(answer)


def _intervals(text: str | None) -> list[float] | None:
    from suffice.selecting import parse_intervals

    return None if text is None else parse_intervals(text)


def _one_interval(task: str, text: str | None) -> float:
    """Return the one Δτ of a task that takes no more."""
    from suffice.refusal import Refusal

    steps = _intervals(text)
    if steps is None or len(steps) != 1:
        raise Refusal(f"--task {task} needs one --interval, Δτ in s, such as 0.003")
    return steps[0]
