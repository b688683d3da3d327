"""The report is one page that says what was found, loads nothing, and lets no name act as markup."""

import json
import math
import re
import shutil
import subprocess
from html.parser import HTMLParser

import plotly.graph_objects as go
import pytest

from suffice.plots import ticks
from suffice.refusal import Refusal
from suffice.report import render, write_report
from suffice.results import gather
from suffice.store import RunWriter
from suffice.verdicts import deciding
from suffice.wording import bytes_text, number, seconds_text

EVIL = "</script><img src=x onerror=alert(1)>&'\""
TITLES = {
    "select": ["Verdict", "Feasibility index"],
    "curves": ["Consistency"],
    "spectrum": ["Spectrum"],
    "compare": ["Error against Δτ", "What accuracy costs"],
    "series": ["Energy ledger"],
    "stages": ["Cost of each stage"],
    "provenance": ["Provenance"],
}


def candidate(interval, n_c, verdict, n_lr=20):
    K_f = n_c / n_lr
    return {
        "interval": interval,
        "n_snapshots": round(0.2 / interval) + 1,
        "n_lr": n_lr,
        "n_c": n_c,
        "K_f": K_f,
        "K_f_interval": [K_f - 0.05, K_f + 0.05],
        "R_a": 1.1,
        "sufficient": K_f >= 2,
        "verdict": verdict,
        "reasons": [f"K_f {K_f:.2f} measured"],
        "error_n_lr": 8e-4,
        "error_n_c": 1e-4,
        "error_n_lr_diameters": 0.8,
        "error_n_c_diameters": 0.1,
    }


def row(interval, surrogate, modes, rmse, seconds, variable="position.x"):
    return {
        "variable": variable,
        "interval": interval,
        "unit": "m",
        "n_snapshots": 51,
        "surrogate": surrogate,
        "modes": modes,
        "rmse": rmse,
        "rmse_diameters": rmse / 1e-3,
        "worst_rmse": 2 * rmse,
        "worst_time": 0.1,
        "projection_rmse": 0.9 * rmse,
        "ratio_to_floor": 1 / 0.9,
        "fit_seconds": 0.01,
        "single_seconds": seconds,
        "batch_seconds": seconds / 3,
        "storage_bytes": 12_345_678,
        "on_front": {"single_seconds": True, "storage_bytes": False},
    }


@pytest.fixture
def results():
    thresholds = {"energy": 0.999, "consistency": 1.05, "feasibility": 2.0, "resolution": 1.25}
    found = {
        "position.x": {
            "chosen_interval": 0.003,
            "thresholds": thresholds,
            "candidates": [candidate(0.004, 30, "insufficient"), candidate(0.003, 43, "sufficient")],
        },
        "position.y": {
            "chosen_interval": None,
            "thresholds": thresholds,
            "candidates": [candidate(0.004, 3, "insufficient"), candidate(0.003, 14, "undecidable")],
        },
    }
    ratio = [1.0 + 0.002 * n**2 for n in range(40)]
    curve = {"R_c": ratio, "R_gap": [r + 0.1 for r in ratio], "E_train": ratio, "E_test": ratio}
    rows = [row(dt, s, m, dt * 0.1, 1e-4) for dt in (0.004, 0.003) for s, m in (("rbf", 20), ("rbf", 50))]
    rows += [row(dt, "raw-hermite", None, dt * 0.05, 2e-4) for dt in (0.004, 0.003)]
    return {
        "study": "mini",
        "run": {"path": "run.h5", "n_particles": 2000, "n_snapshots": 201, "interval": 0.001, "diameter": 1e-3},
        "select": {"run": "run.h5", "dense_interval": 0.001, "variables": found},
        "curves": {name: {"0.004": curve, "0.003": curve} for name in found},
        "spectrum": {name: {"0.004": [0.9, 0.99, 1.0], "0.003": [0.9, 0.98, None]} for name in found},
        "compare": {"rows": rows, "choice": {"position.x": {"sentence": "position.x: raw-hermite is cheapest."}}},
        "stages": [
            {"name": "simulate", "seconds": 60.0, "detail": "2000 particles"},
            {"name": "sweep", "seconds": 1.0},
        ],
        "series": {"times": [0.0, 0.1], "kinetic": [0.0, 1.0], "balance": [2.0, 2.0], "max_overlap": [0.1, 0.1]},
        "provenance": {"seed": 7, "scene": "[particles]\ncount = 2000\n"},
    }


