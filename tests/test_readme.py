"""What README and docs say is so: commands, options, keys of a scene, and Python that runs."""

import re
import tomllib
from pathlib import Path
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

import numpy as np
import pytest
import typer
from pydantic import BaseModel

from selection import Thresholds
from sim import parse_scene, scene_text
from sim.assembly import walls_of
from sim.filling import solid_fraction
from sim.scene import Scene
from suffice.__main__ import app
from suffice.study import Study, built_in_studies

TOP = Path(__file__).parents[1]
PAGES = [TOP / "README.md", *sorted((TOP / "docs").glob("*.md"))]
COMMANDS = typer.main.get_command(app).commands


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def shown_commands(page):
    """Lines of code blocks, and code within the text, that call suffice."""
    text = page.read_text(encoding="utf-8")
    lines = [line for block in blocks(page, "") for line in re.split(r"\n|&&", block)]
    lines += re.findall(r"`(suffice [^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
    return [line.partition("#")[0].split() for line in map(str.strip, lines) if line.startswith("suffice ")]


def test_readme_lists_the_commands_that_there_are():
    listed = re.findall(r"^\| `suffice (\w+)", (TOP / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == list(COMMANDS)


def test_the_help_of_study_names_all_built_in_studies():
    (named,) = [parameter.help for parameter in COMMANDS["study"].params if parameter.name == "name"]
    assert sorted(named.partition("built in: ")[2].split(", ")) == sorted(built_in_studies())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_option_shown_exists(page):
    for _, name, *words in shown_commands(page):
        if name.startswith("-"):
            continue
        known = {option for parameter in COMMANDS[name].params for option in parameter.opts}
        options = {word.strip("[]") for word in words if re.match(r"\[?-{1,2}[a-z]", word)}
        assert options <= known, f"suffice {name}"


def test_readme_sets_up_with_these_two_commands():
    commands = [block.strip() for block in blocks(TOP / "README.md", "")]
    assert "pip install -c constraints.txt -e . && suffice study" in commands
    assert "pip install -c constraints.txt -e '.[test]' && pytest" in commands


def test_the_first_answer_of_the_readme_is_that_of_its_table():
    text = (TOP / "README.md").read_text(encoding="utf-8")
    sentence = r"^(position\.[xy]): Δτ = ([\d.]+) s suffices \(K_f ([\d.]+) ≥ 2\); (\d+) … (\d+) modes"
    said = re.findall(sentence, text, re.MULTILINE)
    head, table = re.search(r"^\| Δτ \| (position.*) \|\n((?:\|.*\|\n)+)", text, re.MULTILINE).groups()
    names = head.split(" | ")
    rows = {row: cells.split(" | ") for row, cells in re.findall(r"^\| (\d+) ms \| (.*) \|$", table, re.MULTILINE)}
    assert len(said) == 2
    for name, interval, K_f, n_lr, n_c in said:
        judged = {row: cells[names.index(name)] for row, cells in rows.items()}
        assert judged[f"{1e3 * float(interval):g}"] == f"{n_c}/{n_lr} = {K_f} ✓"
        assert max(int(row) for row, cell in judged.items() if "✓" in cell) == 1e3 * float(interval)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_a_page_points_to_is_there(page):
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#:]+)\)", text) + [f"../{t}" for t in re.findall(r"`((?:tests|sim)/\w+\.py)`", text)]
    here = page.parent if page.parent != TOP else TOP / "docs"
    for target in targets:
        assert (here / target).exists() or (page.parent / target).exists(), target


def keys_of(annotation, within=()):
    """Names of all keys of a table and of the tables within it, which may hold tables of their own kind."""
    if get_origin(annotation) in (Annotated, Union, UnionType, list, tuple):
        return {key for part in get_args(annotation) for key in keys_of(part, within)}
    if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)) or annotation in within:
        return set()
    fields = annotation.model_fields
    return set(fields).union(*(keys_of(f.annotation, (*within, annotation)) for f in fields.values()))


def test_page_on_scenes_names_every_key_that_a_scene_knows():
    text = (TOP / "docs" / "scenes.md").read_text(encoding="utf-8")
    keys = keys_of(Scene)
    assert {"diameter", "rpm", "max_overlap"} <= keys
    missing = {key for key in keys if not re.search(rf"[`\[.]{key}[`\].]", text)}
    assert not missing


@pytest.mark.parametrize("number", range(len(blocks(TOP / "docs" / "walls.md", "toml"))))
def test_every_wall_on_the_page_on_walls_belongs_in_a_scene(beads, number, tmp_path, monkeypatch):
    pytest.importorskip("vtkmodules.vtkIOGeometry")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    corners = {"a": "0 0 0", "b": "0 1 0", "c": "1 0 0", "d": "0 0 1"}
    lines = ["solid tetrahedron"]
    for face in ("abc", "acd", "adb", "bdc"):
        vertices = [f"vertex {corners[corner]}" for corner in face]
        lines += ["facet normal 0 0 0", "outer loop", *vertices, "endloop", "endfacet"]
    Path("impeller.stl").write_text("\n".join([*lines, "endsolid", ""]))
    scene = parse_scene(beads + blocks(TOP / "docs" / "walls.md", "toml")[number])
    assert walls_of(scene).kind.size > 6


@pytest.mark.physics
def test_python_of_the_readme_runs_and_predicts_what_it_says(capsys):
    (code,) = blocks(TOP / "README.md", "python")
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    assert capsys.readouterr().out.count("K_f = ") == 9
    assert names["heights"].shape == (576, 2)
    truth = names["W"][:, [30, 31]].mean(axis=1)  # half way between two snapshots 1 ms apart
    assert abs(names["heights"][:, 0] - truth).max() < 3e-3  # a diameter


@pytest.mark.physics
def test_python_of_the_page_on_your_own_run_reads_a_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    app(["simulate", "shaken_box", "--until", "0.04", "-o", "run.h5"], standalone_mode=False)
    names = {}
    for code in blocks(TOP / "docs" / "your_own_run.md", "python"):
        exec(compile(code, "your_own_run.md", "exec"), names)
    names["run"].close()
    assert names["table"].chosen_interval == names["found"]["position.z"].chosen_interval
    assert names["basis"].ratio[-1] >= 0.999
    assert {row["interval"] for row in names["costs"].front()} == {0.003}


@pytest.mark.physics
def test_page_on_a_scene_of_ones_own_makes_its_vessel_and_beads_that_fit_into_it(tmp_path, monkeypatch):
    pytest.importorskip("vtkmodules.vtkIOGeometry")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    page = TOP / "docs" / "your_own_scene.md"
    for code in blocks(page, "python"):
        exec(compile(code, page.name, "exec"), {})
    (scene,) = blocks(page, "toml")
    scene = parse_scene(scene)
    fraction = solid_fraction(scene, walls_of(scene), np.full(1000, 1e-3))
    vessel = 1.5 * 3**0.5 * 0.02**2 * 0.015  # m³, of a hexagonal prism
    assert fraction == pytest.approx(1000 * np.pi / 6 * 2e-3**3 / vessel, rel=0.01)


def test_page_on_studies_names_every_key_that_a_study_knows():
    text = (TOP / "docs" / "studies.md").read_text(encoding="utf-8")
    keys = keys_of(Study) | set(Thresholds._fields)
    assert {"max_error", "training_seconds", "snapshots_per_bin", "resolution"} <= keys
    missing = {key for key in keys if not re.search(rf"[`\[.]{key}[`\].]", text)}
    assert not missing


def test_the_study_on_the_page_on_studies_is_one_whose_intervals_its_scene_allows():
    (text,) = blocks(TOP / "docs" / "studies.md", "toml")
    study = Study.model_validate(tomllib.loads(text))
    dense = parse_scene(scene_text(study.scene)).output.interval
    for interval in [*study.select.intervals, *study.compare.intervals, *study.compare.beyond]:
        assert interval / dense == pytest.approx(round(interval / dense))
        assert round(interval / dense) >= 2
