"""The player's fluid and walls are those of the run, and a browser shows them to whoever turns, zooms and plays."""

import importlib.util
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from suffice.fluid_slice import LEVELS, planes_of
from suffice.frames import unpack
from suffice.outline import outlines_of
from suffice.player import player_of
from suffice.quantities import Grid
from suffice.report import render, write_report
from suffice.run import Run
from suffice.setting import setting_of
from suffice.solids import wall_distances
from suffice.store import RunWriter

spec = importlib.util.spec_from_file_location("browser", Path(__file__).parents[1] / "docs" / "browser.py")
browser = importlib.util.module_from_spec(spec)
spec.loader.exec_module(browser)

INTERVAL, FRAMES, BEADS = 0.001, 41, 30
RADIUS, SPEED = 0.01, 100.0  # m of the vessel, rad/s of the rotor
GRID = Grid((5, 8, 9), (-0.012, -0.012, -0.006), (0.024 / 9, 0.003, 0.012 / 5))
SCENE = f"""
[[particles]]
diameter = 1e-3
density = 2500.0
count = {BEADS}

[contact]
stiffness = 1e4
restitution = 0.9
friction = 0.3

[fluid]
density = 1000.0
viscosity = 1e-3
lowest = [-0.012, -0.012, -0.006]
highest = [0.012, 0.012, 0.006]
cells = [9, 8, 5]

[time]
duration = 0.04

[output]
interval = 0.001

[[walls]]
name = "vessel"
immersed = true
[[walls.shapes]]
shape = "cylinder"
axis = [0.0, 0.0, 1.0]
radius = {RADIUS}
length = 0.012
particles = "inside"

[[walls]]
name = "rotor"
immersed = true
motion = {{ kind = "rotation", axis = [0.0, 0.0, 1.0], rpm = {SPEED * 30 / np.pi} }}
[[walls.shapes]]
shape = "cylinder"
axis = [1.0, 0.0, 0.0]
centre = [0.005, 0.0, 0.0]
radius = 0.001
length = 0.004
copies = 3
particles = "outside"
"""


def stirred_liquid():
    """Beads on circles (frames, n, 3) m, and a liquid that turns and pulses, (frames, z, y, x, 3) m/s."""
    t = INTERVAL * np.arange(FRAMES)[:, None]
    turn = SPEED * t + np.linspace(0.0, 2 * np.pi, BEADS)
    reach = np.linspace(0.002, 0.009, BEADS)
    position = np.stack([reach * np.cos(turn), reach * np.sin(turn), np.linspace(-5e-3, 5e-3, BEADS) + 0 * turn], -1)
    x, y, z = (GRID.origin[k] + (np.arange(GRID.shape[2 - k]) + 0.5) * GRID.spacing[k] for k in range(3))
    pulse = 1.0 + 0.5 * np.sin(2 * SPEED * t)[:, :, None, None]
    vortex = np.stack(np.broadcast_arrays(-y[:, None], x, 10 * z[:, None, None] * x), axis=-1)
    return position, SPEED * pulse[..., None] * vortex + 0.1 * np.sin(3 * SPEED * t)[:, :, None, None, None]


def write(path, scene=SCENE, stirred=1.0):
    position, velocity = stirred_liquid()
    velocity *= stirred
    with RunWriter(
        path,
        ids=np.arange(BEADS),
        radius=np.full(BEADS, 5e-4),
        species=np.zeros(BEADS, int),
        n_snapshots=FRAMES,
        variables=("position", "fluid.velocity"),
        grid=GRID,
        precision="double",
        provenance={} if scene is None else {"scene": scene},
    ) as run:
        for k in range(FRAMES):
            run.append(k * INTERVAL, {"position": position[k], "fluid.velocity": velocity[k]})
    return path


def results():
    """A study's answer in which 4 ms suffice for all of position, and nothing was compared."""
    rows = [{"interval": dt} for dt in (0.01, 0.004, 0.001)]
    judged = {f"position.{axis}": {"chosen_interval": 0.004, "candidates": rows} for axis in "xyz"}
    return {"select": {"dense_interval": INTERVAL, "variables": judged}}


@pytest.fixture
def run(tmp_path):
    return write(tmp_path / "run.h5")


