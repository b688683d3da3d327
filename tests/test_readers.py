import gzip
import lzma
import tracemalloc

import numpy as np
import pytest

from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.store import Run

COLUMNS = "id type x y z vx vy vz omegax omegay omegaz radius"
BOX = ("BOX BOUNDS ff ff ff", "0 0.1", "0 0.1", "-0.02 0.2")
STEPS = (0, 100, 200, 300)


def atoms(k, n=5):
    """Values of the columns of snapshot k by name, particles in another order each time, from six digits."""
    ids = np.random.default_rng(k).permutation(n) + 11
    values = {"id": ids, "type": ids % 2 + 1, "radius": np.where(ids % 2, 0.0015, 0.002)}
    for i, name in enumerate(COLUMNS.split()[2:11]):
        values[name] = [float(f"{np.sin(particle + 0.1 * k + i):.6g}") for particle in ids]
    return values


def snapshot(k, columns=COLUMNS, n=5, box=BOX, above=(), **changed):
    """One snapshot as LAMMPS writes it; `above` are lines before its time step, `changed` replaces columns."""
    values = atoms(k, n) | changed
    rows = zip(*(values[name] for name in columns.split()), strict=True)
    lines = [*above, "ITEM: TIMESTEP", str(STEPS[k]), "ITEM: NUMBER OF ATOMS", str(n), f"ITEM: {box[0]}", *box[1:]]
    lines += [f"ITEM: ATOMS {columns}", *(" ".join(map(str, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def dump(path, snapshots=None, **options):
    path.write_text("".join(snapshots or [snapshot(k, **options) for k in range(len(STEPS))]))
    return path


def replaced(k, name, particle, value):
    """Snapshot k in which a particle has another value in a column."""
    values = atoms(k)
    return snapshot(
        k, **{name: [value if i == particle else old for i, old in zip(values["id"], values[name], strict=True)]}
    )


def by_id(k, *names):
    values = atoms(k)
    order = np.argsort(values["id"])
    return np.array([np.asarray(values[name])[order] for name in names]).T


def imported(source, output, **options):
    import_run(source, output, **({"interval": 0.001} | options))
    return Run(output)


def test_particles_stand_in_the_order_of_their_ids_in_every_snapshot(tmp_path):
    with imported(dump(tmp_path / "a.dump"), tmp_path / "run.h5", precision="double") as run:
        assert np.array_equal(run.ids, np.arange(11, 16))
        assert np.array_equal(run.species, run.ids % 2 + 1)
        assert np.array_equal(run.radius, np.where(run.ids % 2, 0.0015, 0.002))
        for k in range(len(STEPS)):
            values = run.snapshot(k).values
            assert np.array_equal(values["position"], by_id(k, "x", "y", "z"))
            assert np.array_equal(values["velocity"], by_id(k, "vx", "vy", "vz"))
            assert np.array_equal(values["angular_velocity"], by_id(k, "omegax", "omegay", "omegaz"))


def test_columns_may_stand_in_any_order_with_others_between_that_are_reported(tmp_path):
    columns = "element z radius omegax y vx id x"
    source = dump(tmp_path / "a.dump", columns=columns, element=["Zr"] * 5)
    result = import_run(source, tmp_path / "run.h5", interval=0.001, precision="double")
    assert result.ignored == ("element", "omegax", "vx")
    assert result.variables == ("position",)
    with Run(tmp_path / "run.h5") as run:
        assert run.provenance["ignored"] == "element omegax vx"
        assert np.array_equal(run.snapshot(2).values["position"], by_id(2, "x", "y", "z"))


def test_a_column_that_liggghts_writes_twice_is_read_once(tmp_path):
    source = dump(
        tmp_path / "a.dump", columns="id type type x y z ix iy iz vx vy vz", ix=[0] * 5, iy=[0] * 5, iz=[0] * 5
    )
    with imported(source, tmp_path / "run.h5", precision="double") as run:
        assert np.array_equal(run.snapshot(1).values["velocity"], by_id(1, "vx", "vy", "vz"))


def test_a_dump_without_radius_takes_the_given_diameter_or_knows_none(tmp_path):
    source = dump(tmp_path / "a.dump", columns="id x y z")
    with imported(source, tmp_path / "run.h5") as run:
        assert np.isnan(run.radius).all()
    with imported(source, tmp_path / "run.h5", diameter=0.003) as run:
        assert np.array_equal(run.radius, np.full(5, 0.0015))


def test_a_diameter_column_is_halved(tmp_path):
    with imported(
        dump(tmp_path / "a.dump", columns="id x y z diameter", diameter=[0.003] * 5), tmp_path / "r.h5"
    ) as run:
        assert np.array_equal(run.radius, np.full(5, 0.0015))


def test_scaled_positions_are_fractions_of_the_box(tmp_path):
    scaled = {"xs": [0.0, 0.5, 1.0, 0.25, 0.75], "ys": [0.5] * 5, "zs": [0.0, 0.1, 0.2, 0.3, 1.0], "id": range(1, 6)}
    with imported(
        dump(tmp_path / "a.dump", columns="id xs ys zs", **scaled), tmp_path / "r.h5", precision="double"
    ) as run:
        position = run.snapshot(0).values["position"]
    assert np.allclose(position[:, 0], [0, 0.05, 0.1, 0.025, 0.075], rtol=1e-15)
    assert np.allclose(position[:, 2], [-0.02, 0.002, 0.024, 0.046, 0.2], rtol=1e-14)


def test_unwrapped_positions_are_preferred_to_wrapped_ones(tmp_path):
    unwrapped = {"xu": [7.0] * 5, "yu": [8.0] * 5, "zu": [9.0] * 5}
    with imported(dump(tmp_path / "a.dump", columns="id x y z xu yu zu", **unwrapped), tmp_path / "r.h5") as run:
        assert np.array_equal(run.snapshot(3).values["position"], np.tile([7, 8, 9], (5, 1)))


def test_a_particle_that_crosses_a_periodic_face_does_not_jump(tmp_path):
    def crossing(k):
        x = 0.08 + 0.01 * k  # crosses the face at 0.1 m at the third snapshot
        place = {"id": [1], "x": [x % 0.1], "y": [0.05], "z": [0.05], "ix": [int(x >= 0.1)], "iy": [0], "iz": [0]}
        return snapshot(k, "id x y z ix iy iz", n=1, box=("BOX BOUNDS pp pp ff", *BOX[1:]), **place)

    source = dump(tmp_path / "a.dump", [crossing(k) for k in range(4)])
    with imported(source, tmp_path / "run.h5", precision="double") as run:
        assert np.allclose(run.variable("position.x")[0:1], [[0.08, 0.09, 0.10, 0.11]], rtol=1e-14)
        assert "unwrapped" in run.provenance["notes"]


def test_snapshots_before_the_first_atom_are_left_out_and_told(tmp_path):
    source = dump(tmp_path / "a.dump", [snapshot(0, n=0), *(snapshot(k) for k in (1, 2, 3))])
    with imported(source, tmp_path / "run.h5", interval=None, timestep=1e-5, precision="double") as run:
        assert np.allclose(run.times, [0.001, 0.002, 0.003], rtol=1e-15)
        assert np.array_equal(run.snapshot(0).values["position"], by_id(1, "x", "y", "z"))
        assert "1 snapshots without atoms before step 100 left out" in run.provenance["notes"]


def test_a_general_box_is_spanned_by_the_edges_it_names(tmp_path):
    box = ("BOX BOUNDS abc origin", "0.1 0 0 0.5", "0.02 0.2 0 0.25", "0 0.01 0.4 -1")
    scaled = {"xs": [0, 1, 0, 0, 0.5], "ys": [0, 0, 1, 0, 0.5], "zs": [0, 0, 0, 1, 0.5], "id": range(1, 6)}
    source = dump(tmp_path / "a.dump", columns="id xs ys zs", box=box, **scaled)
    with imported(source, tmp_path / "run.h5", precision="double") as run:
        corner, a, b, c = (np.array(row) for row in ([0.5, 0.25, -1], [0.1, 0, 0], [0.02, 0.2, 0], [0, 0.01, 0.4]))
        there = [corner, corner + a, corner + b, corner + c, corner + (a + b + c) / 2]
        assert np.allclose(run.snapshot(0).values["position"], there, rtol=1e-14)


def test_a_run_restarted_twice_keeps_what_was_written_last(tmp_path):
    source = dump(tmp_path / "a.dump", [snapshot(k) for k in (0, 1, 2, 1, 2, 3, 2, 3)])
    with imported(source, tmp_path / "run.h5", precision="double") as run:
        assert run.n_snapshots == 4
        for k in range(4):
            assert np.array_equal(run.snapshot(k).values["position"], by_id(k, "x", "y", "z"))
        assert run.provenance["notes"].count("after a restart") == 2


def test_wrapped_positions_in_a_periodic_box_are_noted(tmp_path):
    source = dump(tmp_path / "a.dump", box=("BOX BOUNDS pp ff ff", *BOX[1:]))
    assert any("periodic" in note for note in import_run(source, tmp_path / "r.h5", interval=0.001).notes)


@pytest.mark.parametrize("compress", [gzip.compress, lzma.compress], ids=["gz", "xz"])
def test_a_compressed_dump_is_told_by_its_content(tmp_path, compress):
    source = tmp_path / "a.dump"
    source.write_bytes(compress(dump(source).read_bytes()))
    with imported(source, tmp_path / "run.h5", precision="double") as run:
        assert np.array_equal(run.snapshot(3).values["position"], by_id(3, "x", "y", "z"))


def test_one_file_per_snapshot_is_put_in_the_order_of_time(tmp_path):
    sources = [dump(tmp_path / f"a.{k}", [snapshot(k)]) for k in (2, 0, 3, 1)]
    with imported(sources, tmp_path / "run.h5", precision="double") as run:
        for k in range(4):
            assert np.array_equal(run.snapshot(k).values["position"], by_id(k, "x", "y", "z"))


def test_lines_may_end_as_windows_ends_them(tmp_path):
    source = dump(tmp_path / "a.dump")
    source.write_bytes(source.read_bytes().replace(b"\n", b"\r\n") + b"\r\n")
    with imported(source, tmp_path / "run.h5", precision="double") as run:
        assert np.array_equal(run.snapshot(3).values["position"], by_id(3, "x", "y", "z"))


def test_the_physical_time_is_the_one_the_dump_says(tmp_path):
    said = [snapshot(k, above=("ITEM: UNITS", "si", "ITEM: TIME", f"{0.5 + 0.002 * k}")) for k in range(4)]
    with imported(dump(tmp_path / "a.dump", said), tmp_path / "run.h5", interval=None) as run:
        assert np.allclose(run.times, [0.5, 0.502, 0.504, 0.506], rtol=1e-15)
        assert run.interval == 0.002


def test_otherwise_it_is_the_steps_times_the_timestep_or_counts_intervals(tmp_path):
    source = dump(tmp_path / "a.dump")
    for options in ({"timestep": 1e-5}, {"interval": 0.001}, {"timestep": 1e-5, "interval": 0.001}):
        with imported(source, tmp_path / "run.h5", **({"interval": None} | options)) as run:
            assert np.allclose(run.times, [0, 0.001, 0.002, 0.003], rtol=1e-15)
            assert run.interval == 0.001


def cut_in_an_atom(path):
    text = dump(path).read_bytes()
    path.write_bytes(text[:-20])


def cut_in_the_header(path):
    path.write_text(snapshot(0) + "ITEM: TIMESTEP\n100\n")


def without_last_newline(path):
    path.write_bytes(dump(path).read_bytes()[:-1])


def cut_and_continued(path):
    path.write_text("".join(snapshot(0).splitlines(keepends=True)[:-2]) + snapshot(1))


def cut_archive(path):
    path.write_bytes(gzip.compress(dump(path).read_bytes())[:-30])


def with_one_atom_twice(path):
    dump(path, [snapshot(0), replaced(1, "id", 13, 14)])


def with_a_word(path):
    dump(path, [snapshot(0), replaced(1, "vy", 13, "fast")])


def with_an_extra_column(path):
    text = snapshot(1).splitlines()
    dump(path, [snapshot(0), "\n".join([*text[:-1], text[-1] + " 9"]) + "\n"])


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda _: None, r"missing"),
        (lambda path: path.mkdir(), r"folder"),
        (lambda path: path.touch(), r"empty"),
        (lambda path: path.write_bytes(b"\n\n"), r"no format suffice reads"),
        (lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n"), r"a.dump cannot be read"),
        (
            lambda path: dump(path, [snapshot(0), snapshot(1, n=4)]),
            r"step 100: particle id 15 is missing \(1 of 5 lost",
        ),
        (lambda path: dump(path, [snapshot(0), snapshot(1, n=6)]), r"step 100: particle id 16 is new \(1 more"),
        (with_one_atom_twice, r"step 100: particle id 14 stands there twice"),
        (cut_in_an_atom, r"step 300 at line 43 is cut: it has 4 whole lines of 5 atoms; remove that snapshot"),
        (without_last_newline, r"step 300 at line 43 is cut"),
        (
            lambda path: dump(path, [snapshot(0), snapshot(1).replace("ATOMS\n5", "ATOMS\n500000000000")]),
            r"step 100 at line 15 is cut: it has 5 whole lines of 500000000000 atoms",
        ),
        (
            lambda path: dump(path, [snapshot(0), snapshot(1).replace("TIMESTEP\n100", "TIMESTEP\n" + 30 * "9")]),
            r"line 15: step 9{30} is beyond any run; remove that snapshot",
        ),
        (lambda path: path.write_bytes(snapshot(0).encode() + b"0" * 5_000_000), r"line 15 has over 65536 bytes"),
        (cut_in_the_header, r"ends inside the header of the snapshot at line 15; remove"),
        (cut_and_continued, r"step 0 at line 1 is cut: it has 3 whole lines of 5"),
        (cut_archive, r"cannot be read to its end"),
        (
            lambda path: dump(path, [snapshot(0), replaced(1, "vy", 13, "nan")]),
            r"step 100: particle id 13 has vy = nan",
        ),
        (lambda path: dump(path, [replaced(0, "x", 12, "inf"), snapshot(1)]), r"step 0: particle id 12 has x = inf"),
        (with_a_word, r"step 100: particle id 13 has vy = fast, not a finite number; correct it"),
        (lambda path: dump(path, [replaced(0, "id", 12, 12.5)]), r"particle id 12.5 is not an integer"),
        (with_an_extra_column, r"step 100: line 5 of its atoms has 13 columns, not 12"),
        (lambda path: dump(path, columns="type x y z"), r"its columns are type x y z; particles need id and x y z"),
        (lambda path: dump(path, columns="id type x y"), r"its columns are id type x y; particles need id and x y z"),
        (lambda path: dump(path, [snapshot(0), snapshot(1, "id x y z")]), r"step 100: the columns change from id type"),
        (lambda path: dump(path, [snapshot(0), snapshot(2), snapshot(1)]), r"time step 100 .* does not come after 200"),
        (lambda path: dump(path, [snapshot(0), snapshot(0)]), r"a.dump holds step 0 as the first one: give every"),
        (
            lambda path: dump(path, [snapshot(0), replaced(1, "radius", 13, 0.001)]),
            r"id 13 has radius 0.001 m, but 0.0015",
        ),
        (lambda path: dump(path, [replaced(0, "radius", 13, -1)]), r"particle id 13 has radius -1 m"),
        (lambda path: dump(path, [snapshot(0, n=0)]), r"a.dump holds no atoms at any step"),
        (lambda path: dump(path, [snapshot(0), snapshot(1, n=0), snapshot(2)]), r"step 100 has 0 atoms; leave"),
        (lambda path: path.write_bytes(b"(\xb5/\xfd" + bytes(20)), r"packed by zstd, .*; unpack it with `zstd -d`"),
        (lambda path: path.write_bytes(b"\xf6" + b"\xff" * 7 + b"DUMPCUSTOM"), r"binary dump .* its tool binary2txt"),
        (
            lambda path: dump(
                path, columns="id xs ys zs", box=("BOX BOUNDS", *["0 1 0 0 0"] * 3), xs=[0] * 5, ys=[0] * 5, zs=[0] * 5
            ),
            r"BOX BOUNDS has 5 columns, not 2 to 4",
        ),
        (lambda path: dump(path, box=("BOX BOUNDS", "0 1 inf", "0 1 0", "0 1 0")), r"BOX BOUNDS is .*, not numbers"),
        (lambda path: dump(path, above=("ITEM: UNITS", "cgs")), r"UNITS is cgs; suffice reads SI"),
        (lambda path: dump(path, above=("ITEM: ENTRIES a b",)), r"'ITEM: ENTRIES a b' stands where a dump of atoms"),
    ],
)
def test_a_dump_that_cannot_be_followed_is_refused_and_leaves_nothing(tmp_path, spoil, says):
    source = tmp_path / "a.dump"
    spoil(source)
    (tmp_path / "out").mkdir()
    with pytest.raises(Refusal, match=says) as refusal:
        import_run(source, tmp_path / "out" / "run.h5", interval=0.001)
    assert "\n" not in str(refusal.value)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"format": "vtu"}, r"--format vtu is not known; use lammps, liggghts, vtk, openfoam, npz, hdf5"),
        ({"diameter": 0.0}, r"--diameter is 0 m; it must be a positive length in m"),
        (
            {"diameter": 0.003},
            r"--diameter is 0.003 m, but .* has diameters from 0.003 to 0.004 m; leave --diameter out",
        ),
    ],
)
def test_options_that_do_not_fit_the_dump_are_refused(tmp_path, options, says):
    with pytest.raises(Refusal, match=says):
        import_run(dump(tmp_path / "a.dump"), tmp_path / "run.h5", interval=0.001, **options)
    assert not (tmp_path / "run.h5").exists()


