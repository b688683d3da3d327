"""Physics left out of a scene: averages of made-up runs are known, and so is what their differences must be."""

import json
from math import sqrt

import numpy as np
import pytest

from sim.collisions import BINS, impact_energy_edges
from suffice.omissions import Omissions
from suffice.omissions_compare import compare_omissions
from suffice.omissions_means import MEANINGS, Average, Means, Outcome, means_of
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.report import render
from suffice.run import Run
from suffice.store import RunWriter
from suffice.study import built_in_studies, load_study, run_study

SCENE = """
[[particles]]
diameter = 1e-3
density = 2500.0
count = 200

[contact]
stiffness = 1e3
restitution = 0.8

[gravity]
acceleration = [0.0, 0.0, -9.81]

[time]
duration = 1.0

[output]
interval = 0.01

[[walls]]
name = "paddle"
motion = { kind = "rotation", axis = [0.0, 0.0, 1.0], point = [0.003, 0.003, 0.0], rpm = 600.0 }
[[walls.shapes]]
shape = "cylinder"
axis = [1.0, 0.0, 0.0]
centre = [0.004, 0.003, 0.003]
radius = 0.0002
length = 0.001
particles = "outside"
"""
COST = {"n_particles": 200, "steps": 1000, "seconds": 10.0, "particle_steps_per_second": 2e4, "threads": 1}
COST |= {
    "predicted_seconds": 9.0,
    "processor_seconds": 10.0,
    "time_step": 1e-4,
    "seconds_of": {"lists": 2.0, "momentum": 3.0},
}
SEEDS = 3


def run_of(path, pace=1.0, power=2.0, lift=0.0, seed=0):
    """Made-up beads that drift at random, with impacts of 1e-7 J and a paddle whose power is known."""
    rng = np.random.default_rng(seed)
    n, count = 200, 41
    place = rng.uniform(0.0, 0.006, (n, 3)) + np.array([0.0, 0.0, lift])
    way = rng.normal(size=(n, 3))
    way *= 0.1 / np.sqrt((way**2).sum(axis=1).mean())  # kinetic energy Σ ½ m v² is that of 0.1 m/s each
    edges = impact_energy_edges()
    impacts = np.zeros((2, BINS))
    impacts[0, np.searchsorted(edges, 1.1e-7) - 1] = 1e3 * pace
    series = ["power.paddle", "energy.dissipated", "overlap.100", "coordination"]
    particles = {"ids": np.arange(n), "radius": np.full(n, 5e-4), "species": np.zeros(n, int)}
    with RunWriter(
        path, **particles, n_snapshots=count, variables=("position", "velocity"), series=sorted(series),
        impact_energy=edges, provenance={"scene": SCENE}, precision="double",
    ) as run:  # fmt: skip
        for k in range(count):
            time, started = 0.01 * k, k > 10
            values = {"position": place + pace * time * way * 0.01, "velocity": pace * way * (1.0 if started else 5.0)}
            told = {
                "power.paddle": power if started else 9.0,
                "energy.dissipated": 0.5 * time,
                "overlap.100": 0.02 if k == 20 else 0.01,
                "coordination": 3.0,
            }
            run.append(time, values, told, impacts)
    return path


def averaged(path, like=None, **flow):
    with Run(run_of(path, **flow)) as run:
        return means_of(run, 0.11, "position.x", 0.03, like)


def value_of(means, name):
    (value,) = means.observables[name].values
    return float(value)


def outcome(name, numbers, seconds=10.0, left_out="something"):
    """A run whose averages are given: numbers, or profiles as lists."""
    found = {
        key: Average(np.atleast_1d(value), np.ones(np.size(value)), np.zeros((0, np.size(value))))
        for key, value in numbers.items()
    }
    cost = COST | {"seconds": seconds, "processor_seconds": seconds, "particle_steps_per_second": 2e5 / seconds}
    means = Means(found, {}, {}, {"chosen_interval": 0.003, "K_f": 2.0, "by_interval": {}}, (0.1, 0.4), 4800)
    return Outcome(name, left_out, cost, means)


