"""Pictures in space show what is nearest, in its size and colour; drawings state what a scene says, and no more."""

import re
import struct
import zlib
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from sim import parse_scene, scene_text
from suffice.bead_pictures import FINER, View, add_rods, bead_picture
from suffice.bridge import bridges_of
from suffice.gallery import Gallery, predicted, unseen_moment
from suffice.mill_drawing import mill_drawing, mill_of
from suffice.paper_pictures import figure_1, figure_3, figure_4, figure_5, figure_9
from suffice.picture_figures import Curve, Picture, chart, numbered, side_by_side, ticks
from suffice.png import png_of
from suffice.quantities import Grid
from suffice.ramps import RAMPS, colours_of
from suffice.rods import Rod, rods_of
from suffice.run import Run
from suffice.shading import blank
from suffice.slice_pictures import slice_picture
from suffice.viewpoint import down_of, end_view

RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.1, 0.9)
EYE = np.eye(3)  # x to the right, y up, z towards the eye


def decoded(png):
    """Pixels (height, width, 4) of an indexed PNG without filters, read by the format's own rules."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(png):
        (length,) = struct.unpack(">I", png[at : at + 4])
        kind, data = png[at + 4 : at + 8], png[at + 8 : at + 8 + length]
        assert zlib.crc32(kind + data) == struct.unpack(">I", png[at + 8 + length : at + 12 + length])[0]
        chunks[kind], at = data, at + 12 + length
    width, height, depth, colour = struct.unpack(">IIBB", chunks[b"IHDR"][:10])
    assert (depth, colour) == (8, 3)
    assert b"IEND" in chunks
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, width + 1)
    assert not rows[:, 0].any()
    palette = np.hstack(
        [np.frombuffer(chunks[b"PLTE"], np.uint8).reshape(-1, 3), np.frombuffer(chunks[b"tRNS"], np.uint8)[:, None]]
    )
    return palette[rows[:, 1:]]


def seen(position, radius=1.0, colours=RED, pixels=100, size=10.0, **view):
    """Pixels of beads around the origin, from z, 10 m to 100 pixels."""
    position = np.atleast_2d(np.asarray(position, float))
    n = len(position)
    picture = bead_picture(
        View(EYE, np.zeros(3), size, size, pixels, **view),
        position, np.broadcast_to(np.asarray(radius, float), n), np.broadcast_to(colours, (n, 3)),
    )  # fmt: skip
    return decoded(picture)


def reddish(pixel):
    return int(pixel[0]) > int(pixel[2]) + 40


def test_a_picture_of_few_colours_is_kept_exactly():
    pixels = np.random.default_rng(0).integers(0, 256, (40, 1, 4)).astype(np.uint8).repeat(30, axis=1)
    pixels[..., 3] |= 1
    assert np.array_equal(decoded(png_of(pixels)), pixels)


def test_of_many_colours_none_is_shown_far_from_itself():
    y, x = np.mgrid[0:200, 0:160]
    pixels = np.stack([x, y, (x + y) // 2, np.full_like(x, 255)], axis=-1).astype(np.uint8)
    found = decoded(png_of(pixels))
    assert found.shape == pixels.shape
    assert (found[..., 3] == 255).all()
    assert np.abs(found.astype(int) - pixels).mean() < 4
    assert np.abs(found.astype(int) - pixels).max() < 24


def test_a_picture_has_the_size_of_its_view_and_a_clear_ground():
    picture = bead_picture(View(EYE, np.zeros(3), 10.0, 4.0, 150), np.zeros((1, 3)), np.ones(1), np.array([RED]))
    pixels = decoded(picture)
    assert pixels.shape == (60, 150, 4)
    assert (pixels[0, :, 3] == 0).all()
    assert pixels[30, 75, 3] == 255


@pytest.mark.parametrize("radius", [0.3, 1.0, 3.7])
def test_a_spheres_disc_has_the_area_of_its_circle(radius):
    pixels = seen((0.31, -0.17, 2.0), radius)
    area = pixels[..., 3].sum() / 255.0 / 10.0**2
    assert area == pytest.approx(np.pi * radius**2, rel=0.03)


def test_a_sphere_stands_where_it_is():
    row, column = np.nonzero(seen((2.0, 3.0, -5.0))[..., 3] > 127)
    assert column.mean() == pytest.approx(69.5, abs=0.3)  # 2 m to the right of the middle
    assert row.mean() == pytest.approx(19.5, abs=0.3)  # 3 m above it


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_nearer_sphere_hides_one_behind_it_in_whatever_order_they_come(order):
    place = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])[list(order)]
    pixels = seen(place, [(1.0, 2.0)[k] for k in order], np.array([RED, BLUE])[list(order)])
    assert reddish(pixels[50, 50])
    assert not reddish(pixels[50, 65])
    assert pixels[50, 65, 3] == 255


def test_spheres_that_overlap_meet_in_a_plane():
    pixels = seen([(-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)], 1.0, np.array([RED, BLUE]))
    assert [reddish(pixels[50, k]) for k in (46, 48, 51, 53)] == [True, True, False, False]


def test_beads_in_front_of_the_cut_are_taken_away_by_their_centre():
    front, behind = (0.0, 0.0, 0.5), (0.0, 0.0, -0.1)
    assert not seen(front, cut=(EYE[2], 0.0))[..., 3].any()
    assert seen(behind, cut=(EYE[2], 0.0))[50, 50, 3] == 255


def test_a_bead_without_a_place_is_left_out_and_the_others_are_drawn():
    pixels = seen([(np.nan, 0.0, 0.0), (3.0, 0.0, 0.0)])
    assert pixels[50, 80, 3] == 255
    assert pixels[50, 50, 3] == 0


def test_a_view_turned_by_a_right_angle_shows_another_side():
    frame = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # from x, z to the left
    view = View(frame, np.zeros(3), 10.0, 10.0, 100)
    pixels = decoded(bead_picture(view, np.array([[9.0, 0.0, 3.0]]), np.ones(1), np.array([RED])))
    assert pixels[50, 20, 3] == 255


def rod(axis, radius=1.0, length=6.0, centre=(0.0, 0.0, 0.0), hollow=False):
    axis = np.array(axis, float) / np.linalg.norm(axis)
    return Rod("rotor", np.array(centre, float), axis, radius, length, hollow, False, ())


def rays(rods, cut=None, size=10.0, pixels=100):
    view = View(EYE, np.zeros(3), size, size, pixels, cut)
    buffer = blank(view.rows * FINER, view.pixels * FINER)
    add_rods(buffer, view, rods)
    return buffer


@pytest.mark.parametrize(("axis", "area"), [((1, 0, 0), 12.0), ((0, 0, 1), np.pi), ((1, 1, 0), 12.0)])
def test_a_cylinder_covers_its_rectangle_from_the_side_and_its_circle_from_the_end(axis, area):
    covered = (rays([rod(axis)]).opacity > 0).sum() / (10.0 * FINER) ** 2
    assert covered == pytest.approx(area, rel=0.03)


def test_an_oblique_cylinder_is_as_deep_as_the_distance_along_the_ray_says():
    """A ray through the middle meets the side of a cylinder at an angle α to it at ζ = r / sin α."""
    buffer = rays([rod((1, 0, 1), length=20.0)])
    middle = buffer.depth[100, 100] / (10.0 * FINER)
    assert middle == pytest.approx(1.0 / np.sin(np.pi / 4), rel=0.03)
    normal = buffer.normal[100, 100]
    assert normal == pytest.approx(np.array([-1.0, 0.0, 1.0]) / np.sqrt(2.0), abs=0.05)


def test_a_vessel_cut_across_shows_its_wall_at_the_cut_and_its_far_end_behind():
    buffer = rays([rod((0, 0, 1), radius=3.0, length=4.0, hollow=True)], (EYE[2], 1.0))
    unit = 10.0 * FINER
    assert buffer.depth[100, 100] / unit == pytest.approx(-2.0, abs=0.01)
    assert buffer.opacity[100, 100] < 0.5  # seen through
    wall = buffer.depth[100, round(100 + 3.06 * unit)]
    assert wall / unit == pytest.approx(1.0, abs=0.01)


def test_a_shaft_along_the_cut_stays_whole_and_one_before_it_goes():
    across = rays([rod((1, 0, 0))], (EYE[2], 0.0))
    assert across.depth[100, 100] / (10.0 * FINER) == pytest.approx(1.0, abs=0.01)
    assert not rays([rod((1, 0, 0), centre=(0, 0, 0.2))], (EYE[2], 0.0)).opacity.any()


def test_colours_run_from_one_end_of_the_scale_to_the_other_and_stay_there():
    first, last = (
        [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)] for colour in (RAMPS["speed"][0], RAMPS["speed"][-1])
    )
    found = colours_of([-1.0, 0.0, 2.0, 9.0], 2.0, "speed")
    assert found == pytest.approx(np.array([first, first, last, last]))
    middle = [int(RAMPS["speed"][2][k : k + 2], 16) / 255 for k in (1, 3, 5)]
    assert colours_of(1.0, 2.0, "speed") == pytest.approx(np.array(middle))


def test_pictures_and_player_have_the_same_colours():
    script = (Path(__file__).parents[1] / "suffice" / "page" / "player.js").read_text()
    for name, colours in RAMPS.items():
        listed = ", ".join(f'"{colour}"' for colour in colours)
        assert f"{name}: [{listed}]" in script


def test_a_slice_shows_the_field_on_the_plane_and_only_within_the_vessel():
    """A speed that grows with y, on cells of 1 m: the colour at a place is that of y there."""
    grid = Grid((3, 8, 8), (-4.0, -4.0, -1.5), (1.0, 1.0, 1.0))
    field = np.broadcast_to((np.arange(8) + 0.5)[None, :, None], (3, 8, 8))  # y + 4
    view = View(EYE, np.zeros(3), 10.0, 10.0, 100, (EYE[2], 0.0))
    vessel = [rod((0, 0, 1), radius=3.0, length=3.0, hollow=True), rod((0, 0, 1), radius=0.5, length=None)]
    pixels = decoded(slice_picture(view, grid, field, 8.0, vessel))
    for row in (28, 40, 60, 72):
        y = (49.5 - row) / 10.0
        assert np.abs(pixels[row, 50, :3] - 255.0 * colours_of(y + 4.0, 8.0, "speed")).max() < 14
    assert pixels[2, 50, 3] == 0
    grey = pixels[50, 50, :3].astype(int)
    assert grey.max() - grey.min() < 30  # the shaft
    bare = decoded(slice_picture(view, grid, field, 8.0))
    assert bare[50, 11, 3] == 255
    assert bare[50, 8, 3] == 0  # out of the grid, which ends at 4 m


def test_a_slice_needs_a_plane_that_can_be_seen():
    grid = Grid((1, 1, 1), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    for cut in (None, (EYE[0], 0.0)):
        with pytest.raises(ValueError, match="cutting plane"):
            slice_picture(View(EYE, np.zeros(3), 1.0, 1.0, 10, cut), grid, np.ones((1, 1, 1)), 1.0)


@pytest.fixture(scope="module")
def mill():
    return parse_scene(scene_text("bead_mill_1"), "bead_mill_1")


def test_rods_are_where_the_scene_puts_them_and_turn_with_the_rotor(mill):
    at_rest, later = rods_of(mill).rods, rods_of(mill, 0.015).rods  # a quarter turn at 1000 rpm
    assert len(at_rest) == 2 + 4 * 4
    assert [r.hollow for r in at_rest].count(True) == 1
    first, turned = at_rest[2], later[2]
    assert first.centre == pytest.approx([0.0095, 0.0, -0.01105])
    assert turned.centre == pytest.approx([0.0, 0.0095, -0.01105], abs=1e-12)
    assert at_rest[3].centre == pytest.approx(turned.centre, abs=1e-12)  # the copy that stands there at rest


def numbers_of(html):
    return {float(found) for found in re.findall(r"(?<![\d.])\d+(?:\.\d+)?", unescape(re.sub(r"<[^>]*>", " ", html)))}


def test_the_drawing_states_the_diameters_and_lengths_of_the_scene(mill):
    said = numbers_of(figure_4(mill))
    assert {38.0, 34.0, 10.0, 3.0, 11.0, 30.0, 1.0, 1000.0, 15.0} <= said
    assert {5.95, 7.37} <= said  # from the end wall to the first row, and between rows


def test_the_drawing_is_to_scale(mill):
    html = mill_drawing(mill)
    circles = [float(r) for r in re.findall(r'<circle[^>]* r="([\d.]+)"', html)]
    vessel = max(circles)
    assert any(r / vessel == pytest.approx(5.0 / 19.0, rel=2e-3) for r in circles)  # shaft
    assert any(r / vessel == pytest.approx(0.5 / 19.0, rel=2e-2) for r in circles)  # bead


def test_the_rotor_is_drawn_turning_the_way_it_does(mill):
    assert mill_of(mill).rpm == pytest.approx(1000.0)
    backwards = parse_scene(scene_text("bead_mill_1").replace("rpm = 1000.0", "rpm = -1000.0"), "mill")
    assert mill_of(backwards).rpm == pytest.approx(-1000.0)
    assert mill_drawing(backwards) != mill_drawing(mill)


def test_what_cannot_be_drawn_is_said(mill):
    assert "Not drawn" not in mill_drawing(mill)
    hopper = mill_drawing(parse_scene(scene_text("hopper"), "hopper"))
    assert "Not drawn: cone of wall hopper; box of wall bin" in hopper
    box = mill_drawing(parse_scene(scene_text("shaken_box"), "shaken_box"))
    assert "Not drawn" in box
    assert "<svg" not in box


def test_a_pin_that_stands_oblique_is_said_and_not_drawn_as_if_it_stood_straight():
    text = scene_text("bead_mill_1").replace("axis = [1.0, 0.0, 0.0]", "axis = [1.0, 0.0, 0.5]", 1)
    html = mill_drawing(parse_scene(text, "mill"))
    assert "stands oblique" in html
    assert "12 pins" in html


def test_gravity_points_down_in_the_view_along_the_axis(mill):
    view = end_view(rods_of(mill).rods, np.zeros((1, 3)), down_of(mill), 100)
    assert view.frame @ down_of(mill) == pytest.approx([0.0, -1.0, 0.0])
    assert np.linalg.det(view.frame) == pytest.approx(1.0)


def test_every_text_is_escaped():
    picture = Picture(b"", "<b>1 & 2</b>", 'note "<i>"')
    html = side_by_side([[picture]]) + numbered("Figure <1>", "a<b", "", "")
    html += chart([Curve("<s>", np.arange(3.0), np.arange(3.0), "red")], "t <ms>", "x & y")
    for raw in ("<b>1", "<i>", "Figure <1>", "a<b", "<s>", "t <ms>", "x & y"):
        assert raw not in html
    assert "&lt;b&gt;1 &amp; 2&lt;/b&gt;" in html


def test_ticks_are_round_and_lie_within():
    for low, high in ((0.0, 1.0), (-15.3, 4.9), (0.12, 0.18), (1e-4, 3e-4), (120.0, 180.0)):
        marks = ticks(low, high)
        assert 4 <= len(marks) <= 9
        assert all(low - 1e-9 <= mark <= high + 1e-9 for mark in marks)


def test_the_moment_shown_is_as_far_as_can_be_from_what_any_was_trained_on():
    k = unseen_moment([np.arange(0, 101, 10)])
    assert k % 10 == 5
    assert 50 <= k < 100
    both = unseen_moment([np.arange(0, 101, 10), np.arange(0, 101, 3)])
    assert both % 3
    assert min(both % 10, -both % 10) >= 3


def test_a_bridge_passes_through_the_truth_as_closely_as_its_rmse_says(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5", n_snapshots=81)) as run:
        bridge = bridges_of(run, "position", [0.004])[0.004]
        unseen = bridge.case.unseen
        truth = np.stack([run.snapshot(int(k)).values["position"] for k in unseen]).astype(float)
        found = bridge.at(run.times[unseen]).reshape(truth.shape)
        rmse = np.sqrt(np.square(found - truth).mean(axis=(1, 2))).mean()
        assert bridge.rmse() == pytest.approx(rmse, rel=1e-6)
        velocity = np.stack([run.snapshot(int(k)).values["velocity"] for k in unseen])
        rate = bridge.rate_at(run.times[unseen]).reshape(truth.shape)
        assert np.sqrt(np.square(rate - velocity).mean()) < 0.05 * np.sqrt(np.square(velocity).mean())


def test_a_gallery_measures_distance_in_diameters(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5", radius=5e-4)) as run:
        gallery = Gallery(run, 60)
        moment = gallery.moment(3)
        moved = moment.position + np.array([2e-3, 0.0, 0.0])
        assert gallery.distance(moment, moved) == pytest.approx(np.full(run.n_particles, 2.0))
        assert "off by 2 d" in gallery.off(moment, moved)
        place, speed = predicted(bridges_of(run, "position", [0.002])[0.002], moment.time)
        assert place.shape == moment.position.shape
        assert speed == pytest.approx(moment.speed, rel=0.1, abs=0.05 * moment.speed.max())


def test_the_figures_of_a_run_without_a_scene_hold_their_pictures(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5", n_snapshots=81)) as run:
        first = figure_1(run, 0.01, 0.002)
        fifth = figure_5(run, [0.01, 0.004, 0.002], 0.004)
        ninth = figure_9(run, 0.004)
    assert first.count("<img ") == 2  # there is no fluid
    assert "not sufficient" in first
    assert fifth.count("<img ") == 4
    assert re.findall(r"Δτ = (\d+) ms, not sufficient<", fifth) == ["10"]
    assert ninth.count("<img ") == 10
    assert (ninth.count('class="kept"'), ninth.count('class="between"')) == (2, 3)
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)"', first + fifth + ninth)
    assert len(pictures) == 16


def test_what_prevents_a_figure_is_said(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5", radius=np.nan)) as run:
        assert "Not shown: " in figure_1(run, 0.01)
        assert "no radii" in figure_9(run, 0.002)
    with Run(write_run(tmp_path / "other.h5")) as run:
        assert "not a multiple" in unescape(figure_5(run, [0.0015]))
        assert "no snapshot to predict" in figure_9(run, 0.001)


def test_the_idea_is_drawn_with_the_numbers_of_the_study():
    html = figure_3(0.003, 0.001, 11, 28)
    assert "Δτ = 3 ms" in html
    assert {11.0, 28.0, 2.55} <= numbers_of(html)
    assert ": sufficient" in html
    assert ": not sufficient" in figure_3(0.010, 0.001, 11, 9)


def funnel(axis, hollow=False, **other):
    return rod(axis, radius=1.0, hollow=hollow)._replace(other_radius=3.0, **other)


def test_a_cone_covers_its_trapezium_from_the_side_and_its_wide_end_from_either_end():
    unit = (10.0 * FINER) ** 2
    assert (rays([funnel((0, 1, 0))]).opacity > 0).sum() / unit == pytest.approx(6.0 * (2.0 + 6.0) / 2.0, rel=0.02)
    for end in (1, -1):
        assert (rays([funnel((0, 0, end))]).opacity > 0).sum() / unit == pytest.approx(np.pi * 9.0, rel=0.02)


def test_the_side_of_a_cone_that_narrows_towards_the_eye_is_as_deep_as_it_is_wide_there():
    """Radius 3 at z = -3 and 1 at z = 3: at a distance d from the axis the mantle is at z = 3 (2 - d)."""
    buffer = rays([funnel((0, 0, -1))])
    unit = 10.0 * FINER
    away = np.hypot(40.5, 0.5) / unit
    assert buffer.depth[100, 140] / unit == pytest.approx(3.0 * (2.0 - away))
    assert buffer.normal[100, 140] == pytest.approx(np.array([3.0, 0.0, 1.0]) / 10**0.5, abs=0.03)


def test_through_the_open_end_of_a_hopper_its_mantle_is_seen_from_within():
    unit = 10.0 * FINER
    shut, open_up = (rays([funnel((0, 0, 1), hollow=True, open=ends)]) for ends in ((), ("+",)))
    place, away = (100, 140), np.hypot(40.5, 0.5) / unit
    assert shut.depth[place] / unit > 3.0
    assert shut.opacity[place] == 1.0
    assert open_up.depth[place] / unit == pytest.approx(3.0 * (away - 2.0))
    assert open_up.opacity[place] < 0.5
    through = rays([funnel((0, 0, 1), hollow=True, open=("-", "+"))])
    assert through.opacity[100, 100] == 0.0
