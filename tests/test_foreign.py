"""Runs written by other programs, kept in `reference/` with the decks that made them, from file to verdict."""

import re

import numpy as np
import pytest

from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.selecting import select_run
from suffice.store import Run

VARIABLES = ["position.x", "velocity.z"]


def imported(sources, output, **options):
    import_run(sources, output, precision="double", **options)
    return Run(output)


def judged(run, variables=VARIABLES):
    """Every variable got a verdict at every Δτ, with numbers."""
    table = select_run(run, variables)
    for name in variables:
        assert len(table[name].candidates) >= 8
        assert all(candidate.n_lr >= 1 for candidate in table[name].candidates)
    return table


def test_scaled_unwrapped_and_wrapped_dumps_of_lammps_are_the_same_run(unpacked, tmp_path):
    folder = unpacked("lammps", "sheared")
    with (
        imported(folder / "scaled.dump.gz", tmp_path / "s.h5") as scaled,
        imported(folder / "unwrapped.dump", tmp_path / "u.h5", timestep=5e-6) as unwrapped,
        imported(sorted(folder.glob("wrapped.*.dump")), tmp_path / "w.h5", interval=0.002) as wrapped,
    ):
        assert (scaled.n_particles, scaled.n_snapshots, scaled.interval) == (40, 41, 0.002)
        moved = unwrapped.variable("position.x")[:]
        assert np.ptp(moved, axis=1).max() > 0.01  # more than a box length: faces were crossed
        for run in (scaled, wrapped):
            assert np.allclose(run.times, unwrapped.times, rtol=1e-12)
            assert np.allclose(run.radius, unwrapped.radius, rtol=1e-9)
            for axis in "xyz":  # nine digits were written of each, of at most 0.04 m
                there = unwrapped.variable(f"position.{axis}")[:]
                assert np.abs(run.variable(f"position.{axis}")[:] - there).max() < 1e-10
                there = unwrapped.variable(f"velocity.{axis}")[:]
                assert np.allclose(run.variable(f"velocity.{axis}")[:], there, rtol=1e-8, atol=1e-12)
        judged(wrapped)


@pytest.mark.usefixtures("vtk")
def test_liggghts_vtk_and_text_of_one_run_agree_to_their_digits(unpacked, tmp_path):
    post = unpacked("liggghts", "shaken") / "post"
    with (
        imported(sorted(post.glob("*.vtk")), tmp_path / "v.h5", timestep=1e-5) as run,
        imported(post / "shaken.dump", tmp_path / "t.h5", timestep=1e-5) as text,
    ):
        assert (run.n_particles, run.n_snapshots, run.interval) == (40, 40, 0.003)
        assert "40 files of bounding boxes left out" in run.provenance["notes"]
        assert np.array_equal(run.times, text.times)
        assert np.array_equal(run.ids, text.ids)
        assert np.array_equal(run.radius, text.radius)
        assert sorted(set(run.radius)) == [0.001, 0.0015]
        for name in text.variables:  # both are written with six digits
            assert np.allclose(run.variable(name)[:], text.variable(name)[:], rtol=1e-5, atol=1e-12)
        judged(run)


@pytest.mark.usefixtures("vtk")
def test_beads_of_yade_move_as_their_velocities_say(unpacked, tmp_path):
    sources = sorted((unpacked("yade", "shaken") / "out").glob("*.vtu"))
    with imported(sources, tmp_path / "run.h5", timestep=1e-5) as run:
        assert (run.n_particles, run.n_snapshots, run.interval) == (30, 40, 0.003)
        assert run.variables[-3:] == ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"]
        assert 0.001 <= run.radius.min() < run.radius.max() <= 0.0015
        x, v = run.variable("position.z")[:], run.variable("velocity.z")[:]
        falling = slice(1, 6)  # of those that touch nothing, the damped acceleration is constant
        step = np.diff(x, axis=1)[:, falling]
        mean = (v[:, :-1] + v[:, 1:])[:, falling] / 2
        acceleration = np.diff(v, axis=1)[:, falling] / 0.003
        free = np.ptp(acceleration, axis=1) < 1e-6
        assert free.sum() >= 3
        # a leapfrog: velocities lag by half a step of 1e-5 s; positions are in single precision
        exact = 0.003 * (mean + acceleration * 1e-5 / 2)
        assert np.abs(step - exact)[free].max() < 4e-9
        judged(run)


def entries(path, components):
    """Read a list of OpenFOAM without VTK."""
    text = re.sub(r"/\*.*?\*/|//.*?\n", "", path.read_text(), flags=re.DOTALL)
    values = text.partition("}")[2].split("boundaryField")[0]
    inside = re.search(r"\d+\s*\((.*)\)\s*;?\s*$", values.strip(), re.DOTALL)
    if inside is None:  # all the same: 64{1}
        count, value = re.search(r"(\d+)\{(.*?)\}", values).groups()
        return np.full(int(count), float(value))
    if components == 1:
        return np.array(inside.group(1).split(), float)
    return np.array([row.split() for row in re.findall(r"\(([^()]*)\)", inside.group(1))], float)