def three(values, name="power.shaft"):
    return [outcome(f"reference {k}", {name: value}) for k, value in enumerate(values)]


def test_averages_of_a_made_up_run_are_those_it_was_made_with(tmp_path):
    means = averaged(tmp_path / "run.h5")
    mass = 2500.0 * np.pi * 1e-9 / 6.0
    assert value_of(means, "kinetic_energy") == pytest.approx(0.5 * 200 * mass * 0.01, rel=1e-9)
    assert value_of(means, "power.shaft") == pytest.approx(2.0, rel=1e-12)  # the start-up, at 9 W, counts not
    assert value_of(means, "dissipation.contacts") == pytest.approx(0.5, rel=1e-12)
    assert value_of(means, "overlap.largest") == pytest.approx(0.02)
    assert value_of(means, "impacts.pairs.rate") == pytest.approx(1e3)
    assert value_of(means, "impacts.pairs.power") == pytest.approx(1e3 * 1.26e-7, rel=0.02)
    assert means.observables["dissipation.contacts"].parts == pytest.approx(np.full((4, 1), 0.5))
    assert means.observables["overlap.largest"].parts.size == 0
    assert means.window == pytest.approx((0.11, 0.4))
    assert set(means.observables) <= set(MEANINGS)


def test_the_solids_of_a_profile_are_those_of_the_beads(tmp_path):
    means = averaged(tmp_path / "run.h5")
    for name in ("void_fraction.height", "void_fraction.radius"):
        solid = means.observables[name]
        volume = 200 * np.pi * 1e-9 / 6.0
        assert float(solid.values @ solid.weights) == pytest.approx(volume, rel=0.02)


def test_a_run_is_held_against_another_in_the_same_bins_however_far_its_beads_reach(tmp_path):
    first = averaged(tmp_path / "a.h5")
    higher = averaged(tmp_path / "b.h5", like=first, lift=0.002)
    assert higher.bins["height"] is first.bins["height"]
    own, other = (m.observables["void_fraction.height"] for m in (first, higher))
    place = np.arange(len(own.values))
    centre = [float((place * m.values) @ m.weights / (m.values @ m.weights)) for m in (own, other)]
    assert centre[1] > centre[0] + 1.0


def test_a_variant_equal_to_the_scene_differs_by_zero_and_one_twice_as_fast_has_four_times_the_energy(tmp_path):
    same = averaged(tmp_path / "a.h5")
    fast = averaged(tmp_path / "b.h5", like=same, pace=2.0)
    reference = [Outcome(f"reference {k}", "", COST, same) for k in range(SEEDS)]
    variants = [Outcome("same", "nothing", COST, same), Outcome("fast", "brakes", COST, fast)]
    answer = compare_omissions(reference, variants, ["kinetic_energy", "impacts.pairs.power"], 0.1)
    nothing, twice = answer["rows"]
    known = {name: value for name, value in nothing["differences"].items() if value is not None}
    assert set(nothing["differences"]) - set(known) == {"impacts.walls.rate", "impacts.walls.power", "feasibility"}
    assert max(map(abs, known.values())) < 1e-14  # those of which the scene has none cannot differ by a share of it
    assert nothing["error"] < 1e-14
    assert twice["differences"]["kinetic_energy"] == pytest.approx(3.0, rel=1e-9)
    assert twice["differences"]["impacts.pairs.power"] == pytest.approx(1.0, rel=1e-9)
    assert (twice["error"], twice["error_in"]) == (twice["differences"]["kinetic_energy"], "kinetic_energy")
    assert not twice["keeps"]


