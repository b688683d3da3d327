"""The study `bead_mill` in brief, for the notebook `4_sufficiency`: K_f of every Δτ, and the two verdicts.

After `suffice study bead_mill`, `python notebooks/bead_mill.py bead_mill` writes `notebooks/bead_mill.json`.
"""

import argparse
import json
from pathlib import Path
from typing import Any

KEPT = ("interval", "n_lr", "n_c", "K_f", "K_f_interval", "verdict")


def read(path: Path) -> Any:
    """Return what a JSON file of the study holds."""
    return json.loads(path.read_text(encoding="utf-8"))


def brief(study: Path) -> dict[str, Any]:
    """Gather what the notebook shows of the study's folder: of each case its facts, verdict and K_f per variable."""
    paper, cases = read(study / "paper.json"), []
    for k, (case, verdict) in enumerate(zip(paper["cases"], paper["verdicts"], strict=True)):
        variables = read(study / f"case_{k + 1}.select.json")["select"]["variables"]
        indices = {
            name: [{key: candidate[key] for key in KEPT} for candidate in found["candidates"]]
            for name, found in variables.items()
        }
        facts = {key: case["facts"][key] for key in ("n_particles", "n_snapshots", "interval", "duration", "diameter")}
        cases.append({"name": case["name"], "scene": case["scene"], **facts, **_decided(verdict), "K_f": indices})
    return {"variable": paper["variable"], "cases": cases, "differences": paper["differences"]}


def _decided(verdict: dict[str, Any]) -> dict[str, Any]:
    chosen = verdict["interval"] if verdict["sufficient"] else None
    return {"sentence": verdict["sentence"], "remarks": verdict["remarks"], "chosen_interval": chosen}


def main() -> None:
    """Write the summary beside this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path, help="folder of the study")
    text = json.dumps(brief(parser.parse_args().study), ensure_ascii=False, allow_nan=False)
    target = Path(__file__).with_suffix(".json")
    target.write_text(text.replace('}, {"', '},\n {"') + "\n", encoding="utf-8")  # a line for each Δτ
    print(target)


if __name__ == "__main__":
    main()