class Page(HTMLParser):
    """What a browser finds in the page: tags with attributes, visible text, and the figures."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self.data, self.inside = [], [], "", None
        self.feed(text)
        self.figures = json.loads(self.data)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self.inside = (tag, dict(attrs))

    def handle_endtag(self, tag):
        if tag in ("script", "style"):
            self.inside = None

    def handle_data(self, data):
        if self.inside is None:
            self.words.append(data)
        elif self.inside[1].get("id") == "figures":
            self.data += data

    @property
    def text(self):
        return re.sub(r"\s+", " ", "".join(self.words))

    def figure(self, part):
        """Figures of the first panel whose figures have an axis title with this text."""
        return next(
            figures
            for figures in self.figures.values()
            if any(part in figure["layout"]["xaxis"]["title"]["text"] for figure in figures.values())
        )


def test_the_page_loads_nothing_from_anywhere(results):
    text = render(results)
    page = Page(text)
    for tag, attributes in page.tags:
        assert tag not in ("link", "img", "iframe", "object", "base")
        assert not {"src", "href", "action"} & set(attributes), (tag, attributes)
    policy = next(a["content"] for tag, a in page.tags if tag == "meta" and "content" in a and "src" in a["content"])
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert text.count("plotly.js v") == 1  # its licence line, so one copy


def test_the_verdict_comes_first_and_names_the_interval_or_says_there_is_none(results):
    text = Page(render(results)).text
    assert "By the paper's rule snapshots every 3 ms suffice for position.x; no Δτ considered, 4 ms to 3 ms," in text
    assert "sufficient position.x: snapshots every 3 ms suffice by the paper's rule, Kf ≥ 2: Kf 2.15" in text
    assert "at unseen times 20 … 43 modes leave 0.8 … 0.1 d. Our verdict" in text
    assert "undecidable position.y: not sufficient at any Δτ considered; the best is Kf 0.70" in text
    assert (
        text.index("Verdict") < text.index("Feasibility index") < text.index("Consistency") < text.index("Provenance")
    )


def test_a_vector_is_named_once_where_all_its_components_share_a_verdict_and_many_refused_are_folded(results):
    variables = results["select"]["variables"]
    refused = variables.pop("position.y")
    variables |= {f"velocity.{axis}": refused for axis in "xyz"} | {"fluid.velocity.x": refused}
    page = Page(render(results))
    assert "suffices for velocity, fluid.velocity.x." in page.text
    assert "The 4 for which no Δτ considered sufficesundecidable velocity.x: not sufficient" in page.text
    assert "details" in [tag for tag, _ in page.tags]


def test_the_table_shows_every_candidate_by_our_verdict_and_by_the_papers_rule(results):
    page = Page(render(results))
    cells = [a.get("class") for tag, a in page.tags if tag == "td" and "class" in a and a["class"] != "number"]
    assert cells == ["insufficient", "insufficient", "sufficient paper", "undecidable"]


@pytest.mark.parametrize("part", list(TITLES))
def test_a_part_that_is_missing_leaves_out_its_section_and_no_other(results, part):
    del results[part]
    text = Page(render(results)).text
    for name, titles in TITLES.items():
        for title in titles:
            assert (title in text) == (name != part), title


def test_a_report_of_nothing_is_still_a_page():
    page = Page(render({}))
    assert "How much data suffices: a run" in page.text
    assert page.figures == {}


def test_no_name_acts_as_markup(results):
    results["study"] = results["run"]["path"] = EVIL
    for part in (results["select"]["variables"], results["curves"], results["spectrum"]):
        part[EVIL] = part.pop("position.x")
    for found in results["compare"]["rows"]:
        found["surrogate"] = found["variable"] = found["unit"] = EVIL
        found["rmse_diameters"] = None
    results["compare"]["choice"] = {EVIL: {"sentence": EVIL}}
    results["select"]["variables"][EVIL]["candidates"][0]["reasons"] = [EVIL]
    results["stages"][0] |= {"name": EVIL, "detail": EVIL}
    results["provenance"] = {EVIL: EVIL}
    text = render(results)
    page = Page(text)
    assert not [tag for tag, _ in page.tags if tag == "img"]
    assert "<img" not in text
    assert EVIL in page.text
    # plotly reads markup in the texts it draws: none may be ours to begin with
    for figures in page.figures.values():
        for figure in figures.values():
            assert "<img" not in json.dumps(figure)


def test_numbers_that_are_not_finite_are_gaps_in_a_line_and_not_broken_json(results):
    results["curves"]["position.x"]["0.004"]["R_c"][5] = math.inf
    results["series"]["kinetic"][1] = math.nan
    page = Page(render(results))
    assert page.figure("modes n")["position.x"]["data"][0]["y"][4] is None  # n = 0 is not drawn


def test_a_single_value_gets_no_more_marks_than_two_decades_can_hold():
    assert len(ticks([1.0, 1.03])["tickvals"]) <= 6


def test_every_figure_has_a_name_for_those_who_hear_the_page(results):
    page = Page(render(results))
    names = [attrs.get("aria-label") for _, attrs in page.tags if attrs.get("class") == "panel"]
    assert len(names) == sum(map(bool, page.figures.values()))
    assert "Consistency Rc(n)" in names
    assert len(set(names)) == len(names)


def test_plotly_accepts_every_figure(results):
    drawn = [figure for figures in Page(render(results)).figures.values() for figure in figures.values()]
    assert len(drawn) == 2 + 2 + 1 + 1 + 1 + 1
    for figure in drawn:
        figure.pop("narrow", None)  # for the page alone
        go.Figure(figure, skip_invalid=False)


def test_the_consistency_figure_marks_n_c_and_n_lr_on_the_line_and_the_limit(results):
    figure = Page(render(results)).figure("modes n")["position.x"]
    marks = {
        (t["hovertemplate"].split("<extra>")[0], t["x"][0], t["y"][0]) for t in figure["data"] if t["mode"] == "markers"
    }
    assert marks == {
        ("n<sub>c</sub> = 30", 30, 2.8),
        ("n<sub>lr</sub> = 20", 20, 1.8),
    }  # n_c = 43 lies beyond the 40 values given
    assert figure["layout"]["shapes"][0]["y0"] == 1.05


def test_the_error_figure_shows_the_floor_and_the_baseline_in_diameters(results):
    figure = Page(render(results)).figure("Δτ")["position.x"]
    lines = {trace["name"]: trace for trace in figure["data"]}
    assert figure["layout"]["yaxis"]["title"]["text"] == "error (diameters)"
    assert lines["rbf"]["x"] == [4.0, 3.0]
    assert lines["rbf"]["y"] == pytest.approx([0.4, 0.3])
    assert lines["floor, all modes"]["y"] == pytest.approx([0.36, 0.27])
    assert lines["raw-hermite"]["y"] == pytest.approx([0.2, 0.15])


def test_the_spectrum_is_the_energy_left_out_from_the_first_mode_on(results):
    for ratio in ([0.9, 0.99, 1.0], [0.0, 0.9, 0.99, 1.0]):  # with or without I(0)
        results["spectrum"]["position.x"]["0.004"] = ratio
        line = Page(render(results)).figure("modes p")["position.x"]["data"][0]
        assert line["x"] == [1, 2, 3]
        assert line["y"][:2] == pytest.approx([0.1, 0.01])
        assert line["y"][2] is None  # nothing is left: no place on a logarithmic axis


def test_the_spectrum_is_taken_from_the_curves_where_it_is_not_given(results):
    del results["spectrum"]
    results["curves"]["position.x"]["0.004"] = {"R_c": [1.0], "energy_ratio": [0.0, 0.9]}
    line = Page(render(results)).figure("modes p")["position.x"]["data"][0]
    assert (line["x"], line["y"]) == ([1], [pytest.approx(0.1)])


def test_energies_are_shown_as_changes_since_the_start(results):
    lines = {t["name"]: t["y"] for t in Page(render(results)).figure("time (s)")[""]["data"]}
    assert lines == {"kinetic": [0.0, 1.0], "balance": [0.0, 0.0]}


def test_the_energies_drawn_of_a_wet_run_add_up_to_the_balance_that_is_drawn(tmp_path):
    gained = {"energy.kinetic": 1.0, "energy.dissipated": 6.0, "energy.wall_work": 9.0, "fluid.work_on_particles": -2.0}
    particles = {"ids": [0], "radius": [5e-4], "species": [1], "variables": ("position",), "provenance": {}}
    with RunWriter(tmp_path / "run.h5", **particles, n_snapshots=2, series=[*gained, "energy.balance"]) as run:
        for k in (0, 1):
            run.append(
                0.1 * k, {"position": [[0.0, 0.0, k]]}, {n: k * e for n, e in gained.items()} | {"energy.balance": 0.5}
            )
    page = Page(render(gather(tmp_path, "wet")))
    change = {t["name"]: t["y"][1] for t in page.figure("time (s)")[""]["data"]}
    held = change["kinetic"] + change["dissipated"]
    assert held - change["wall work"] - change["fluid work"] == change["balance"] == 0.0
    assert "less the work of the walls and of the fluid on them" in page.text


def test_of_intervals_that_are_equally_bad_the_verdict_rests_on_the_finest():
    found = [candidate(interval, 0, "insufficient") for interval in (0.05, 0.03, 0.01)]
    assert deciding({"candidates": found, "chosen_interval": None})["interval"] == 0.01


@pytest.mark.parametrize("values", [(0.036, 0.13), (0.5, 40.0), (3.1e-5, 3.6e-5), (1e-6, 1e3)])
def test_at_least_three_marks_stand_between_the_ends_of_a_logarithmic_axis(values):
    marks = ticks(values)
    assert sum(values[0] <= mark <= values[1] for mark in marks["tickvals"]) >= 3
    assert [float(text) for text in marks["ticktext"]] == marks["tickvals"]


def test_the_verdict_rests_on_the_chosen_interval_or_on_the_largest_index(results):
    variables = results["select"]["variables"]
    assert deciding(variables["position.x"])["interval"] == 0.003
    assert deciding(variables["position.y"])["n_c"] == 14
    assert deciding({"candidates": []}) is None


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.003, "3 ms"), (1.0, "1 s"), (300, "5 min"), (2.5e-5, "25 µs"), (0.0, "0 s"), (None, "–"), (math.nan, "–")],
)
def test_times_are_written_in_the_unit_that_suits_them(value, text):
    assert seconds_text(value) == text


def test_bytes_and_numbers_are_written_short():
    assert [bytes_text(b) for b in (500, 12_345_678, 4e9, None)] == ["0.5 kB", "12.3 MB", "4 GB", "–"]
    assert [number(x) for x in (0.001234, "text", True, math.inf)] == ["0.00123", "–", "–", "–"]


def test_the_page_is_written_whole_or_not_at_all(results, tmp_path):
    write_report(results, tmp_path / "report.html")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == render(results)
    with pytest.raises(Refusal, match="cannot be written"):
        write_report(results, tmp_path / "missing" / "report.html")


@pytest.mark.physics
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium on this machine to draw the page")
def test_a_browser_draws_every_panel(results, tmp_path):
    write_report(results, tmp_path / "report.html")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    asked = [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=8000", "--dump-dom"]
    page = (tmp_path / "report.html").as_uri()
    done = subprocess.run(["chromium", *flags, *asked, page], capture_output=True, text=True, timeout=100, check=True)
    drawn = re.findall(r'<div class="panel js-plotly-plot" id="(panel\d)"', done.stdout)
    assert len(drawn) == 6