def test_an_import_never_writes_over_its_source(tmp_path):
    source = dump(tmp_path / "a.dump")
    text = source.read_text()
    with pytest.raises(Refusal, match="exists and is not a run"):
        import_run(source, source, interval=0.001)
    assert source.read_text() == text


def test_progress_counts_every_snapshot(tmp_path):
    seen = []
    import_run(
        dump(tmp_path / "a.dump"), tmp_path / "r.h5", interval=0.001, progress=lambda done, of: seen.append((done, of))
    )
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_a_run_of_lammps_comes_in_whole_to_its_six_digits(reference, tmp_path):
    # an independent reading of the dump: every line split, sorted by id, in double precision
    lines = lzma.decompress((reference / "shake.dump.xz").read_bytes()).decode().splitlines()
    rows = np.array([line.split() for k in range(301) for line in lines[k * 585 + 9 : (k + 1) * 585]], float)
    rows = rows.reshape(301, 576, 9)
    rows = np.take_along_axis(rows, np.argsort(rows[:, :, 0])[:, :, None], axis=1)
    with imported(reference / "shake.dump.xz", tmp_path / "shake.h5", precision="double") as run:
        assert (run.n_snapshots, run.n_particles, run.interval) == (301, 576, 0.001)
        for column, name in enumerate(run.variables, start=2):
            assert np.array_equal(run.variable(name)[0:576], rows[:, :, column].T)


def test_a_dump_in_which_a_snapshot_is_all_of_the_rest_takes_no_more_memory_than_others(tmp_path):
    source = dump(tmp_path / "a.dump", [snapshot(0).replace("ATOMS\n5", "ATOMS\n9999999")] + [snapshot(1)] * 20_000)
    size = source.stat().st_size
    tracemalloc.start()
    with pytest.raises(Refusal, match="it has 5 whole lines of 9999999 atoms"):
        import_run(source, tmp_path / "run.h5", interval=0.001)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert size > 9e6
    assert peak < 6e6
