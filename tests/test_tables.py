"""What commands say on a terminal."""

from suffice.tables import show_comparison, show_facts, show_selection


def candidate(interval, K_f, verdict="insufficient", reasons=("K_f 0.66 below 2",)):
    errors = {"error_n_lr": 8e-4, "error_n_c": 1e-4, "error_n_lr_diameters": 0.8, "error_n_c_diameters": 0.1}
    return {
        "interval": interval, "n_lr": 20, "n_c": 43, "K_f": K_f, "verdict": verdict, "reasons": list(reasons), **errors
    }  # fmt: skip


def selection(chosen, *candidates):
    found = {"chosen_interval": chosen, "thresholds": {"feasibility": 2.0}, "candidates": list(candidates), "unit": "m"}
    return {"variables": {"position.x": found}}


def test_the_chosen_interval_is_said_with_its_index(capsys):
    show_selection(selection(0.003, candidate(0.004, 1.5), candidate(0.003, 2.25, "sufficient", [])))
    assert (
        "position.x: Δτ = 0.003 s suffices (K_f 2.25 ≥ 2); 20 … 43 modes leave 0.8 … 0.1 d\n" in capsys.readouterr().out
    )


def test_errors_stand_beside_the_index_in_the_unit_there_is(capsys):
    show_selection(selection(None, candidate(0.003, 2.25)))
    assert "in diameters" in capsys.readouterr().out
    unknown = candidate(0.003, 2.25) | {"error_n_lr_diameters": None, "error_n_c_diameters": None}
    show_selection(selection(0.003, unknown))
    said = capsys.readouterr().out
    assert "│in m      │0.0001│" in said
    assert "modes leave 0.0008 … 0.0001 m" in said


def test_a_choice_of_the_papers_rule_that_we_doubt_is_said_with_the_reason(capsys):
    doubted = candidate(0.003, 2.25, "undecidable", ["R_c never exceeds 1.05"])
    show_selection(selection(0.003, doubted))
    said = " ".join(capsys.readouterr().out.split())
    verdict = "undecidable: Δτ = 0.003 s by the paper's rule alone (K_f 2.25 ≥ 2), but R_c never exceeds 1.05"
    assert f"position.x: {verdict}; 20 … 43 modes leave 0.8 … 0.1 d" in said


def test_a_narrow_terminal_loses_no_digit_of_nine_intervals_and_verdicts_are_seen_without_colour(capsys):
    judged = [candidate(0.004 * k, 2.25, "sufficient", []) for k in range(10, 1, -1)]
    small = {"error_n_lr_diameters": 4.6e-4, "error_n_c_diameters": 1.9e-4}
    answer = selection(0.008, *(c | small for c in judged))
    answer["variables"] = {"fluid.void_fraction": answer["variables"]["position.x"]}
    show_selection(answer)
    said = capsys.readouterr().out
    assert said.count("4.6e-4") == said.count("1.9e-4") == said.count("2.25✓") == 9
    assert "…│" not in said


def test_where_nothing_suffices_the_best_is_named_and_an_undefined_index_is_a_dash(capsys):
    show_selection(selection(None, candidate(0.004, None, "undecidable"), candidate(0.003, 1.25)))
    said = capsys.readouterr().out
    assert "position.x: not sufficient at any Δτ considered; best K_f 1.25 at 0.003 s" in said
    assert "–" in said


def test_what_cannot_be_judged_is_not_called_insufficient(capsys):
    still = ["nothing moves: the variable is the same in every snapshot"]
    show_selection(selection(None, candidate(0.004, None, "undecidable", still)))
    said = capsys.readouterr().out
    assert f"position.x: undecidable at any Δτ considered: {still[0]}\n" in said
    assert "not sufficient" not in said
    few = ["too few snapshots: 5, at least 10 needed", "K_f 1.50 below 2"]
    show_selection(selection(None, candidate(0.004, 1.5, "undecidable", few)))
    assert f"best K_f 1.5 at 0.004 s (undecidable: {few[0]})\n" in capsys.readouterr().out


def test_a_comparison_lists_its_rows_by_error_with_units(capsys):
    row = {"variable": "position.x", "interval": 0.004, "unit": "m", "modes": 5, "rmse_diameters": 0.25}
    row |= {"basis": "plain", "precision": "single"}
    row |= {"single_seconds": 2e-5, "storage_bytes": 2e6, "ratio_to_floor": 1.2, "on_front": {"single_seconds": True}}
    rows = [row | {"surrogate": name, "rmse": rmse} for name, rmse in (("rbf", 2e-3), ("spline", 1e-3))]
    bases = [
        {"variable": "position.x", "interval": 0.004, "basis": basis, "unit": "m"} for basis in ("plain", "enriched")
    ]
    show_comparison({"bases": bases, "rows": rows, "choice": {"position.x": {"sentence": "Take the spline."}}})
    said = capsys.readouterr().out
    assert said.count("position.x, Δτ = 0.004 s") == 1
    assert said.index("spline") < said.index("rbf")
    assert "20 µs" in said
    assert "2 MB" in said
    assert said.endswith("Take the spline.\n")


def test_of_numbers_kept_in_fewer_bits_only_what_stands_on_a_front_is_listed(capsys):
    row = {
        "variable": "position.x",
        "interval": 0.004,
        "unit": "m",
        "modes": None,
        "rmse_diameters": None,
        "rmse": 1e-3,
    }
    row |= {
        "single_seconds": 2e-5,
        "storage_bytes": 2e6,
        "ratio_to_floor": 1.2,
        "basis": None,
        "surrogate": "raw-linear",
    }
    kept = [("single", False), ("int16", False), ("int8", True)]
    rows = [row | {"precision": name, "on_front": {"storage_bytes": on}} for name, on in kept]
    bases = [{"variable": "position.x", "interval": 0.004, "basis": "plain", "unit": "m"}]
    show_comparison({"bases": bases, "rows": rows, "choice": {}})
    said = capsys.readouterr().out
    assert "single" in said
    assert "int8" in said
    assert "int16" not in said


def test_facts_stand_one_a_line_and_brackets_are_no_markup(capsys):
    show_facts("run.h5", {"n": 3, "variables": ["a", "b"], "scene": "[contact]\nstiffness = 1"})
    assert capsys.readouterr().out.splitlines() == [
        "run.h5",
        "  n          3",
        "  variables  a, b",
        "  scene      [contact]",
        "             stiffness = 1",
    ]


def test_facts_are_shown_with_their_units_and_what_is_not_known_as_a_dash(capsys):
    facts = {"unit": "m/s", "interval": 0.003, "window": [0.0, 0.2], "diameter": 1e-3, "rmse": 0.05, "grid": None}
    show_facts("model", facts | {"storage_bytes": 700, "n_modes": 3})
    said = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:])
    assert said == {
        "unit": "m/s", "interval": "0.003 s", "window": "0, 0.2 s", "diameter": "0.001 m", "rmse": "0.05 m/s",
        "grid": "–", "storage_bytes": "700 B", "n_modes": "3",
    }  # fmt: skip
