"""What accuracy costs, on the page: a mark for every choice, which says all that was chosen."""

from suffice.tradeoff_section import tradeoff_figure, tradeoff_section


def row(surrogate="spline", modes=20, basis="plain", precision="single", rmse=1e-4, size=1e5, on=False):
    return {
        "variable": "position.x",
        "interval": 0.003,
        "unit": "m",
        "n_snapshots": 67,
        "surrogate": surrogate,
        "modes": modes,
        "basis": basis,
        "precision": precision,
        "rmse": rmse,
        "rmse_diameters": rmse / 1e-3,
        "ratio_to_floor": 1.1,
        "fit_seconds": 0.01,
        "single_seconds": 3e-5,
        "batch_seconds": 1e-5,
        "storage_bytes": size,
        "on_front": {"storage_bytes": on, "single_seconds": False},
    }


ROWS = [
    row(),
    row(precision="int8", rmse=1.1e-4, size=3e4, on=True),
    row("hermite", 40, "enriched", rmse=8e-5, size=2e5, on=True),
    row("raw-hermite", None, None, rmse=7e-5, size=4e5, on=True),
]


def marks(figure):
    return {t["name"]: t for t in figure["data"] if t["mode"] == "markers" and t["xaxis"] == "x" and t["x"] != [None]}


def test_both_costs_are_drawn_against_the_error_in_diameters():
    layout = tradeoff_figure(ROWS)["layout"]
    assert layout["yaxis"]["title"]["text"] == "error (diameters)"
    assert [layout[axis]["title"]["text"] for axis in ("xaxis", "xaxis2")] == ["storage", "time for a snapshot"]


def test_a_mark_shows_basis_and_precision_and_names_every_choice():
    found = marks(tradeoff_figure(ROWS))
    assert found["spline"]["marker"]["symbol"] == ["circle", "circle-open"]
    assert found["hermite"]["marker"]["symbol"] == ["diamond"]
    assert found["raw-hermite"]["marker"]["symbol"] == ["square"]
    text = found["hermite"]["text"][0]
    for said in (
        "hermite",
        "40 modes of positions and velocities",
        "single precision",
        "3 ms",
        "67 snapshots",
        "200 kB",
    ):
        assert said in text
    assert "the snapshots themselves" in found["raw-hermite"]["text"][0]
    assert "8-bit integers" in found["spline"]["text"][1]


def test_the_table_holds_the_front_in_bytes_the_most_accurate_first():
    below = tradeoff_section({"compare": {"rows": ROWS}}).below
    assert below.index("raw-hermite") < below.index("40 + v") < below.index("int8")
    assert "1e-04" not in below  # the spline in single precision stands on no front


def test_rows_of_a_study_made_before_there_were_bases_and_precisions_are_still_drawn():
    old = [{key: value for key, value in r.items() if key not in ("basis", "precision")} for r in ROWS]
    found = marks(tradeoff_figure(old))
    assert found["spline"]["marker"]["symbol"] == ["circle", "circle"]


def test_without_a_comparison_there_is_no_section():
    assert tradeoff_section({}) is None
