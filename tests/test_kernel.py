"""Compiled code does what the same code does as plain Python, and never runs from a stale cache."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import sim
from sim import Simulation, parse_scene
from sim import kernel as compiled

ROOT = Path(__file__).parents[1]
STEPS = 400

PLAIN = """
import sys
import numpy as np
from numba.core import config
from sim import Simulation, parse_scene
assert config.DISABLE_JIT
run = Simulation(parse_scene(sys.stdin.read()))
run.advance_to(int(sys.argv[1]))
now = run.snapshot()
np.savez(sys.argv[2], position=now.position, velocity=now.velocity, spin=now.angular_velocity,
         series=[now.series[name] for name in sorted(now.series)])
"""


def test_compiled_code_and_plain_python_agree(beads, tmp_path):
    # so fast that beads meet each other and the walls within the steps that plain Python can do
    scene = beads.replace("[0.3, 0.2, 0.1]", "[1.5, 1.0, -1.5]").replace("stiffness = 1e3", "stiffness = 1e4")
    arguments = [sys.executable, "-c", PLAIN, str(STEPS), str(tmp_path / "plain.npz")]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run(arguments, input=scene, text=True, env=environment, cwd=ROOT, check=True)
    run = Simulation(parse_scene(scene))
    run.advance_to(STEPS)
    now = run.snapshot()
    assert now.series["energy.dissipated"] > 0.0
    assert np.abs(now.angular_velocity).max() > 1.0
    series = [now.series[name] for name in sorted(now.series)]
    mine = {"position": now.position, "velocity": now.velocity, "spin": now.angular_velocity, "series": series}
    plain = np.load(tmp_path / "plain.npz")
    for name, values in mine.items():
        scale = np.abs(values).max()
        # compilers may round a sum of products once less; 400 steps and a few collisions amplify that little
        assert np.abs(plain[name] - values).max() <= 1e-12 * scale, name


def cache_folder(sources, tmp_path):
    """Return the name of the folder in which a copy of the package, changed as given, would keep its machine code."""
    package = tmp_path / "sim"
    package.mkdir(exist_ok=True)
    for source in Path(sim.__file__).parent.glob("*.py"):
        (package / source.name).write_text(sources.get(source.name, "") + source.read_text())
    command = "import sim.kernel as k; print(k._FOLDER)"
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    found = subprocess.run(
        [sys.executable, "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    return Path(found.stdout.strip())


def test_the_cache_of_machine_code_changes_with_any_source_of_the_package(tmp_path):
    same = cache_folder({}, tmp_path)
    assert same == cache_folder({}, tmp_path)
    assert same.parent == tmp_path / "cache" / "suffice"
    assert same.name == Path(compiled._FOLDER).name
    edited = {cache_folder({name: "# edited\n"}, tmp_path) for name in ("contact.py", "gravity.py", "verlet.py")}
    assert len(edited | {same}) == 4


def test_a_home_that_cannot_be_written_to_does_not_stop_a_run(tmp_path):
    (tmp_path / "cache").write_text("a file where the folder of caches should be")
    assert cache_folder({}, tmp_path).is_dir()


def test_few_pieces_of_work_use_few_threads():
    with compiled.threads_for(1):
        assert compiled.numba.get_num_threads() == 1
    with compiled.threads_for(10**6):
        assert compiled.numba.get_num_threads() <= compiled.most_threads()


def test_loops_do_not_run_on_tbb_where_there_is_another_layer():
    code = "import numba, sim\nfrom sim.kernel import config\nprint(config.THREADING_LAYER_PRIORITY[0])"
    free = {name: value for name, value in os.environ.items() if name != "NUMBA_THREADING_LAYER_PRIORITY"}
    for asked, first in (({}, "omp"), ({"NUMBA_THREADING_LAYER_PRIORITY": "workqueue omp tbb"}, "workqueue")):
        command = [sys.executable, "-c", code]
        told = subprocess.run(command, env=free | asked, capture_output=True, text=True, cwd=ROOT, check=True)
        assert told.stdout.split() == [first]
