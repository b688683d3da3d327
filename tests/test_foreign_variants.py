"""Runs as their programs write them in other ways: tilted, stopped and restarted, on several processes, compressed."""

import gzip
import re
import shutil

import numpy as np
import pytest

from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.selecting import select_run
from suffice.store import Run


def imported(sources, output, **options):
    import_run(sources, output, precision="double", **options)
    return Run(output)


def judged(run, *variables):
    """Every variable got a verdict at every Δτ."""
    table = select_run(run, variables)
    for name in variables:
        assert table[name].candidates
        assert all(candidate.n_lr >= 1 for candidate in table[name].candidates)


def test_dumps_of_a_tilted_box_that_shears_flips_and_restarts_are_what_lammps_unwraps_itself(unpacked, tmp_path):
    folder = unpacked("lammps", "tilted")
    with (
        imported(folder / "unwrapped.dump", tmp_path / "u.h5", timestep=5e-6) as unwrapped,
        imported([*folder.glob("scaled.*")], tmp_path / "s.h5", timestep=5e-6) as scaled,
        imported([*folder.glob("wrapped.*.gz")], tmp_path / "w.h5", timestep=5e-6) as wrapped,
        imported([*folder.glob("atom.*")], tmp_path / "a.h5") as atoms,
    ):
        assert (unwrapped.n_particles, unwrapped.n_snapshots, unwrapped.interval) == (40, 25, 0.004)
        moved = np.ptp(unwrapped.variable("position.x")[:], axis=1)
        assert moved.max() > 0.02  # two lengths of the box
        assert sorted(set(unwrapped.radius)) == [0.0005, 0.0007]
        # seven digits were written of at most 0.1 m; six of scaled ones by `dump atom`
        for run, digits in ((scaled, 1e-8), (wrapped, 1e-8), (atoms, 2e-8)):
            assert np.allclose(run.times, unwrapped.times, rtol=1e-12)
            for axis in "xyz":
                there = unwrapped.variable(f"position.{axis}")[:]
                assert np.abs(run.variable(f"position.{axis}")[:] - there).max() < digits
        said = dict(np.concatenate([np.loadtxt(folder / f"energy.{part}") for part in ("before", "after")]))
        mass = 2500.0 * 4 / 3 * np.pi * unwrapped.radius**3
        for k, step in enumerate(sorted(said)):
            energy = 0.5 * mass @ np.square(unwrapped.snapshot(k).values["velocity"]).sum(axis=1)
            assert energy == pytest.approx(said[step], rel=1e-6)  # seven digits of each velocity
        told = r"1 snapshots from step 9600 on left out: after a restart \S+scaled.after.dump goes on from there"
        assert re.search(told, scaled.provenance["notes"])
        judged(unwrapped, "position.x", "velocity.z")


def test_two_runs_that_share_a_step_are_not_taken_for_a_restarted_one(unpacked, tmp_path):
    folder = unpacked("lammps", "tilted")
    text = (folder / "scaled.after.dump").read_text()
    (folder / "scaled.after.dump").write_text(re.sub(r"(?m)^(7 1 \S+) \S+", r"\1 0.77", text))
    says = r"scaled.before.dump step 9600 and .*scaled.after.dump step 9600 are one step, and not the same particles in"
    with pytest.raises(Refusal, match=says):
        import_run([*folder.glob("scaled.*")], tmp_path / "run.h5", timestep=5e-6)
    (folder / "scaled.after.dump").write_text((folder / "scaled.before.dump").read_text())
    with pytest.raises(Refusal, match=r"both hold step 0 as the first one: .* \(no % in the name of the dump\)"):
        import_run([*folder.glob("scaled.*")], tmp_path / "run.h5", timestep=5e-6)


@pytest.mark.usefixtures("vtk")
def test_beads_that_two_processes_of_liggghts_write_are_the_beads_of_its_text(unpacked, tmp_path):
    post = unpacked("liggghts", "parallel") / "post"
    with (
        imported([*post.glob("*.pvtp"), *post.glob("*.vtk")], tmp_path / "v.h5", timestep=1e-5) as run,
        imported(post / "beads.dump", tmp_path / "t.h5", timestep=1e-5) as text,
    ):
        assert (run.n_particles, run.n_snapshots, run.interval) == (40, 15, 0.006)
        assert np.array_equal(run.times, text.times)
        assert np.array_equal(run.radius, text.radius)
        for name in text.variables:  # six digits of text; velocities below 1 m/s
            assert np.allclose(run.variable(name)[:], text.variable(name)[:], rtol=0, atol=6e-7)
        assert re.search("1 without particles before .*beads_600.pvtp left out", run.provenance["notes"])
        assert "16 files of walls left out" in run.provenance["notes"]
        assert "1 snapshots without atoms before step 600 left out" in text.provenance["notes"]
        judged(run, "position.z")
    with pytest.raises(Refusal, match="the sources hold walls alone; give the files of the particles"):
        import_run([*post.glob("*.vtk")], tmp_path / "v.h5", timestep=1e-5)
    with pytest.raises(Refusal, match=r"hold particles of 15 kinds"):  # the parts in place of their lists
        import_run([*post.glob("beads_*.vtp")], tmp_path / "v.h5", timestep=1e-5)