def test_the_noise_is_what_a_further_packing_would_show():
    answer = compare_omissions(three([9.0, 10.0, 11.0]), [outcome("less", {"power.shaft": 8.0})], ["power.shaft"], 0.5)
    # s = 1, of three runs: s √(1 + 1/3) over the mean of 10
    assert answer["observables"]["power.shaft"]["floor"] == pytest.approx(sqrt(4.0 / 3.0) / 10.0, rel=1e-12)
    (row,) = answer["rows"]
    assert row["differences"]["power.shaft"] == pytest.approx(-0.2)
    assert row["floors"]["power.shaft"] == pytest.approx(-2.0 / sqrt(4.0 / 3.0), rel=1e-12)
    # Student's t with two degrees of freedom, 95 %: 4.303
    assert answer["floors_to_be_real"] == pytest.approx(4.3027, abs=1e-3)
    assert not row["real"]["power.shaft"]
    assert max(answer["scatter_error"]) == pytest.approx(1.5 / 9.5, rel=1e-12)  # 11 against the mean of 9 and 10


def test_seeds_that_agree_by_chance_do_not_hide_that_each_quarter_of_the_time_differs():
    quarters = [[8.0, 12.0, 8.0, 12.0], [12.0, 8.0, 12.0, 8.0]]
    reference = [
        Outcome(f"reference {k}", "", COST, own.means._replace(observables={"power.shaft": average}))
        for k, own in enumerate(three([10.0, 10.0]))
        for average in [Average(np.array([10.0]), np.ones(1), np.array(quarters[k])[:, None])]
    ]
    answer = compare_omissions(reference, [], ["power.shaft"], 0.1)
    # of each quarter two values 4 apart: s² = 8, of the mean of four quarters 8 / 4
    assert answer["observables"]["power.shaft"]["floor"] == pytest.approx(sqrt(1.5) * sqrt(2.0) / 10.0, rel=1e-12)


def test_differences_of_runs_that_only_scatter_are_taken_for_real_once_in_twenty():
    rng, hits, tries = np.random.default_rng(1), 0, 2000
    for _ in range(tries):
        values = rng.normal(10.0, 1.0, SEEDS + 1)
        answer = compare_omissions(
            three(values[:SEEDS]), [outcome("again", {"power.shaft": values[SEEDS]})], ["power.shaft"], 0.1
        )
        hits += answer["rows"][0]["real"]["power.shaft"]
    assert 0.035 < hits / tries < 0.065


def test_a_profile_differs_by_its_size_over_that_of_the_scenes():
    reference = [outcome(f"reference {k}", {"void_fraction.radius": [0.3, 0.4]}) for k in range(SEEDS)]
    answer = compare_omissions(
        reference, [outcome("denser", {"void_fraction.radius": [0.3, 0.5]})], ["void_fraction.radius"], 0.1
    )
    assert answer["rows"][0]["differences"]["void_fraction.radius"] == pytest.approx(0.1 / 0.5, rel=1e-12)
    assert answer["observables"]["void_fraction.radius"]["profile"]


def chosen(variants, limit=0.1, values=(9.999, 10.0, 10.001)):
    return compare_omissions(three(values), variants, ["power.shaft"], limit)


def test_the_cheapest_variant_within_the_limit_is_chosen_and_what_is_worse_in_all_is_off_the_front():
    variants = [
        outcome("close", {"power.shaft": 10.1}, seconds=6.0),
        outcome("closer but dearer", {"power.shaft": 10.01}, seconds=8.0),
        outcome("far", {"power.shaft": 14.0}, seconds=1.0),
        outcome("far and dear", {"power.shaft": 15.0}, seconds=12.0),
    ]
    answer = chosen(variants)
    assert answer["choice"]["variant"] == "close"
    assert "6 s, 0.6 of the scene itself, for 1 % of power.shaft" in answer["choice"]["sentence"]
    assert [row["on_front"] for row in answer["rows"]] == [True, True, True, False]
    assert chosen(variants, limit=0.005)["choice"]["variant"] == "closer but dearer"
    assert chosen(variants, limit=0.5)["choice"]["variant"] == "far"
    assert chosen(variants, limit=1e-4)["choice"]["variant"] is None
    assert "no variant that is cheaper" in chosen(variants, limit=1e-4)["choice"]["sentence"]


def test_a_choice_that_scatter_could_turn_says_so():
    variants = [outcome("less", {"power.shaft": 9.5}, seconds=5.0)]
    sure, unsure = chosen(variants), chosen(variants, values=(9.0, 10.0, 11.0))
    assert (sure["rows"][0]["keeps"], sure["rows"][0]["certain"]) == (True, True)
    assert (unsure["rows"][0]["keeps"], unsure["rows"][0]["certain"]) == (True, False)
    assert "too large to be sure" in unsure["choice"]["sentence"]
    assert "too large" not in sure["choice"]["sentence"]


def test_what_a_variant_does_not_know_it_does_not_keep():
    reference = [outcome(f"reference {k}", {"power.shaft": 1.0, "fluid.kinetic": 2.0}) for k in range(SEEDS)]
    answer = compare_omissions(
        reference, [outcome("dry", {"power.shaft": 1.0}, seconds=1.0)], ["power.shaft", "fluid.kinetic"], 0.1
    )
    (row,) = answer["rows"]
    assert (row["missing"], row["keeps"], row["error"]) == (["fluid.kinetic"], False, None)
    assert answer["choice"]["variant"] is None


def test_a_refused_variant_is_listed_with_its_reason_and_is_never_chosen():
    refused = Outcome("too soft", "contact.stiffness = 1.0", None, None, "particle 3 overlaps <b>the wall</b>")
    answer = chosen([refused, outcome("close", {"power.shaft": 10.1}, seconds=6.0)])
    assert answer["rows"][0]["refused"] == refused.refused
    assert (answer["rows"][0]["keeps"], answer["rows"][0]["on_front"]) == (False, False)
    assert answer["choice"]["variant"] == "close"
    page = render({"omissions": answer | {"variable": "position.x"}})
    assert "Physics left out" in page
    assert "refused: particle 3 overlaps &lt;b&gt;the wall&lt;/b&gt;" in page


def test_an_observable_that_the_scene_does_not_have_is_refused_with_those_it_has():
    with pytest.raises(Refusal, match=r"'bed_height' is not known of reference 0; there are power.shaft"):
        compare_omissions(three([1.0, 2.0, 3.0]), [], ["bed_height"], 0.1)


def test_time_that_a_resumed_run_spent_before_counts_as_well():
    # the last half of the run took 5 s: 1000 steps at the speed of those 500
    cost = COST | {"seconds": 5.0, "processor_seconds": 5.0}
    resumed = outcome("resumed", {"power.shaft": 10.0})._replace(cost=cost)
    row = chosen([resumed])["rows"][0]
    assert row["seconds"] == pytest.approx(10.0)
    assert row["seconds_of"] == pytest.approx({"contact and motion": 0.0, "lists": 4.0, "momentum": 6.0})


def test_time_in_which_a_run_waited_for_the_machine_is_no_cost_of_it():
    waited = outcome("waited", {"power.shaft": 10.0})._replace(cost=COST | {"processor_seconds": 4.0})
    row = chosen([waited])["rows"][0]
    assert (row["seconds"], row["waited"]) == (pytest.approx(4.0), pytest.approx(0.6))
    assert row["seconds_of"] == pytest.approx({"contact and motion": 2.0, "lists": 0.8, "momentum": 1.2})
    # two threads use more of the processor than passes on the clock
    both = outcome("both", {"power.shaft": 10.0})._replace(cost=COST | {"processor_seconds": 19.0, "threads": 2})
    assert chosen([both])["rows"][0]["seconds"] == pytest.approx(10.0)


