"""Does K_f ≥ 2 say which snapshot interval is dense enough? Fifteen flows, every variable, every Δτ, every surrogate.

    python benchmarks/rule.py --runs DIR [--figures DIR]      # simulates and measures what is missing, then reports
    python benchmarks/rule.py --runs DIR --report             # reports what was measured, without a simulation

Beside each run DIR/NAME.h5 stands what was measured, DIR/NAME.rule.json. The tables go to standard output as Markdown;
docs/rule.md says what they mean. Runs that stand (NAME.done) are not made again, nor are measurements.
"""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from rule_cases import Case, measure, measure_coarse
from rule_extras import EXTRAS, quoted_table
from rule_figures import draw_all
from rule_flows import FLOWS, PROVOKED, SEEDS, Flow, make
from rule_intervals import flows_table, ratios_table
from rule_tables import sections

from suffice.run import Run

Measuring = Callable[[Run, Flow], list[Case]]


def measured(name: str, folder: Path, results: Path, measuring: Measuring = measure) -> list[Case]:
    """Return the cases of a run, measured now if they are not on disk."""
    path = results / f"{name}.{'rule' if measuring is measure else 'coarse'}.json"
    if not path.exists():
        with Run(folder / f"{name}.h5") as run:
            cases = measuring(run, FLOWS[name]())
        path.write_text(json.dumps(cases))
        print(f"{name}: {len(cases)} cases", file=sys.stderr, flush=True)
    found: list[Case] = json.loads(path.read_text())
    return found


def extra_table(title: str, folder: Path, results: Path) -> str:
    """Return a table of the extras, made now if it is not on disk."""
    path = results / "rule_extras.json"
    made: dict[str, str] = json.loads(path.read_text()) if path.exists() else {}
    if title not in made:
        made[title] = EXTRAS[title](folder)
        path.write_text(json.dumps(made))
    return made[title]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=Path, required=True, metavar="DIR")
    parser.add_argument("--results", type=Path, metavar="DIR", help="default: that of the runs")
    parser.add_argument("--report", action="store_true", help="only what was measured; simulate nothing")
    parser.add_argument("--figures", type=Path, metavar="DIR")
    parser.add_argument("--only", nargs="*", metavar="NAME", help="measure these, report nothing")
    options = parser.parse_args()
    results = options.results or options.runs
    results.mkdir(parents=True, exist_ok=True)
    for name in options.only if options.only is not None else FLOWS:
        if not options.report:
            make(FLOWS[name](), options.runs)
            measured(name, options.runs, results)
            measured(name, options.runs, results, measure_coarse)
    if options.only is not None:
        return
    counted = [name for name in FLOWS if name not in (*SEEDS, PROVOKED)]
    cases = [case for name in counted for case in measured(name, options.runs, results)]
    coarse = [case for name in counted for case in measured(name, options.runs, results, measure_coarse)]
    if options.figures:
        draw_all(cases, coarse, options.figures)
    for title, body in sections(cases):
        print(f"\n### {title}\n\n{body}", flush=True)
    for title, of_scans in {"Runs": flows_table, "How much too fine": ratios_table}.items():
        print(f"\n### {title}\n\n{of_scans(cases, coarse)}", flush=True)
    print(f"\n### Figures in the text\n\n{quoted_table(cases)}", flush=True)
    for title in EXTRAS:
        print(f"\n### {title}\n\n{extra_table(title, options.runs, results)}", flush=True)


if __name__ == "__main__":
    main()
