"""The command line: exit codes, messages, what goes to standard output, and nothing left behind."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from suffice import door
from suffice.door import hear_what_is_dropped, run_command
from suffice.store import Run, RunWriter

ENTRY = Path(sys.executable).with_name("suffice")
REFUSED, DONE, FAILED = 2, 0, 1
TOLD = "suffice: interrupted; finished stages are kept, run the same command again\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def entry(*arguments, **options):
    """Run the console command as a user does."""
    return subprocess.run([ENTRY, *map(str, arguments)], capture_output=True, text=True, check=False, **options)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def refused(answer, says=""):
    """Assert one message on standard error, no traceback, exit code 2."""
    assert answer.code == REFUSED, answer
    assert answer.out == ""
    message = answer.err.replace("\n", " ")
    assert message.count("suffice: refused: ") == 1
    assert "Traceback" not in message
    assert says in message, message
    return message


def test_the_console_command_leaves_with_its_exit_code_and_message(here):
    assert entry("--version").stdout.startswith("suffice 0.")
    shown = entry("--help")
    commands = ("study", "scenes", "simulate", "import", "info", "decompose", "select", "compare", "report")
    assert shown.returncode == DONE
    assert all(name in shown.stdout for name in commands)
    missing = entry("info", "no.h5", cwd=here)
    assert missing.returncode == REFUSED
    assert missing.stderr == "suffice: refused: run no.h5 is missing; name a file that holds a run\n"
    assert missing.stdout == ""


@pytest.mark.parametrize(
    "arguments",
    [["frobnicate"], ["select"], ["select", "a.h5", "--no-such-option"], ["simulate", "mini_mill", "--until", "x"], []],
)
def test_a_command_line_that_is_not_one_is_a_refusal_with_usage(suffice, arguments):
    answer = suffice(*arguments)
    assert answer.code == REFUSED
    assert "Usage:" in answer.out + answer.err
    assert "Traceback" not in answer.err


def test_help_of_every_command_names_its_options(suffice):
    for command, option in [
        ("study", "--output"),
        ("simulate", "--resume"),
        ("import", "--timestep"),
        ("info", "FILE"),
    ]:
        answer = suffice(command, "--help")
        assert answer.code == DONE
        assert option in answer.out


def test_built_in_scenes_are_listed_and_printed_to_be_copied(suffice):
    listed = suffice("scenes")
    names = [line.split()[0] for line in listed.out.splitlines()]
    assert names == sorted(names)
    assert {"mini_mill", "bead_mill_1", "drum", "fluidised_bed", "cavity"} <= set(names)
    printed = suffice("scenes", "mini_mill")
    assert printed.out.startswith("# A small wet bead mill")
    refused(
        suffice("scenes", "maxi_mill"),
        f"scene 'maxi_mill' is not built in; there are {', '.join(names)}",
    )


def test_a_scene_becomes_a_run_whose_cost_is_told(suffice, beads, here):
    Path("scene.toml").write_text(beads)
    answer = suffice("simulate", "scene.toml", "-o", "run.h5", "--threads", 1, "--json", "-")
    told = json.loads(answer.out)
    assert (answer.code, told["n_particles"], told["n_snapshots"], told["threads"]) == (DONE, 12, 21, 1)
    assert told["steps"] * told["time_step"] == pytest.approx(0.02, rel=1e-12)
    assert names(here) == ["run.h5", "run.particles.vtkhdf", "scene.toml"]
    with Run("run.h5") as run:
        assert run.interval == 0.001
        assert run.provenance["scene"] == beads
        assert {"git", "suffice", "numba", "python", "made", "settings"} <= set(run.provenance)
        assert "energy.balance" in run.series


@pytest.mark.usefixtures("here")
def test_end_and_seed_on_the_command_line_replace_the_scenes(suffice, beads):
    Path("scene.toml").write_text(beads)
    for name, options in {"a": (), "b": ("--seed", 9), "c": ("--seed", 9, "--until", 0.005)}.items():
        assert suffice("simulate", "scene.toml", "-o", f"{name}.h5", *options).code == DONE
    with Run("a.h5") as a, Run("b.h5") as b, Run("c.h5") as c:
        first = [run.snapshot(0).values["position"] for run in (a, b, c)]
        assert not np.array_equal(first[0], first[1])
        assert np.array_equal(first[1], first[2])
        assert (b.times[-1], c.times[-1]) == (0.02, 0.005)
        assert json.loads(c.provenance["settings"]) == {"until": 0.005, "seed": 9}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("diameter = 2e-3", "diameter = -2e-3"), "particles.0.diameter = -0.002 m: Input should be greater than 0"),
        (("friction", "fricton"), "contact.fricton = 0.3: unknown key"),
        (("duration = 0.02", "duration = 0.02\nstep = 1e-3"), "time.step = 0.001 s: above the limit of"),
        (("count = 12", "position = [[4e-3, 4e-3, 4e-3], [5e-3, 4e-3, 4e-3]]"), "particles 0 and 1 overlap by 1 radii"),
        (("count = 12", "position = [[4e-3, 4e-3, 5e-4]]"), "overlaps the wall 'box' by 0.5 radii"),
        (("count = 12", "count = 1000"), "particles: only about "),
        (("0.8", "0.8 0.9"), "not valid TOML"),
    ],
)
def test_a_scene_that_cannot_start_is_refused_and_leaves_nothing(suffice, beads, here, change, says):
    assert change[0] in beads
    Path("scene.toml").write_text(beads.replace(*change))
    refused(suffice("simulate", "scene.toml", "-o", "run.h5"), says)
    assert names(here) == ["scene.toml"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--until", "nan"], "--until is nan s; it must be a positive time"),
        (["--until", "inf"], "--until is inf s; it must be a positive time"),
        (["--until", "1e-4"], "output.interval = 0.001 s: longer than time.duration = 0.0001 s"),
        (["--seed", "-1"], "--seed is -1; it must not be negative"),
        (["--threads", "0"], "--threads is 0; this machine allows 1 to"),
        (["--resume"], "run run.h5 is missing"),
    ],
)
def test_options_of_a_simulation_that_cannot_be_used_are_refused(suffice, beads, here, options, says):
    Path("scene.toml").write_text(beads)
    refused(suffice("simulate", "scene.toml", "-o", "run.h5", *options), says)
    assert names(here) == ["scene.toml"]


@pytest.mark.parametrize("command", ["simulate", "import", "decompose"])
@pytest.mark.parametrize(
    ("output", "says"),
    [
        (".", "is a folder; name a file"),
        ("scene.toml", "exists and is not a"),
        ("nowhere/x.h5", "there is no folder nowhere"),
        ("scene.toml/x.h5", "there is no folder scene.toml"),
    ],
)
def test_an_output_that_cannot_be_is_refused(suffice, beads, write_run, dump, here, command, output, says):
    Path("scene.toml").write_text(beads)
    dump("a.dump")
    write_run(Path("run.h5"))
    before = names(here)
    options = {
        "simulate": ["scene.toml"],
        "import": ["a.dump", "--interval", "0.001"],
        "decompose": ["run.h5", "--variable", "position.x"],
    }
    refused(suffice(command, *options[command], "-o", output), says)
    assert names(here) == before
    assert Path("scene.toml").read_text() == beads


@pytest.mark.usefixtures("here")
def test_a_basis_is_never_written_over_a_run(suffice, write_run):
    write_run(Path("run.h5"))
    whole = Path("run.h5").read_bytes()
    refused(suffice("decompose", "run.h5", "--variable", "position.x", "-o", "run.h5"), "run.h5 exists and is not a")
    assert Path("run.h5").read_bytes() == whole


def test_a_run_that_passes_a_limit_fails_and_keeps_what_it_had(suffice, beads, here):
    Path("scene.toml").write_text(beads.replace("amplitude = [0.0, 0.0, 0.001]", "amplitude = [0.0, 0.0, 0.05]"))
    answer = suffice("simulate", "scene.toml", "-o", "run.h5", "--json", "-")
    assert (answer.code, answer.out) == (FAILED, "")
    message = answer.err.replace("\n", " ")
    assert "suffice: failed: particle " in message
    assert "stiffness" in message
    with Run("run.h5") as run:
        assert f"run.h5 keeps {run.n_snapshots} snapshots" in message
        assert run.n_snapshots >= 1
    assert names(here) == ["run.h5", "run.particles.vtkhdf", "scene.toml"]


@pytest.mark.usefixtures("here")
def test_a_finished_run_is_not_run_again_by_resume(suffice, beads):
    Path("scene.toml").write_text(beads)
    assert suffice("simulate", "scene.toml", "-o", "run.h5").code == DONE
    made = Path("run.h5").stat().st_mtime_ns
    answer = suffice("simulate", "scene.toml", "-o", "run.h5", "--resume", "--json", "-")
    assert (answer.code, json.loads(answer.out)["n_snapshots"]) == (DONE, 21)
    assert Path("run.h5").stat().st_mtime_ns == made
    for changed in (["scene.toml", "--seed", 5], ["mini_mill"]):
        message = refused(suffice("simulate", *changed, "-o", "run.h5", "--resume"), "--resume: run.h5 was made with")
        assert "give the same, or leave out --resume" in message


COLUMNS = "id x y z vx vy vz"


@pytest.fixture
def dump():
    """Write a dump of LAMMPS of three particles, changed by a function of its lines."""

    def write(path, change=lambda lines: lines, steps=30):
        lines = []
        for k in range(steps):
            lines += ["ITEM: TIMESTEP", str(100 * k), "ITEM: NUMBER OF ATOMS", "3"]
            lines += ["ITEM: BOX BOUNDS ff ff ff", *["-2 2"] * 3, f"ITEM: ATOMS {COLUMNS}"]
            for i in (3, 1, 2):
                angle = 0.05 * i * k
                lines.append(f"{i} {np.sin(angle):.6g} {np.cos(angle):.6g} {i} {np.cos(angle):.6g} 0 0")
        Path(path).write_text("\n".join(change(lines)) + "\n")

    return write


@pytest.mark.usefixtures("here")
def test_somebody_elses_run_is_read_judged_and_described(suffice, dump):
    dump("a.dump")
    answer = suffice("import", "a.dump", "--timestep", "1e-5", "--diameter", "0.01", "-o", "run.h5", "--json", "-")
    told = json.loads(answer.out)
    assert (answer.code, told["n_particles"], told["n_snapshots"]) == (DONE, 3, 30)
    assert told["times"] == pytest.approx([0.0, 0.029])
    assert told["variables"] == ["position", "velocity"]
    shown = suffice("info", "run.h5")
    assert "lammps" in shown.out
    assert "a.dump" in shown.out


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: [*lines[:3], "2", *lines[4:9], *lines[10:]], "particle id 3"),  # step 0 has lost an atom
        (lambda lines: lines[:-2], "step 2900 at line 349 is cut"),
        (lambda lines: [*lines[:10], "1 nan 0 0 0 0 0", *lines[11:]], "nan"),
        (lambda lines: [line.replace(COLUMNS, "atom x y z vx vy vz") for line in lines], "particles need id and x y z"),
        (lambda _: [""], "a.dump"),
        (lambda _: ["not a dump"], "give a LAMMPS or LIGGGHTS"),
    ],
)
def test_a_dump_that_cannot_be_followed_is_refused_and_leaves_nothing(suffice, dump, here, change, says):
    dump("a.dump", change)
    refused(suffice("import", "a.dump", "--interval", 0.001, "-o", "run.h5"), says)
    assert names(here) == ["a.dump"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "give the solver's time step with --timestep SECONDS"),
        (["--interval", "0"], "--interval is 0 s; it must be a positive number of seconds"),
        (["--timestep", "-1"], "--timestep is -1 s"),
        (["--interval", "0.001", "--diameter", "nan"], "--diameter is nan m; it must be a positive length in m"),
        (
            ["--interval", "0.001", "--format", "gadget"],
            "--format gadget is not known; use lammps, liggghts, vtk, openfoam, npz, hdf5",
        ),
    ],
)
def test_options_of_an_import_that_cannot_be_used_are_refused(suffice, dump, here, options, says):
    dump("a.dump")
    refused(suffice("import", "a.dump", "-o", "run.h5", *options), says)
    assert names(here) == ["a.dump"]
    refused(suffice("import", "b.dump", "--interval", 1, "-o", "run.h5"), "b.dump")


NOT_RUNS = {
    "missing.h5": "is missing",
    ".": "is a folder",
    "text.h5": "cannot be opened as a run",
    "other.h5": "is HDF5 but not a run",
}


@pytest.mark.parametrize("name", NOT_RUNS)
@pytest.mark.parametrize(
    "arguments", [["info"], ["select"], ["compare"], ["decompose", "--variable", "position.x", "-o", "basis.h5"]]
)
def test_what_is_no_run_is_refused_by_every_command_that_reads_one(suffice, here, name, arguments):
    Path("text.h5").write_text("no run")
    with h5py.File("other.h5", "w") as file:
        file["x"] = 1
    command, *options = arguments
    refused(suffice(command, name, *options), NOT_RUNS[name])
    assert names(here) == ["other.h5", "text.h5"]


@pytest.mark.parametrize("n_snapshots", [0, 1])
def test_a_run_of_one_snapshot_or_none_can_only_be_looked_at(suffice, write_run, here, n_snapshots):
    if n_snapshots:
        write_run(Path("run.h5"), n_snapshots)
    else:  # stopped before its first snapshot
        particles = {"ids": [1], "radius": [1.0], "species": [1]}
        RunWriter("run.h5", **particles, n_snapshots=5, variables=["position", "velocity"], provenance={}).close()
    before = names(here)
    assert json.loads(suffice("info", "run.h5", "--json", "-").out)["n_snapshots"] == n_snapshots
    refused(suffice("select", "run.h5", "--json", "out.json"), "snapshot")
    refused(suffice("compare", "run.h5", "--json", "out.json"), "snapshot")
    refused(suffice("decompose", "run.h5", "--variable", "position.x", "-o", "basis.h5"), "snapshots: ")
    assert names(here) == before


@pytest.mark.parametrize("command", ["select", "compare"])
@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--variable", "position.w"], "run.h5 has no variable 'position.w'; it has position.x, position.y"),
        (["--variable", "fluid.pressure"], "no variable 'fluid.pressure'"),
        (["INTERVAL", "0.0015"], "0.0015 s is not a multiple of the dense interval 0.001 s"),
        (["INTERVAL", "0.5"], "0.5 s is longer than the run; the longest allowed is 0.04 s"),
        (["INTERVAL", "-0.002"], "-0.002"),
        (["INTERVAL", "nan"], "nan"),
        (["INTERVAL", "fast"], "'fast': not intervals in s; give coarse:fine:step"),
        (["INTERVAL", "0.01:0.002"], "'0.01:0.002': not intervals in s"),
        (["--json", "nowhere/out.json"], "--json nowhere/out.json cannot be written"),
        (["--json", "."], "--json . is a folder"),
    ],
)
def test_questions_that_cannot_be_answered_are_refused(suffice, write_run, here, command, options, says):
    write_run(Path("run.h5"))
    before = names(here)
    option = {"select": "--intervals", "compare": "--interval"}[command]
    quick = [] if command == "select" else ["--surrogate", "spline"]
    asked = [option if o == "INTERVAL" else o for o in options]
    refused(suffice(command, "run.h5", *quick, *asked), says)
    assert names(here) == before


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--energy", "1.5"], "--energy is 1.5; it must be above 0 and at most 1"),
        (["--consistency", "1"], "--consistency is 1; it must be above 1 and finite"),
        (["--consistency", "nan"], "--consistency is nan"),
        (["--feasibility", "inf"], "--feasibility is inf; it must be above 0 and finite"),
    ],
)
def test_thresholds_out_of_range_are_refused(suffice, write_run, here, options, says):
    write_run(Path("run.h5"))
    refused(suffice("select", "run.h5", *options, "--json", "out.json"), says)
    assert names(here) == ["run.h5", "run.particles.vtkhdf"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--surrogate", "oracle"], "surrogate 'oracle' is not known here; use"),
        (["--max-error", "tiny"], "tiny"),
        (["--max-error", "-1"], "-1"),
        (["--max-error", "inf"], "inf"),
        (["--max-seconds", "nan"], "nan"),
        (["--max-bytes", "much"], "--max-bytes 'much': not a size; give bytes, or such as 500kB or 2MB"),
        (["--max-bytes", "-2MB"], "max_bytes is -2e+06 B; it must be a positive number"),
        (["--precision", "quarter"], "precision 'quarter'"),
    ],
)
@pytest.mark.usefixtures("here")
def test_limits_and_surrogates_that_are_none_are_refused(suffice, write_run, options, says):
    write_run(Path("run.h5"))
    refused(suffice("compare", "run.h5", "--variable", "position.x", *options), says)


def test_json_goes_to_standard_output_alone_or_to_a_file(suffice, write_run, here):
    write_run(Path("run.h5"))
    shown = suffice("select", "run.h5", "--json", "-")
    assert shown.code == DONE
    told = json.loads(shown.out)
    written = suffice("select", "run.h5", "--json", "out.json")
    assert json.loads(Path("out.json").read_text()) == told
    assert "K_f" in written.out
    assert names(here) == ["out.json", "run.h5", "run.particles.vtkhdf"]
    compared = suffice("compare", "run.h5", "--variable", "position.x", "--interval", "0.004", "--json", "-")
    assert {"rows", "bases", "left_out", "choice"} <= set(json.loads(compared.out))
    limits = ("--max-bytes", "1MB", "--precision", "half", "--interval", "0.004", "--surrogate", "spline")
    kept = json.loads(suffice("compare", "run.h5", "--variable", "position.x", *limits, "--json", "-").out)
    assert kept["limits"]["max_bytes"] == 1e6
    assert kept["choice"]["position.x"]["kept"]
    assert {row["precision"] for row in kept["rows"]} >= {"half"}
    assert json.loads(suffice("info", "run.h5", "--json", "-").out)["n_particles"] == 24


def test_a_report_needs_a_run(suffice, here):
    refused(suffice("report", here), "run.h5 is missing")


@pytest.mark.usefixtures("here")
def test_a_full_pipe_downstream_is_no_traceback(beads):
    Path("scene.toml").write_text(beads)
    shown = subprocess.run(
        f"{ENTRY} scenes mini_mill | head -1", shell=True, capture_output=True, text=True, check=False
    )
    assert shown.stdout.startswith("# A small")
    assert "Traceback" not in shown.stderr


@pytest.mark.usefixtures("here")
def test_ctrl_c_is_said_in_a_sentence(beads):
    Path("scene.toml").write_text(beads)
    command = (
        "import signal, suffice.simulating as s, suffice.__main__ as m\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background job ignores it
        "s.simulate_to = lambda *a, **b: signal.raise_signal(signal.SIGINT)\n"
        "m.main()"
    )
    stopped = subprocess.run(
        [sys.executable, "-c", command, "simulate", "scene.toml", "-o", "run.h5"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"COLUMNS": "200"},
    )
    assert stopped.returncode == 130
    assert stopped.stderr == TOLD


@pytest.mark.parametrize(("by", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_that_asks_to_stop_is_said_in_a_sentence(capsys, by, code):
    assert run_command(lambda: signal.raise_signal(signal.Signals[by])) == code
    assert capsys.readouterr().err == TOLD


def test_nohup_is_left_its_wish(capsys):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert run_command(lambda: signal.raise_signal(signal.SIGHUP)) == DONE
    finally:
        signal.signal(signal.SIGHUP, before)
    assert capsys.readouterr().err == ""


def test_ctrl_c_that_python_drops_in_a_callback_is_heard(capsys, monkeypatch):
    for hook in ("unraisablehook", "excepthook"):
        monkeypatch.setattr(sys, hook, getattr(sys, hook))

    class Dropping:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def command():
        hear_what_is_dropped()
        Dropping()
        time.sleep(20)

    began = time.monotonic()
    assert run_command(command) == 130
    assert time.monotonic() - began < 10
    assert capsys.readouterr().err == TOLD


@pytest.mark.parametrize(("module", "heard"), [("llvmlite.binding.ffi", False), ("elsewhere", True)])
def test_what_llvmlite_says_of_an_object_it_could_not_finish_is_dropped(monkeypatch, module, heard):
    """Ctrl-C may stop the constructor of an object, which then misses what its `__del__` looks for."""
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    said = []
    monkeypatch.setattr(sys, "unraisablehook", said.append)

    class Unfinished:
        def __del__(self):
            self.missing.close()

    Unfinished.__del__.__module__ = module
    hear_what_is_dropped()
    Unfinished()
    assert bool(said) == heard


def test_an_impatient_second_ctrl_c_does_not_spoil_the_message(capsys, monkeypatch):
    say = door._say

    def impatient(*words):
        signal.raise_signal(signal.SIGINT)
        return say(*words)

    monkeypatch.setattr(door, "_say", impatient)
    assert run_command(lambda: signal.raise_signal(signal.SIGINT)) == 130
    assert capsys.readouterr().err == TOLD


@pytest.mark.usefixtures("here")
def test_a_standard_output_that_is_full_is_one_message():
    plain = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w") as full:
        answer = subprocess.run(
            [ENTRY, "scenes"], stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=plain
        )
    assert (answer.returncode, answer.stderr) == (FAILED, "suffice: failed: [Errno 28] No space left on device\n")


def test_json_goes_into_a_pipe_and_not_over_it(suffice, write_run, here):
    write_run(here / "run.h5", n_snapshots=5)
    os.mkfifo("pipe")
    reader = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
    assert suffice("info", "run.h5", "--json", "pipe").code == DONE
    assert json.loads(os.read(reader, 1 << 16))["n_snapshots"] == 5
    os.close(reader)
    assert Path("pipe").is_fifo()
    assert names(here) == ["pipe", "run.h5", "run.particles.vtkhdf"]
