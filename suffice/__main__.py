"""The command line: one command, one function.

Packages that compute are imported inside the commands, so that `suffice --help` answers at once.
"""

import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from suffice.door import forget_unwritten, hear_what_is_dropped, run_command
from suffice.foreign_commands import export, import_
from suffice.options import Json, RunFile, Variables, tell
from suffice.progress import Reporter
from suffice.surrogate_commands import compare, predict, train

app = typer.Typer(
    name="suffice",
    help="How much simulation data suffices to train a surrogate of a granular flow, and what each choice costs.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(asked: bool) -> None:
    if asked:
        print(f"suffice {version('suffice')}")
        raise typer.Exit


@app.callback()
def common(
    context: typer.Context,
    log_json: Annotated[bool, typer.Option("--log-json", help="report progress as lines of JSON")] = False,
    _version: Annotated[bool, typer.Option("--version", callback=_show_version, is_eager=True)] = False,
) -> None:
    """Take the options that all commands share."""
    context.obj = Reporter(as_json=log_json)
    context.with_resource(context.obj.hearing())
    hear_what_is_dropped()


def _say(message: str) -> None:
    print(message, file=sys.stderr)


@app.command()
def study(
    context: typer.Context,
    name: Annotated[
        str,
        typer.Argument(metavar="STUDY", help="a TOML file, or built in: mini, bead_mill, paper, speeds, omissions"),
    ] = "mini",
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="DIR", help="default ./NAME")] = None,
) -> None:
    """Simulate or read, judge every Δτ, train, compare and report; finished stages are not run again."""
    from suffice.study import run_study

    report = run_study(name, output, context.obj, _say)
    print(report)


@app.command()
def scenes(name: Annotated[str | None, typer.Argument(help="print this one as TOML, to copy and edit")] = None) -> None:
    """List the built-in scenes, or print one."""
    from sim.reading import built_in_scenes
    from suffice.refusal import Refusal

    known = built_in_scenes()
    if name is None:
        for scene, text in known.items():
            print(f"{scene:<14} {text.splitlines()[0].lstrip('# ')}")
    elif name in known:
        print(known[name], end="")
    else:
        raise Refusal(f"scene {name!r} is not built in; there are {', '.join(known)}")


@app.command()
def simulate(
    context: typer.Context,
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="a built-in scene, or a TOML file")],
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="RUN", help="such as run.h5")] = None,
    until: Annotated[float | None, typer.Option(help="end, s, instead of the scene's")] = None,
    seed: Annotated[int | None, typer.Option(help="of the packing, instead of the scene's")] = None,
    threads: Annotated[int | None, typer.Option(help="default: all")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on where an interrupted run stopped")] = False,
    explain: Annotated[bool, typer.Option("--explain", help="say what it would do and cost, and run nothing")] = False,
    engine: Annotated[str, typer.Option(help="numba, ours, or lammps: dry scenes, over MPI")] = "numba",
    ranks: Annotated[int | None, typer.Option(help="processes of --engine lammps; default 1")] = None,
    until_sufficient: Annotated[
        bool,
        typer.Option("--until-sufficient", help="end when some Δτ suffices for every --variable"),
    ] = False,
    variables: Variables = None,
    keep_error: Annotated[
        str | None, typer.Option(help="keep only snapshots between which this error holds, such as 0.02d")
    ] = None,
    json: Json = None,
) -> None:
    """Run a scene: a high-fidelity run with progress, speed, energy and overlap."""
    from sim import scene_text
    from suffice.engine import check_options, simulate_on_lammps
    from suffice.refusal import Refusal
    from suffice.simulating import changed_scene, simulate_to, use_threads
    from suffice.tables import show_facts_and_found
    from suffice.watching import wished

    watching = wished(until_sufficient, variables, keep_error, engine)
    if explain:
        from suffice.explain import explain as explain_scene
        from suffice.explain import explanation_text

        use_threads(threads)
        told = explain_scene(changed_scene(scene_text(scene), scene, until, seed), watching)
        if tell(told, json):
            print(explanation_text(scene, told))
        return
    if output is None:
        raise Refusal("simulate needs -o RUN, the file to write; or --explain, which writes none")
    check_options(engine, threads, ranks, resume)
    text, place = scene_text(scene), (scene, output, context.obj)
    if engine == "lammps":
        answer = simulate_on_lammps(text, *place, until=until, seed=seed, ranks=ranks or 1)
    else:
        answer = simulate_to(text, *place, until=until, seed=seed, threads=threads, resume=resume, watching=watching)
    if tell(answer, json):
        show_facts_and_found(str(output), answer)


app.command("import")(import_)
app.command()(export)


