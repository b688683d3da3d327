"""Three flows that are not steady, as dense runs: a hopper that begins to run, a column that collapses, a mill's start.

    python benchmarks/transients.py -o DIR [NAME...]

Built-in scenes, watched more often or shorter; `collapse` has the beads of the shaken box in a quarter of a wider box
that stands still. For `benchmarks/adaptive_snapshots.py`.
"""

import argparse
from pathlib import Path

from sim import scene_text
from suffice.progress import Reporter
from suffice.simulating import simulate_to

CHANGES = {
    "hopper": ("hopper", {"duration = 1.0 ": "duration = 0.4 ", "interval = 0.005 ": "interval = 0.001 "}),
    "mill_start": ("mini_mill", {"duration = 0.2 ": "duration = 0.05 ", "interval = 0.001 ": "interval = 0.00025 "}),
}  # fmt: skip

COLLAPSE = """# Beads in a quarter of a box are let go and spread over its floor.
seed = 1

[[particles]]
diameter = 3e-3        # m
density = 2500.0       # kg/m³
count = 800

[contact]
stiffness = 5e3        # N/m
restitution = 0.6
friction = 0.4

[gravity]
acceleration = [0.0, 0.0, -9.81]   # m/s²

[time]
duration = 0.4         # s

[output]
interval = 0.001       # s

[filling]
lowest = [0.0, 0.0, 0.0]        # m
highest = [0.03, 0.02, 0.07]

[[walls]]
name = "box"
[[walls.shapes]]
shape = "box"
lowest = [0.0, 0.0, 0.0]
highest = [0.12, 0.02, 0.08]
particles = "inside"
"""


def text_of(name):
    """Scene as TOML."""
    if name == "collapse":
        return COLLAPSE
    scene, changes = CHANGES[name]
    text = scene_text(scene)
    for old, new in changes.items():
        assert old in text, f"{scene} has no {old!r} any more"
        text = text.replace(old, new)
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=[*CHANGES, "collapse"])
    parser.add_argument("-o", "--output", type=Path, required=True)
    asked = parser.parse_args()
    asked.output.mkdir(exist_ok=True)
    for name in asked.names:
        answer = simulate_to(text_of(name), name, asked.output / f"{name}.h5", Reporter(as_json=True))
        print(f"{name}: {answer['n_particles']} particles, {answer['n_snapshots']} snapshots", flush=True)


if __name__ == "__main__":
    main()
