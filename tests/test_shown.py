"""Results in a notebook and on a terminal: they tell their numbers, escape what they are given, and stay small."""

import json
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import suffice as public
from pod import enriched_pod, lanczos_convergence, lanczos_pod
from selection import InputError, sweep
from suffice import Refusal, Run, Selection, Tradeoff, compare_run, plot, select_run
from surrogates import CONDITION_SURROGATES, SURROGATES

HOSTILE = "<script>alert('x')</script>\"&"
TIMES = 1e-3 * np.arange(101)  # s


@pytest.fixture(autouse=True)
def no_windows():
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    yield
    plt.close("all")


@pytest.fixture(scope="module")
def waves():
    shapes = np.random.default_rng(0).normal(size=(50, 24))
    k = np.arange(1, 25)[:, None]
    return shapes @ (0.5**k * np.sin(80.0 * k * TIMES + k**2))


@pytest.fixture(scope="module")
def table(waves):
    return sweep(waves, TIMES, intervals=[0.010, 0.005, 0.002])


@pytest.fixture
def run(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5")) as opened:
        yield opened


def cells(html):
    """Return the rows of a table as texts."""
    rows = re.findall(r"<tr>(.*?)</tr>", html)
    return [re.findall(r"<t[hd][^>]*>(?:<b>)?(.*?)(?:</b>)?</t[hd]>", row) for row in rows]


def test_a_sweep_shows_every_candidate_and_what_the_rule_chooses(table):
    head, *rows = cells(table._repr_html_())
    assert len(rows) == len(table.candidates)
    for row, candidate in zip(rows, table.candidates, strict=True):
        shown = dict(zip(head, row, strict=True))
        assert float(shown["Δτ (s)"]) == candidate.interval
        assert (int(shown["n_lr"]), int(shown["n_c"])) == (candidate.n_lr, candidate.n_c)
        assert float(shown["K_f"]) == pytest.approx(candidate.K_f, abs=0.005)
        assert float(shown["error_n_c"]) == pytest.approx(candidate.error_n_c, rel=0.01)
        assert (shown["rule"] == "✓") == candidate.sufficient
        assert shown["verdict"] == candidate.verdict
    assert "Δτ = 0.002 s suffices" in str(table)
    assert table.candidates[-1].reasons[0] in table._repr_html_()
    assert [line.split() for line in repr(table).splitlines()[2:]] == [" ".join(row).split() for row in rows]


def test_a_candidate_is_found_by_its_interval_or_the_ones_there_are_are_named(table):
    assert table.at(0.005) is table.candidates[1]
    assert table.at(5 * 1e-3 + 1e-15) is table.candidates[1]
    with pytest.raises(InputError, match=r"interval: 0\.004 s was not judged; there are 0\.01, 0\.005, 0\.002 s"):
        table.at(0.004)


def test_a_verdict_has_the_colour_of_the_report_and_no_other_word_has_one(table):
    from selection.table import COLOURS

    candidate = table.candidates[0]
    assert COLOURS[candidate.verdict] in candidate._repr_html_()
    assert "color" not in candidate._replace(verdict="fine")._repr_html_()


def test_nothing_that_comes_from_outside_is_html(table, run, tmp_path, write_run):
    candidate = table.candidates[0]._replace(verdict=HOSTILE, reasons=[HOSTILE])
    rows = compare_run(run, ["position.x"], [0.004], ["linear"])
    rows["rows"][0] |= {"surrogate": HOSTILE, "on_front": {"storage_bytes": True}}
    named = Run(write_run(tmp_path / "<b>&x.h5"))
    choice = {"position.x": {"sentence": HOSTILE}}
    for shown in (candidate, Selection({HOSTILE: table}), Tradeoff({**rows, "choice": choice}), named):
        html = shown._repr_html_()
        assert "<script" not in html
        assert "<b>&" not in html
        assert "&lt;" in html
        assert not re.search(r'title="[^"]*"[^ >]', html)
    named.close()


def test_a_basis_shows_what_it_holds_and_not_its_rows(waves):
    basis = lanczos_pod(np.tile(waves, (400, 1)), energy=0.999)
    text, html = repr(basis), basis._repr_html_()
    for shown in (text, html):
        assert f"{basis.modes.shape[1]} modes of 20000 rows" in shown
        assert basis.route_reason in shown
        assert f"{basis.ratio[-1]:.6g}" in shown
        assert len(shown) < 1500
    few = lanczos_pod(waves, modes=1)
    assert "more than 1" in repr(few)


def test_a_convergence_shows_its_last_ratio_even_where_there_are_no_steps(waves):
    basis = lanczos_pod(waves, route="gram")
    assert f"ratio {basis.ratio[-1]:.6g}, n_lr {basis.n_lr}" in repr(lanczos_convergence(basis))
    assert repr(lanczos_convergence(lanczos_pod(waves, route="svd"))) == "Lanczos convergence, 0 points"


def test_an_enriched_basis_shows_the_weight_that_was_chosen(waves):
    enriched = enriched_pod(waves, np.gradient(waves, TIMES, axis=1), range(0, 101, 4), 0.004)
    assert f"{enriched.weight:g} of the velocities" in repr(enriched)
    assert enriched._repr_html_().count("<tr>") == 3


def test_a_run_shows_its_facts_also_when_it_is_closed(run):
    run.close()
    for shown in (repr(run), run._repr_html_()):
        for fact in ("24", "41, from 0 to 0.04 s", "1 ms", "position.x", "velocity.z"):
            assert fact in shown
        assert "uneven" not in shown


def test_a_run_of_unknown_size_says_so(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5", n_snapshots=1, radius=float("nan"))) as run:
        assert "diameter   unknown" in repr(run)
        assert "interval   –" in repr(run)


def test_a_surrogate_says_its_settings_and_window():
    rbf = SURROGATES["rbf"](kernel="cubic")
    assert repr(rbf) == "Rbf(kernel='cubic', shape=None), not fitted"
    between = CONDITION_SURROGATES["rbf"]().fit([[600.0], [900.0]], [[1.0], [2.0]])
    assert repr(between).endswith("seed=0), fitted from [600.0] to [900.0]")
    assert repr(rbf.fit(TIMES, np.sin(TIMES)[:, None])).endswith("fitted from 0 to 0.1 s, every 0.001 s")


def test_a_selection_is_a_dictionary_that_shows_every_variable(run):
    found = select_run(run, ["position.x", "velocity.z"], intervals=[0.004, 0.002])
    assert list(found) == ["position.x", "velocity.z"]
    head, *rows = cells(found._repr_html_())
    assert head == ["Δτ (s)", "position.x", "velocity.z"]
    for k, row in enumerate(rows):
        K_f = [table.candidates[k].K_f for table in found.values()]
        assert [float(cell) for cell in row[1:]] == pytest.approx(K_f, abs=0.005)
    assert all(sentence in repr(found) for sentence in found.sentences())


def test_a_tradeoff_shows_its_front_and_is_still_plain_json(run):
    found = compare_run(run, ["position.x", "position.y"], [0.004], ["spline", "linear", "raw-linear"])
    assert json.loads(json.dumps(found)) == json.loads(json.dumps(dict(found)))
    assert repr(found).splitlines()[0].startswith(f"{len(found.front())} of {len(found['rows'])} alternatives")
    one = found.of("position.y")
    assert {row["variable"] for row in one["rows"]} == {"position.y"}
    assert len(cells(one._repr_html_())) == 1 + len(one.front())
    with pytest.raises(Refusal, match=r"'position\.z' was not compared; there are position\.x, position\.y"):
        found.of("position.z")


def test_one_call_draws_what_the_table_says(table, waves, run):
    axes = plot(table)
    assert axes.lines[0].get_ydata() == pytest.approx([c.K_f for c in table.candidates])
    assert axes.lines[0].get_xdata() == pytest.approx([10.0, 5.0, 2.0])  # ms
    basis = lanczos_pod(waves)
    assert plot(basis).lines[0].get_ydata() == pytest.approx(1.0 - basis.ratio)
    assert len(plot(lanczos_convergence(basis)).lines) == 2
    candidate = table.candidates[1]
    assert f"n_c = {candidate.n_c}" in [line.get_label() for line in plot(candidate).lines]
    selected = select_run(run, ["position.x", "velocity.z"], intervals=[0.004, 0.002])
    assert [text.get_text() for text in plot(selected).get_legend().get_texts()] == ["position.x", "velocity.z"]


def test_a_tradeoff_is_drawn_one_variable_at_a_time(run):
    found = compare_run(run, ["position.x", "velocity.y"], [0.004], ["spline", "linear"], precisions=[])
    with pytest.raises(Refusal, match=r"one variable, this one has 2; take \.of\('position\.x'\)"):
        plot(found)
    axes = plot(found.of("velocity.y"))
    assert "m/s" in axes.get_ylabel()
    assert sum(len(line.get_xdata()) for line in axes.lines) == len(found.of("velocity.y")["rows"])


def test_a_plot_without_matplotlib_names_what_to_install(table, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(Refusal, match="pip install matplotlib"):
        plot(table)


def test_a_plot_of_something_else_is_refused():
    with pytest.raises(Refusal, match="plot of a list is not known; give a sweep"):
        plot([1.0, 2.0])


def test_the_public_names_can_be_completed_and_loaded():
    assert dir(public) == sorted(public.__all__)
    assert list(public._HOMES) == public.__all__
    for name in public.__all__:
        assert callable(getattr(public, name))
    with pytest.raises(AttributeError, match="it has Refusal, Run"):
        _ = public.nothing


def test_no_public_name_is_that_of_a_module_which_would_take_its_place():
    modules = {path.stem for path in Path(public.__file__).parent.iterdir()}
    assert not modules & set(public.__all__)


@pytest.mark.physics  # for its time: a new process loads torch
def test_results_load_no_plotting_library_until_one_is_drawn():
    names = ("matplotlib", "pandas", "plotly")
    command = (
        "import sys, sim, pod, surrogates, selection; from suffice import Run, select_run, compare_run, plot; "
        f"print([name for name in {names} if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