@pytest.mark.usefixtures("vtk")
def test_a_case_of_openfoam_gives_its_parcels_and_the_fields_of_its_box(unpacked, tmp_path):
    case = unpacked("openfoam", "box") / "box"
    with imported(case, tmp_path / "run.h5") as run:
        assert (run.n_particles, run.n_snapshots, run.interval) == (64, 40, 0.005)
        assert run.times[0] == pytest.approx(0.005)
        assert np.allclose(run.radius, 0.00125, rtol=1e-7)
        assert "p/ρ" in run.provenance["notes"]
        assert run.variable("fluid.pressure").unit == "m²/s²", "p/ρ is no pascal"
        assert run.variable("fluid.velocity.x").unit == "m/s"
        assert run.grid.shape == (9, 3, 3)
        assert np.allclose(run.grid.origin, (-0.0075, -0.0075, 0.0), atol=1e-9)
        assert np.allclose(run.grid.spacing, 0.005, rtol=1e-6)
        for k, name in ((0, "0.005"), (19, "0.1"), (39, "0.2")):
            cloud, values = case / name / "lagrangian" / "kinematicCloud", run.snapshot(k).values
            order = np.argsort(entries(cloud / "origId", 1))
            assert np.allclose(values["position"], entries(cloud / "positions", 3)[order], rtol=1e-6, atol=1e-9)
            assert np.allclose(values["velocity"], entries(cloud / "U", 3)[order], rtol=1e-6, atol=1e-9)
            # the cells of blockMesh run along x, then y, then z
            there = entries(case / name / "U.air", 3).reshape(9, 3, 3, 3)
            assert np.allclose(values["fluid.velocity"], there, rtol=1e-6, atol=1e-9)
            there = entries(case / name / "alpha.air", 1).reshape(9, 3, 3)
            assert np.allclose(values["fluid.void_fraction"], there, rtol=1e-6)
        judged(run, ["position.z", "fluid.velocity.z", "fluid.void_fraction"])
    with imported(case, tmp_path / "run.h5", maps=["fluid=none"]) as run:
        assert (run.grid, run.n_snapshots) == (None, 40)


@pytest.mark.usefixtures("vtk")
@pytest.mark.parametrize(
    ("file", "share", "says"),
    [
        ("0.1/lagrangian/kinematicCloud/positions", 0.5, r"cannot be read to its end"),
        ("0.1/U.air", 0.5, r"cannot be read to its end"),
        ("0.2/U.air", 0.0, r"time 0.005 holds fluid.velocity, which the last time, 0.2 s, does not or has damaged"),
        ("0.2/lagrangian/kinematicCloud/U", 0.0, r"time 0.005 holds velocity, which the last time, 0.2 s, does not"),
        ("0.2/lagrangian/kinematicCloud/origId", 0.0, r"none is the id of the particles"),
        ("constant/polyMesh/faces", 0.9, r"cannot be read to its end"),
    ],
)
def test_a_damaged_case_is_refused(unpacked, tmp_path, file, share, says):
    case = unpacked("openfoam", "box") / "box"
    text = (case / file).read_bytes()
    (case / file).write_bytes(text[: int(share * len(text))])
    with pytest.raises(Refusal, match=says):
        import_run(case, tmp_path / "run.h5")
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.usefixtures("vtk")
def test_a_case_that_loses_a_parcel_is_refused_with_its_id(unpacked, tmp_path):
    case = unpacked("openfoam", "box") / "box"
    for path in (case / "0.1" / "lagrangian" / "kinematicCloud").iterdir():
        lines = path.read_text().splitlines(keepends=True)
        begins = next((k for k, line in enumerate(lines) if line.strip() == "64"), None)
        if begins is None:  # all the same: 64{1}
            path.write_text(path.read_text().replace("64{", "63{"))
        else:  # without the last one
            (end,) = (k for k, line in enumerate(lines) if k > begins and line.strip() == ")")
            path.write_text("".join([*lines[:begins], "63\n", *lines[begins + 1 : end - 1], *lines[end:]]))
    with pytest.raises(Refusal, match=r"time 0.1: particle id \d+ is missing \(1 of 64 lost since .*time 0.005\)"):
        import_run(case, tmp_path / "run.h5")


@pytest.mark.usefixtures("vtk")
def test_a_study_of_a_foreign_case_goes_from_its_files_to_a_report(unpacked, tmp_path, suffice):
    unpacked("openfoam", "box")
    tables = {
        "source": 'files = ["openfoam/box"]\nmap = { "fluid.velocity" = "U.air" }',
        "select": 'variables = ["position.z", "fluid.velocity.z"]',
        "compare": 'variables = ["position.z"]\nintervals = [0.02, 0.01]\nsurrogates = ["spline"]',
    }
    text = "\n".join(f"[{name}]\n{lines}" for name, lines in tables.items())
    (tmp_path / "mine.toml").write_text(text)
    said = suffice("study", tmp_path / "mine.toml", "-o", tmp_path / "mine")
    assert said.code == 0, said.err
    assert "64 particles, 40 snapshots read" in said.err
    assert "fluid.velocity.z" in (tmp_path / "mine" / "report.html").read_text()
    said = suffice("study", tmp_path / "mine.toml", "-o", tmp_path / "mine")
    assert "import: nothing changed, kept" in said.err