def speeds(player, plane, name):
    facts = player.facts["fluid"]
    levels = unpack(player.streams[f"slice_{plane}_{name}"], (player.facts["frames"], *facts["planes"][plane]["shape"]))
    return levels * facts["fastest"] / LEVELS


def test_a_study_that_compared_nothing_shows_the_intervals_it_judged(run):
    assert [found["interval"] for found in player_of(run, results()).facts["predictions"]] == [0.01, 0.004]


def test_the_plane_across_the_rotors_axis_is_shown_first_else_that_across_the_shortest_edge():
    assert [plane.across for plane in planes_of(GRID, np.array([0.0, 1.0, 0.0]))] == [1, 0, 2]
    assert [plane.across for plane in planes_of(GRID, None)] == [2, 0, 1]


def test_speeds_on_every_plane_are_those_of_the_runs_middle_cells_within_half_a_step(run):
    player = player_of(run, results())
    _, stored = stirred_liquid()
    facts = player.facts
    half = 0.5 * facts["fluid"]["fastest"] / LEVELS * (1 + 1e-9)
    middle = {"x": stored[:, :, :, 4], "y": stored[:, :, 4], "z": stored[:, 2]}  # of 9, 8 and 5 cells
    for p, plane in enumerate(facts["fluid"]["planes"]):
        truth = np.linalg.norm(middle[plane["across"]][: facts["frames"]], axis=-1)
        assert np.abs(speeds(player, p, "truth") - truth).max() <= half
        k = "xyz".index(plane["across"])
        assert plane["at"] == pytest.approx(GRID.origin[k] + (GRID.shape[2 - k] // 2 + 0.5) * GRID.spacing[k])


def test_the_fluid_of_the_surrogate_is_nearer_the_truth_the_denser_it_was_trained(run):
    player = player_of(run, results())
    truth = speeds(player, 0, "truth")
    off = [np.sqrt(np.square(speeds(player, 0, str(i)) - truth).mean()) for i in (0, 1)]
    said = [found["rmse"] for found in player.facts["fluid"]["predictions"]]
    assert off[0] > 2 * off[1]
    assert said[0] > 2 * said[1] > 0


def test_the_liquid_ends_at_the_vessels_wall_and_not_at_the_rotor(run):
    player = player_of(run, results())
    plane = player.facts["fluid"]["planes"][0]
    seen = np.frombuffer(zlib.decompress(player.streams["open_0"]), np.uint8).reshape(plane["shape"])
    x, y = (np.array(plane["corner"][k]) + (np.arange(n) + 0.5) * GRID.spacing[k] for k, n in ((0, 9), (1, 8)))
    gap = RADIUS - np.hypot(x, y[:, None])  # m to the wall
    scale = 127.5 / (2 * max(GRID.spacing))
    assert seen == pytest.approx(np.clip(127.5 + scale * gap, 0, 255), abs=0.51)


def test_a_liquid_at_rest_is_left_out_and_the_page_says_so(tmp_path):
    player = player_of(write(tmp_path / "run.h5", stirred=0.0), results())
    assert player.facts["fluid"] is None
    assert [found["modes"] > 0 for found in player.facts["predictions"]] == [True, True]
    page = render({"player": player})
    assert "The fluid is not shown: " in page
    assert "player-fluid" not in page[: page.index("<script>")]


def test_a_run_without_a_scene_has_no_walls_to_draw_and_liquid_everywhere(tmp_path):
    player = player_of(write(tmp_path / "run.h5", scene=None), results())
    assert player.facts["bodies"] == []
    assert not {"lines", "moved"} & player.streams.keys()
    assert set(zlib.decompress(player.streams["open_0"])) == {255}


def test_lines_of_the_rotor_lie_on_its_surface_whenever_they_are_drawn(run):
    times = np.array([0.0, 0.0123, 0.04])
    with Run(run) as opened:
        setting = setting_of(opened)
    vessel, rotor = outlines_of(setting, times, (np.full(3, -0.01), np.full(3, 0.01)))
    assert (vessel.name, rotor.name) == ("vessel", "rotor")
    assert vessel.moved is None
    assert np.abs(wall_distances(vessel.ends, setting.walls, 0.0)).max() < 1e-12
    for k, now in enumerate(times):
        ends = rotor.ends @ rotor.moved[k, :, :3].T + rotor.moved[k, :, 3]
        assert np.abs(wall_distances(ends, setting.walls, now)).max() < 1e-12
    turned = np.arctan2(rotor.moved[1, 1, 0], rotor.moved[1, 0, 0])
    assert turned == pytest.approx(SPEED * times[1])


def test_an_endless_shaft_is_drawn_as_far_as_the_particles_are(tmp_path):
    shaft = """
[[walls]]
name = "shaft"
[[walls.shapes]]
shape = "cylinder"
axis = [0.0, 0.0, 2.0]
radius = 0.002
particles = "outside"
"""
    with Run(write(tmp_path / "run.h5", SCENE + shaft)) as opened:
        setting = setting_of(opened)
    ends = outlines_of(setting, np.zeros(1), (np.array([-1.0, -1.0, -0.25]), np.array([1.0, 1.0, 0.5])))[-1].ends
    assert (ends[:, 2].min(), ends[:, 2].max()) == (-0.25, 0.5)
    assert np.hypot(ends[:, 0], ends[:, 1]) == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("shape", "lines"),
    [
        ('shape = "box"\nlowest = [0, 0, 0]\nhighest = [1, 2, 3]', 12),
        ('shape = "sphere"\nradius = 0.5', 3 * 48),
        ('shape = "cone"\naxis = [0, 1, 0]\nradii = [0.5, 0.0]\nlength = 1.0', 2 * 48 + 4),
        ('shape = "capsule"\naxis = [0, 1, 0]\nradius = 0.5\nlength = 1.0', 2 * 48 + 4 + 4 * 48),
        ('shape = "torus"\naxis = [1, 1, 0]\nradius = 0.5\ntube_radius = 0.1', 4 * 48),
    ],
)
def test_lines_of_every_primitive_lie_on_its_surface(tmp_path, shape, lines):
    body = f'\n[[walls]]\nname = "it"\n[[walls.shapes]]\nparticles = "outside"\n{shape}\n'
    with Run(write(tmp_path / "run.h5", SCENE[: SCENE.index("[[walls]]")] + body)) as opened:
        setting = setting_of(opened)
    (found,) = outlines_of(setting, np.zeros(1), (np.zeros(3), np.ones(3)))
    assert len(found.ends) == 2 * lines
    assert np.abs(wall_distances(found.ends, setting.walls, 0.0)).max() < 1e-12


# what the two canvases show: every fourth pixel, red, green, blue and how solid
DRAWN = """[...document.querySelectorAll(".stages canvas")].map((canvas) => {
  const copy = Object.assign(document.createElement("canvas"), { width: 120, height: 120 });
  const paper = copy.getContext("2d");
  paper.drawImage(canvas, 0, 0, 120, 120);
  return [...paper.getImageData(0, 0, 120, 120).data];
})"""


class Reader:
    """Somebody in front of the page, with a mouse, fingers and keys."""

    def __init__(self, page):
        self.page, self.began = page, time.time()  # s, from which hands count their time, however slow the machine
        centre = """(() => {
          const canvas = document.querySelector(".stages canvas");
          canvas.scrollIntoView({ block: "center" });
          const box = canvas.getBoundingClientRect();
          return [box.left + box.width / 2, box.top + box.height / 2];
        })()"""
        self.x, self.y = page.run(centre)

    def sees(self):
        return np.array(self.page.run(DRAWN), np.uint8).reshape(2, -1, 4)

    def sees_within(self, right):
        """Whether what is drawn becomes right: a page under way draws a little later than it is asked to."""
        end = time.monotonic() + 10.0
        while not (seen := right(self.sees())) and time.monotonic() < end:
            time.sleep(0.05)
        return seen

    def pick(self, name, value):
        choice = f"document.querySelector('[name={name}]')"
        self.page.run(f"{choice}.value = '{value}', {choice}.dispatchEvent(new Event('change'))")

    def mouse(self, kind, dx=0.0, dy=0.0, **more):
        self.page.call("Input.dispatchMouseEvent", type=kind, x=self.x + dx, y=self.y + dy, **more)

    def click(self, at=0.0):
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, button="left", clickCount=1, timestamp=self.began + at)

    def press(self, key):
        code = {" ": 32, "ArrowLeft": 37, "ArrowRight": 39}[key]
        for kind in ("keyDown", "keyUp"):
            self.page.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code)

    def touch(self, kind, *places, at=0.0):
        points = [{"x": self.x + dx, "y": self.y + dy, "id": i} for i, (dx, dy) in enumerate(places)]
        self.page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points, timestamp=self.began + at)

    @property
    def frame(self):
        return int(self.page.run("document.querySelector('section[data-player]').dataset.frame"))


