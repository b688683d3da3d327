"""Everything a study found, gathered from its folder for the report."""

import json
import os
import platform
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from suffice.refusal import Refusal
from suffice.run import Run
from suffice.summary import read_summary
from suffice.variables import mean_diameter

RUN, SELECTION, COMPARISON, LOG = "run.h5", "select.json", "compare.json", "stages.json"
UNSEEN, OMISSIONS, PAPER = "unseen.json", "omissions.json", "paper.json"  # of studies of several runs
ONE_STEP = "one_step.json"  # of a study at full size
LEDGER = "energy."
FLUID_WORK = "fluid.work_on_particles"  # of the ledger, too


class CaseFiles(NamedTuple):
    """Where one of several cases lies in a study's folder."""

    run: Path
    cost: Path  # JSON, what simulating took
    selection: Path  # JSON, verdicts and curves
    measured: Path  # JSON, what surrogates trained on it err and take


def case_files(folder: Path, k: int) -> CaseFiles:
    """Return the files of case k = 0, 1, … of a study."""
    ends = ("h5", "cost.json", "select.json", "measured.json")
    return CaseFiles(*(folder / f"case_{k + 1}.{end}" for end in ends))


def read_json(path: Path) -> Any:
    """Return what a JSON file holds, None where there is no file.

    Raises Refusal for a damaged one, and for what is no file.
    """
    if path.exists() and not path.is_file():
        raise Refusal(f"{path} is no file; remove it and run the study again")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        json.dumps(found, ensure_ascii=False).encode()  # half a character could not be shown
        return found
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise Refusal(f"{path} cannot be read ({error}); run the study again") from None


def gather(folder: Path, study: str) -> dict[str, Any]:
    """Return the results of a study's folder, in plain types; what is not there is left out.

    Raises Refusal where there is no run at all.
    """
    results: dict[str, Any] = {"study": study}
    others = (UNSEEN, OMISSIONS, PAPER, ONE_STEP)
    unseen, omissions, paper, one_step = (read_json(folder / name) for name in others)
    first = RUN
    if unseen:
        results["unseen"], first = unseen, Path(unseen["runs"][0]["path"]).name
    elif omissions:
        results["omissions"], first = omissions, Path(omissions["runs"][0]).name
    elif one_step:
        results["one_step"], first = one_step, one_step["source"]["run"]
    elif paper:
        results |= {"paper": paper, "cases": [_of_case(folder, k) for k in range(len(paper["cases"]))]}
        first = paper["cases"][0]["run"]
    with Run(folder / first) as run:
        if first == RUN:
            results |= _of_one_run(run)
        results["provenance"] = {**run.provenance, **_here()}
    selection, comparison, log = (read_json(folder / name) for name in (SELECTION, COMPARISON, LOG))
    if selection:
        results |= {"select": selection["select"], "curves": selection["curves"]}
    if comparison:
        results |= {"compare": comparison, "observables": comparison.get("observables", [])}
    if log:
        results["stages"] = [
            {key: entry.get(key) for key in ("seconds", "detail", "warnings")} | {"name": name}
            for name, entry in log.items()
        ]
    results["told"] = _told(folder, _runs_of(results))
    return results


def _runs_of(results: Mapping[str, Any]) -> list[str]:
    """Return the names of the runs in a study's folder that its stages made."""
    if "unseen" in results:
        return [Path(run["path"]).name for run in results["unseen"]["runs"]]
    if "omissions" in results:
        return [Path(run).name for run in results["omissions"]["runs"]]
    if "paper" in results:
        return [case["run"] for case in results["paper"]["cases"]]
    return [Path(results["one_step"]["source"]["run"]).name] if "one_step" in results else [RUN]


def _told(folder: Path, runs: Sequence[str]) -> dict[str, Any]:
    """Return by the names of runs what they told about themselves; of those that are there and did."""
    found: dict[str, Any] = {}
    for name in runs:
        if (folder / name).exists():
            with Run(folder / name) as run:
                summary = read_summary(run)
            found |= {} if summary is None else {name: summary.as_dict()}
    return found


def _of_case(folder: Path, k: int) -> dict[str, Any]:
    """Return verdicts, curves and surrogates of a case under the names that those of one run have."""
    files = case_files(folder, k)
    selection: dict[str, Any] = read_json(files.selection)
    with Run(files.run) as run:
        return _of_one_run(run) | selection | {"compare": read_json(files.measured)["compare"]}


def played(folder: Path, results: dict[str, Any]) -> tuple[Path, dict[str, Any]]:
    """Return the run that the player shows and its results: of several cases the last."""
    cases = results.get("cases")
    return (case_files(folder, len(cases) - 1).run, cases[-1]) if cases else (folder / RUN, results)


def _of_one_run(run: Run) -> dict[str, Any]:
    """Return facts and energies of the run of a study."""
    found: dict[str, Any] = {"run": facts_of(run)}
    ledger = {name.removeprefix(LEDGER): s.tolist() for name, s in run.series.items() if name.startswith(LEDGER)}
    if ledger:
        work = {} if (done := run.series.get(FLUID_WORK)) is None else {"fluid_work": done.tolist()}
        found["series"] = {"times": run.times.tolist(), **ledger, **work}
    return found


def facts_of(run: Run) -> dict[str, Any]:
    """Return what the reader of a report wants to know of a run first."""
    return {
        "path": str(run.path),
        "n_particles": run.n_particles,
        "n_snapshots": run.n_snapshots,
        "interval": run.interval,
        "duration": float(run.times[-1] - run.times[0]) if run.n_snapshots else 0.0,
        "diameter": mean_diameter(run),
        "variables": run.variables,
    }


def _here() -> dict[str, str]:
    """Return where and when a report was made."""
    return {
        "report": f"suffice {version('suffice')}, torch {version('torch')}, numpy {version('numpy')}",
        "cores": str(os.cpu_count()),
        "system": platform.platform(),
        "reported": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }
