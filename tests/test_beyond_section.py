"""The report's section on what lies beyond the window, and the study that asks for it."""

import copy

import numpy as np
import plotly.graph_objects as go
import pytest

from suffice.beyond import compare_beyond
from suffice.beyond_section import beyond_section, horizon_figure
from suffice.comparing import Comparing, compare_as_wished
from suffice.making import is_trained
from suffice.progress import Reporter
from suffice.report import render
from suffice.run import Run
from suffice.store import RunWriter
from surrogates import SURROGATES

N, INTERVAL, DIAMETER = 40, 0.001, 2e-3


@pytest.fixture(scope="module")
def waves(tmp_path_factory):
    """Return a run of travelling waves whose wavelength shortens, so that modes of the past age."""
    path, place = tmp_path_factory.mktemp("section") / "waves.h5", np.linspace(0, 1, N)[:, None]
    number, omega = np.array([3.0, 5.0, 8.0]), np.array([60.0, 90.0, 130.0])
    with RunWriter(
        path,
        ids=np.arange(N),
        radius=np.full(N, DIAMETER / 2),
        species=np.ones(N, int),
        n_snapshots=121,
        variables=("position", "velocity"),
        precision="double",
        provenance={},
    ) as run:
        for t in INTERVAL * np.arange(121):
            phase = 2 * np.pi * number * (1 + 2 * t) * place - omega * t
            rate = 4 * np.pi * number * place - omega
            run.append(t, {"position": 1e-3 * np.sin(phase), "velocity": 1e-3 * rate * np.cos(phase)})
    with Run(path) as opened:
        yield opened


@pytest.fixture(scope="module")
def answer(waves):
    asked = ["spline", "dmd", "raw-hermite", "raw-linear", "ballistic"]
    return compare_beyond(waves, ["position.x", "position.y"], 0.002, asked, horizons=(1, 10))


def lines(answer, origin):
    return {
        line["hovertemplate"].partition(":")[0]: line for line in horizon_figure(answer, "position.x", origin)["data"]
    }


def row(answer, surrogate):
    return [r for r in answer["rows"] if r["surrogate"] == surrogate and r["variable"] == "position.x"][-1]


def test_a_line_is_the_error_in_diameters_one_snapshot_ahead_and_on(answer):
    ends, everywhere = lines(answer, "end"), lines(answer, "starts")
    for name in ("dmd", "raw-linear", "ballistic", "persistence"):
        found = row(answer, name)
        assert ends[name]["x"] == list(range(1, 11))
        assert ends[name]["y"] == pytest.approx(np.array(found["from_end"]["rmse"]) / DIAMETER, rel=1e-5)
        assert everywhere[name]["y"] == pytest.approx(found["rmse_diameters"], rel=1e-5)


def test_regressors_in_time_are_drawn_from_the_end_of_training_only(answer):
    assert "spline" in lines(answer, "end")
    assert not any(name.startswith("spline") for name in lines(answer, "starts"))


def test_baselines_are_grey_and_the_floor_is_dashed_and_lies_below_every_model_from_the_same_starts(answer):
    for origin, models in (("end", ("spline", "dmd")), ("starts", ("dmd",))):
        drawn = lines(answer, origin)
        assert drawn["persistence"]["line"]["color"] == drawn["ballistic"]["line"]["color"]
        most = row(answer, "dmd")["modes"]
        floor = drawn[f"floor, {most} modes"]
        assert floor["line"]["dash"] == "dash"
        for name in models:
            # figures of six digits
            assert all(np.array(floor["y"]) <= np.array(drawn[name]["y"]) * (1 + 1e-5)), (origin, name)


def test_what_errs_ten_times_as_much_as_persistence_leaves_the_figure(answer):
    gone = copy.deepcopy(answer)
    row(gone, "spline")["from_end"]["rmse"][-1] = 1.0  # m
    figure = horizon_figure(gone, "position.x", "end")
    low, high = (10**power for power in figure["layout"]["yaxis"]["range"])
    still = max(lines(gone, "end")["persistence"]["y"])
    assert max(lines(gone, "end")["spline"]["y"]) == 1.0 / DIAMETER
    assert high == pytest.approx(10 * still * 10**0.1)
    assert low < min(y for line in figure["data"] for y in line["y"])


def test_a_surrogate_has_the_same_colour_from_either_start(answer):
    ends, everywhere = lines(answer, "end"), lines(answer, "starts")
    assert {"dmd", "raw-linear", "persistence"} <= set(everywhere)
    for name in everywhere:
        if name in ends:
            assert everywhere[name]["line"] == ends[name]["line"], name


def test_one_entry_of_the_legend_switches_all_lines_on_fewer_modes(answer):
    few = [line for line in horizon_figure(answer, "position.x", "end")["data"] if line.get("legendgroup") == "few"]
    assert len(few) == 3  # the floor, spline and dmd
    assert [line.get("showlegend", True) for line in few] == [True, False, False]


def test_a_curve_ends_where_its_rollout_is_lost(answer):
    cut = copy.deepcopy(answer)
    for r in cut["rows"]:
        if r["surrogate"] == "dmd":
            r["rmse"][4:] = [None] * 6
    assert lines(cut, "starts")["dmd"]["y"][4:] == [None] * 6


def test_plotly_accepts_every_figure_and_the_page_names_variables_steps_and_starts_safely(answer):
    evil = "<img src=x>"
    answer = {**answer, "left_out": [{"variable": "x", "unit": "m", "surrogate": evil, "reason": evil}]}
    section = beyond_section({"compare": {"beyond": [answer]}})
    names = ["|".join((v, "2 ms", origin)) for v in ("position.x", "position.y") for origin in ("end", "starts")]
    assert list(section.figures) == names
    for figure in section.figures.values():
        go.Figure(figure, skip_invalid=False)
    page = render({"compare": {"beyond": [answer]}})
    assert "Beyond the window" in page
    assert evil not in page
    for sentence in answer["sentences"].values():
        assert sentence in page
    assert "Beyond the window" not in render({"compare": {"beyond": []}})


def test_a_study_predicts_beyond_the_window_where_it_is_asked_to_and_trains_nothing_for_it(waves):
    wish = Comparing(variables=["position.x"], intervals=[0.004], surrogates=["linear"], beyond=[0.004])
    (found,) = compare_as_wished(waves, wish, {}, 0, Reporter(as_json=True))["beyond"]
    assert found["interval"] == 0.004
    tried = {r["surrogate"] for r in found["rows"]} | {left["surrogate"] for left in found["left_out"]}
    assert tried == {name for name in SURROGATES if not is_trained(name)}
    assert Comparing().beyond == []