@pytest.fixture
def page(run, tmp_path):
    if browser.CHROMIUM is None:
        pytest.skip("no chromium on this machine to play the particles")
    write_report({"player": player_of(run, results())}, tmp_path / "report.html")
    with browser.Browser() as opened:
        opened.look(1000, 900)
        opened.open(tmp_path / "report.html", "document.querySelector('section[data-player=ready]')")
        yield opened
    assert opened.errors == []


@pytest.mark.physics
def test_the_plane_of_the_fluid_is_seen_until_it_is_switched_off_and_differs_from_plane_to_plane(page):
    reader = Reader(page)
    across = reader.sees()
    reader.pick("player-fluid", "1")
    along = reader.sees()
    reader.pick("player-fluid", "")
    off = reader.sees()
    assert (across != along).any()
    solid = [(shown[..., 3] == 255).mean() for shown in (across, along, off)]
    assert min(solid[:2]) > solid[2] + 0.1  # beads and lines alone leave most of the ground bare
    assert (across[0] != across[1]).any()  # simulated and predicted


@pytest.mark.physics
def test_the_wheel_and_two_fingers_zoom_and_two_clicks_or_taps_bring_the_whole_back(page):
    reader = Reader(page)
    home = reader.sees()
    reader.mouse("mouseWheel", 60.0, 20.0, deltaX=0, deltaY=-300)
    assert reader.sees_within(lambda seen: (seen != home).any())
    for at in (0.0, 0.6):
        reader.click(at)
    assert (reader.sees() != home).any()  # two single clicks
    for at in (1.5, 1.6):
        reader.click(at)
    assert reader.sees_within(lambda seen: (seen == home).all())
    page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
    reader.touch("touchStart", (-40, 0), (40, 0))
    reader.touch("touchMove", (-90, 0), (90, 0))
    reader.touch("touchEnd")
    assert reader.sees_within(lambda seen: (seen != home).any())
    for at in (2.5, 2.6):
        reader.touch("touchStart", (0, 0), at=at)
        reader.touch("touchEnd", at=at)
    assert reader.sees_within(lambda seen: (seen == home).all())