def test_a_start_up_that_leaves_nothing_to_average_is_refused(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5")) as run, pytest.raises(Refusal, match=r"start_up = 0\.039 s leaves 2"):
        means_of(run, 0.039, "position.x", 0.003)


STUDY = """scene = "my_scene.toml"

[omissions]
seeds = 2
start_up = 0.004
interval = 0.003
observables = ["kinetic_energy", "power.shaft"]
max_difference = 0.5

[[omissions.variants]]
name = "no friction"
changes = { "contact.friction" = 0.0 }

[[omissions.variants]]
name = "long step"
changes = { "time.step" = 1e-3 }
"""


def written(folder, beads, study=STUDY):
    (folder / "my_scene.toml").write_text(beads)
    (folder / "my.toml").write_text(study)
    return str(folder / "my.toml")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('"contact.friction" = 0.0', '"contact.friktion" = 0.0'), "contact.friktion"),
        (('"contact.friction" = 0.0', '"kontact.friction" = 0.0'), "changes: kontact.friction is no place in scene"),
        (('changes = { "contact.friction" = 0.0 }', 'without = ["fluid"]'), "without: fluid is no place in scene"),
        (('changes = { "contact.friction" = 0.0 }', ""), "nothing is left out; give without or changes"),
        (('scene = "my_scene.toml"\n', ""), "give either a scene"),
        (('"kinetic_energy", ', '"entropy", '), "observables: 'entropy' is not known; use kinetic_energy"),
        (('"kinetic_energy", ', '"impacts.pairs.power", '), "impacts.pairs.power needs output.impacts = true"),
        (("start_up = 0.004", "start_up = 0.019"), "start_up = 0.019 s leaves less than two intervals"),
        (("interval = 0.003", "interval = 0.0025"), "interval = 0.0025 s is no multiple of output.interval = 0.001 s"),
        (("seeds = 2", "seeds = 1"), "omissions.seeds"),
        (('"long step"', '"no friction"'), "'no friction' is taken; give another"),
        (('"long step"', '"../run"'), "omissions.variants.1.name"),
    ],
)
def test_a_study_of_omissions_that_cannot_be_is_refused_before_anything_runs(suffice, beads, tmp_path, change, says):
    study = written(tmp_path, beads, STUDY.replace(*change))
    answer = suffice("study", study, "-o", tmp_path / "out")
    assert answer.code == 2
    assert says in answer.err
    assert not (tmp_path / "out").exists()


def test_the_built_in_study_leaves_out_fluid_friction_and_stiffness_one_by_one():
    assert "omissions" in built_in_studies()
    _, study, _ = load_study("omissions")
    assert isinstance(study.omissions, Omissions)
    told = {variant.name: variant.left_out for variant in study.omissions.variants}
    assert told["dry"].startswith("no fluid, no drag, ")
    assert told["one-way"] == 'drag.coupling = "one-way"'
    assert told["stiffness by 10"] == "contact.stiffness = 1000.0"


@pytest.mark.physics
def test_a_study_of_omissions_runs_each_stage_once_and_a_refused_variant_is_an_answer(beads, tmp_path):
    study, out, said = written(tmp_path, beads), tmp_path / "out", []
    run_study(study, out, Reporter(as_json=True), said.append)
    assert [line.split(":")[0] for line in said] == [
        "simulate reference 0", "simulate reference 1", "simulate no friction", "simulate long step",
        "compare omissions", "report",
    ]  # fmt: skip
    results = json.loads((out / "results.json").read_text())
    smooth, long = results["omissions"]["rows"]
    assert smooth["refused"] is None
    assert smooth["predicted_seconds"] > 0.0
    # without friction nothing turns, so that snapshots hold a third less
    assert smooth["bytes_per_snapshot"] / results["omissions"]["reference"]["bytes_per_snapshot"] == pytest.approx(
        2 / 3
    )
    assert long["refused"].startswith("time.step = 0.001 s: above the limit of")
    assert not (out / "long_step.h5").exists()
    assert "Physics left out" in (out / "report.html").read_text()
    said.clear()
    run_study(study, out, Reporter(as_json=True), said.append)
    assert all("nothing changed" in line for line in said)