@app.command()
def info(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="a run, a basis or a model")],
    json: Json = None,
) -> None:
    """Say what a run, a basis or a model holds and what made it."""
    from suffice.basis_file import read_card
    from suffice.combined import read_told_card
    from suffice.impacts import impact_facts
    from suffice.model import read_model_card
    from suffice.results import facts_of
    from suffice.run import Run
    from suffice.summary import read_summary
    from suffice.summary_text import summary_text
    from suffice.tables import show_combined, show_facts_and_found

    summary = None
    answer = (read_model_card(file) or read_told_card(file)) if file.is_dir() else read_card(file)
    if answer is None:
        with Run(file) as run:
            answer = {**facts_of(run), "series": sorted(run.series), **impact_facts(run), **run.provenance, **run.found}
            summary = read_summary(run)
        answer |= {} if summary is None else {"summary": summary.as_dict()}
    if tell(answer, json):
        (show_combined if "parts" in answer else show_facts_and_found)(str(file), answer)
        if summary is not None:
            print(summary_text("summary", summary))


@app.command()
def decompose(
    context: typer.Context,
    run_file: RunFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="BASIS", help="such as basis.h5")],
    variable: Annotated[str, typer.Option(help="such as position.x or velocity")],
    interval: Annotated[float | None, typer.Option(help="Δτ between the snapshots used, s; default: all")] = None,
    energy: Annotated[float | None, typer.Option(help="share of the energy that the modes hold")] = None,
    modes: Annotated[int | None, typer.Option(help="their number")] = None,
    tolerance: Annotated[float | None, typer.Option(help="largest RMSE of any snapshot, unit of the variable")] = None,
    error: Annotated[float | None, typer.Option(help="RMSE over all snapshots, unit of the variable")] = None,
    route: Annotated[str | None, typer.Option(help="gram, block or svd; default: the cheapest")] = None,
    append: Annotated[bool, typer.Option("--append", help="keep inner products, and add to those in BASIS")] = False,
    velocities: Annotated[bool, typer.Option("--velocities", help="enrich positions by velocities")] = False,
    plot: Annotated[Path | None, typer.Option(metavar="HTML", help="convergence of the Lanczos ratio")] = None,
    json: Json = None,
) -> None:
    """Find the modes of a variable by Lanczos POD; under torchrun the ranks share the rows."""
    from suffice.decomposing import Wanted, decompose_run
    from suffice.ranks import shared_rows
    from suffice.tables import show_facts

    wanted = Wanted(variable, interval, energy, modes, tolerance, error, route, append, velocities, plot)
    with shared_rows() as ranks:
        answer = decompose_run(run_file, output, wanted, ranks, context.obj)
    if ranks.rank == 0 and tell(answer, json):
        show_facts(str(output), answer)


@app.command()
def select(
    context: typer.Context,
    run_file: RunFile,
    variables: Variables = None,
    intervals: Annotated[
        str | None, typer.Option(help="coarse:fine:step or a list, s; default 10 to 2 dense ones")
    ] = None,
    energy: Annotated[float | None, typer.Option(help="that n_lr modes hold; default 0.999, fluid 0.99")] = None,
    consistency: Annotated[float | None, typer.Option(help="R_c that n_c modes keep; default 1.05")] = None,
    feasibility: Annotated[float | None, typer.Option(help="K_f that suffices; default 2")] = None,
    coarse: Annotated[bool, typer.Option("--coarse", help="no denser truth: is the recorded Δτ enough?")] = False,
    duration: Annotated[
        float | None, typer.Option("--forecast", metavar="T", help="the run is the start of one of T s: which Δτ then?")
    ] = None,
    json: Json = None,
) -> None:
    """Decide for each variable which snapshot interval Δτ suffices: R_c, n_lr, n_c and K_f."""
    from suffice.doubts import warn_of_verdicts
    from suffice.partial import Asked, select_partial
    from suffice.ranks import shared_rows
    from suffice.run import Run
    from suffice.selecting import parse_intervals, select_json, select_run
    from suffice.show_partial import show_partial
    from suffice.tables import show_selection

    given = {"energy": energy, "consistency": consistency, "feasibility": feasibility}
    changed = {name: value for name, value in given.items() if value is not None}
    steps = None if intervals is None else parse_intervals(intervals)
    asked = Asked(coarse, duration)
    with shared_rows() as ranks, Run(run_file) as run, context.obj.stage("select", "variables") as advance:
        if asked == Asked():
            answer = select_json(run, select_run(run, variables, steps, changed, advance, ranks))
        else:
            answer = select_partial(run, asked, variables, steps, changed, advance, ranks)
    if ranks.rank == 0:
        warn_of_verdicts(context.obj, answer["variables"])
    if ranks.rank == 0 and tell(answer, json):
        (show_selection if asked == Asked() else show_partial)(answer)


app.command()(train)
app.command()(predict)
app.command()(compare)


@app.command()
def report(folder: Annotated[Path, typer.Argument(metavar="DIR", help="the folder of a study")]) -> None:
    """Write the HTML page of a study's folder anew."""
    from suffice.study import make_report

    make_report(folder, folder.resolve().name)
    print(folder / "report.html")


def main() -> None:
    """Run the command line and leave with its exit code."""
    code = run_command(lambda: app(standalone_mode=False))
    forget_unwritten()
    sys.exit(code)


if __name__ == "__main__":
    main()