@pytest.mark.physics
def test_space_plays_and_pauses_and_arrows_step(page):
    reader = Reader(page)
    reader.click()
    reader.press("ArrowRight")
    reader.press("ArrowRight")
    reader.press("ArrowLeft")
    page.wait("document.querySelector('section[data-player]').dataset.frame === '1'")
    reader.press(" ")
    page.wait("Number(document.querySelector('section[data-player]').dataset.frame) > 4")
    reader.press(" ")
    stopped = reader.frame
    page.run("new Promise((done) => setTimeout(done, 300))")
    assert reader.frame == stopped
    assert page.run("document.querySelector('.play').textContent") == "Play"


@pytest.mark.physics
def test_a_reader_who_prefers_dark_sees_a_dark_page_and_light_lines(page):
    reader = Reader(page)
    light, ground = reader.sees(), "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert min(page.run(ground)) > 200
    page.look(1000, 900, dark=True)
    page.wait(f"Math.max(...{ground}) < 60")
    assert reader.sees_within(lambda seen: (seen != light).any())


@pytest.mark.physics
def test_nothing_of_the_page_is_wider_than_a_phone(page):
    page.look(400, 800)
    assert page.run("document.documentElement.scrollWidth") <= 400
    box = page.run("document.querySelector('.stages canvas').getBoundingClientRect().toJSON()")
    assert 250 < box["width"] < 400