def numbers_in(path, components):
    """Read a list of OpenFOAM, written as text, without VTK."""
    inside = re.search(r"\n\d+\s*\n\((.*?)\n\)", path.read_text(), re.DOTALL).group(1)
    rows = np.array(re.sub(r"[()]", " ", inside).split(), float)
    return rows if components == 1 else rows.reshape(-1, components)


@pytest.mark.usefixtures("vtk")
def test_a_case_left_on_its_processors_is_what_reconstruct_par_puts_together(unpacked, tmp_path):
    case = unpacked("openfoam", "decomposed") / "box"
    with imported(case, tmp_path / "run.h5") as run:
        assert (run.n_particles, run.n_snapshots, run.interval) == (64, 10, 0.01)
        assert run.grid.shape == (9, 3, 3)
        assert "put together from processor0 to processor2" in run.provenance["notes"]
        cloud, values = case / "0.1" / "lagrangian" / "kinematicCloud", run.snapshot(9).values
        born_at = numbers_in(cloud / "origProcId", 1).astype(np.int64)
        assert set(born_at) == {0, 1, 2}
        ids = (born_at << 32) + numbers_in(cloud / "origId", 1).astype(np.int64)
        assert np.array_equal(np.sort(ids), run.ids)
        for name, file in (("position", "positions"), ("velocity", "U")):
            there = numbers_in(cloud / file, 4 if file == "positions" else 3)[np.argsort(ids), :3]
            assert np.allclose(values[name], there, rtol=1e-6, atol=1e-9)
        there = numbers_in(case / "0.1" / "U.air", 3).reshape(9, 3, 3, 3)
        assert np.allclose(values["fluid.velocity"], there, rtol=1e-6, atol=1e-8)
        crossed = run.variable("position.x")[:]
        assert (np.ptp(np.digitize(crossed, [-0.0025, 0.0025]), axis=1) > 0).sum() >= 5  # from one processor to another
        judged(run, "position.z", "fluid.velocity.z")


def without_a_time(case):
    shutil.rmtree(case / "processor1" / "0.05")


def without_a_field(case):
    (case / "processor1" / "0.1" / "U.air").unlink()


def without_a_cloud(case):
    shutil.rmtree(case / "processor2" / "0.04" / "lagrangian")


def collated(case):
    (case / "processor0").rename(case / "processors3")


def without_positions(case):
    for path in case.glob("processor*/*/lagrangian/*/positions"):
        path.rename(path.with_name("coordinates"))


@pytest.mark.usefixtures("vtk")
@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (without_a_time, r"processor0 and processor1 do not hold the same times, 0.05 s is in one of them alone"),
        (without_a_field, r"time 0.01 holds fluid.velocity, which the last time, 0.1 s, does not or has damaged"),
        (without_a_cloud, r"time 0.04: particle id \d+ is missing \(\d+ of 64 lost"),
        (collated, r"VTK cannot read processors3, files in collated form; run reconstructPar"),
        (without_positions, r"no positions of its cloud kinematicCloud; .* need foamToVTK first: .* --map cloud=none"),
    ],
)
def test_a_case_whose_processors_do_not_hold_the_same_is_refused(unpacked, tmp_path, spoil, says):
    case = unpacked("openfoam", "decomposed") / "box"
    spoil(case)
    with pytest.raises(Refusal, match=says):
        import_run(case, tmp_path / "run.h5")
    assert not (tmp_path / "run.h5").exists()


@pytest.fixture
def box(unpacked):
    """The first six times of a case."""
    case = unpacked("openfoam", "box") / "box"
    for path in case.glob("0.*"):
        if float(path.name) > 0.03:
            shutil.rmtree(path)
    return case


@pytest.mark.usefixtures("vtk")
def test_a_compressed_case_is_the_same_run(box, tmp_path):
    with imported(box, tmp_path / "plain.h5") as plain:
        for path in [*box.glob("0*/*"), *box.glob("0*/lagrangian/*/*"), *box.glob("constant/polyMesh/*")]:
            if path.is_file():  # as `writeCompression on` does
                path.with_name(f"{path.name}.gz").write_bytes(gzip.compress(path.read_bytes()))
                path.unlink()
        with imported(box, tmp_path / "packed.h5") as packed:
            assert packed.variables == plain.variables
            for name in plain.variables:
                assert np.array_equal(packed.variable(name)[:], plain.variable(name)[:])


@pytest.mark.usefixtures("vtk")
def test_a_cloud_in_a_flow_that_is_not_written_and_a_flow_without_its_cloud_are_runs(box, tmp_path):
    with imported(box, tmp_path / "run.h5", maps=["cloud=none"]) as run:
        assert (run.n_particles, run.quantities) == (0, ("fluid.velocity", "fluid.pressure", "fluid.void_fraction"))
    flow = (box / "0.02" / "U.air").read_bytes()
    for path in box.glob("0.*/*"):
        if path.is_file():
            path.unlink()
    with imported(box, tmp_path / "run.h5") as run:
        assert (run.n_particles, run.n_snapshots, run.grid) == (64, 6, None)
    (box / "0.02" / "U.air").write_bytes(flow)
    with pytest.raises(
        Refusal, match=r"time 0.02 holds U.air \[m/s\], the last time, 0.03 s, no fields at all; remove"
    ):
        import_run(box, tmp_path / "run.h5")
