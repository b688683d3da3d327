"""A Pareto figure draws every choice and joins those that none beats."""

import json

import plotly.graph_objects as go
import pytest

from suffice.pareto import Point, Quantity, pareto_figure

ERROR, COST, BYTES = Quantity("error (diameters)"), Quantity("seconds"), Quantity("bytes", "{:.0f} B".format)
POINTS = [
    Point("a", "one", 0.1, (9.0, 1.0)),
    Point("b", "one", 0.2, (5.0, 2.0), "first\nsecond"),
    Point("c", "two", 0.3, (6.0, 3.0)),
    Point("d", "two", 0.4, (1.0, 0.5)),
]


def traces(figure, axis="x"):
    return {t["name"]: t for t in figure["data"] if t["xaxis"] == axis and t["x"] != [None]}


def test_the_line_joins_what_no_other_choice_beats_from_cheap_to_dear():
    figure = pareto_figure(POINTS, ERROR, [COST, BYTES])
    front = traces(figure)["front"]
    assert (front["x"], front["y"]) == ([1.0, 5.0, 9.0], [0.4, 0.2, 0.1])
    assert traces(figure, "x2")["front"]["x"] == [0.5, 1.0]  # in bytes b and c are beaten by a


def test_every_choice_is_a_mark_of_its_group_and_says_what_it_is():
    marks = traces(pareto_figure(POINTS, ERROR, [COST]))
    assert (marks["one"]["x"], marks["two"]["x"]) == ([9.0, 5.0], [6.0, 1.0])
    assert marks["one"]["text"] == ["<b>a</b>", "<b>b</b><br>first<br>second"]


def test_what_stands_on_a_line_is_not_pale_in_that_diagram():
    figure = pareto_figure(POINTS, ERROR, [COST, BYTES])
    pale = {axis: traces(figure, axis)["one"]["marker"]["opacity"] for axis in ("x", "x2")}
    assert pale["x"] == [1.0, 1.0]
    assert pale["x2"][0] == 1.0 > pale["x2"][1]


def test_each_group_stands_once_in_the_legend_and_both_diagrams_share_the_errors():
    figure = pareto_figure(POINTS, ERROR, [COST, BYTES])
    shown = [trace["name"] for trace in figure["data"] if trace.get("showlegend", True)]
    assert shown == ["front", "one", "two"]
    assert figure["layout"]["yaxis2"]["matches"] == "y"


def test_on_a_narrow_page_the_diagrams_stand_one_above_the_other_the_first_on_top():
    figure = pareto_figure(POINTS, ERROR, [COST, BYTES])
    wide, narrow = figure["layout"], figure["narrow"]
    assert wide["xaxis"]["domain"][1] < wide["xaxis2"]["domain"][0]
    assert narrow["xaxis"]["domain"] == narrow["xaxis2"]["domain"] == [0.0, 1.0]
    assert narrow["yaxis"]["domain"][0] > narrow["yaxis2"]["domain"][1]


def test_nothing_at_all_has_its_place_on_a_logarithmic_axis():
    points = [Point("exact", "one", 0.0, (4.0,)), Point("rough", "one", 0.3, (2.0,))]
    figure = pareto_figure(points, ERROR, [COST])
    exact, rough = traces(figure)["one"]["y"]
    assert 0.0 < exact < rough
    axis = figure["layout"]["yaxis"]
    assert dict(zip(axis["tickvals"], axis["ticktext"], strict=True))[exact] == "0"
    assert traces(figure)["front"]["y"] == [rough, exact]


@pytest.mark.parametrize("costs", [[COST], [COST, BYTES]])
def test_plotly_accepts_it_and_no_name_acts_as_markup(costs):
    evil = Point("<img src=x>", "<b>", 0.2, (1.0, 2.0), "<script>")
    figure = pareto_figure([*POINTS, evil], ERROR, costs)
    go.Figure({"data": figure["data"], "layout": figure["layout"]}, skip_invalid=False)
    go.Figure({"data": [], "layout": {**figure["layout"], **figure["narrow"]}}, skip_invalid=False)
    assert "<img" not in json.dumps(figure)


def test_a_figure_of_no_choice_is_empty_and_not_an_error():
    assert traces(pareto_figure([], ERROR, [COST]))["front"]["x"] == []
