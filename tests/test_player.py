"""The particle player shows positions where they are, in a page of bearable size, in a browser that draws them."""

import json
import re
import shutil
import subprocess
from base64 import b64decode

import numpy as np
import pytest

from suffice.frames import STEPS, Box, box_of, pack, placed, positions_at, unpack
from suffice.player import MOST_BYTES, Player, intervals_shown, packed_within, player_of
from suffice.progress import Reporter
from suffice.report import render, write_report
from suffice.run import Run
from suffice.store import RunWriter
from suffice.training import Wish, train_model

RADIUS, INTERVAL = 1e-3, 0.001
CHROMIUM = shutil.which("chromium")


def stirred(frames, n, seed=0):
    """Positions (frames, n, 3) m and velocities of beads of 1 mm in 50 mm, stirred at 1 m/s, hit every 10 ms."""
    rng = np.random.default_rng(seed)
    start, velocity = rng.uniform(0.0, 0.05, (n, 3)), rng.normal(0.0, 0.6, (n, 3))
    place, speed = [start], [velocity]
    for _ in range(frames - 1):
        hit = rng.random(n) < 0.1
        velocity = np.where(hit[:, None], rng.normal(0.0, 0.6, (n, 3)), velocity)
        velocity = np.where((place[-1] < 0.0) | (place[-1] > 0.05), np.copysign(velocity, 0.025 - place[-1]), velocity)
        place.append(place[-1] + INTERVAL * velocity)
        speed.append(velocity)
    return np.array(place), np.array(speed)


def circling(frames=61, n=40):
    """Beads on circles, each about 2 to 4 times in the run: smooth, with exact velocities."""
    phase, t = np.arange(n)[None], INTERVAL * np.arange(frames)[:, None]
    turn = 2 * np.pi * (30 + phase)  # 1/s
    radius = 2e-3 * (1 + phase / n)
    position = np.stack(
        [0.01 * (phase % 7) + radius * np.cos(turn * t), radius * np.sin(turn * t), 0 * t + phase * 1e-3], -1
    )
    velocity = np.stack([-radius * turn * np.sin(turn * t), radius * turn * np.cos(turn * t), 0 * turn * t], -1)
    return position, velocity


def write(path, variables):
    first = next(iter(variables.values()))
    n = first.shape[1]
    with RunWriter(
        path,
        ids=np.arange(n),
        radius=np.full(n, RADIUS),
        species=np.zeros(n, int),
        n_snapshots=len(first),
        variables=tuple(variables),
        precision="double",
        provenance={},
    ) as run:
        for k in range(len(first)):
            run.append(k * INTERVAL, {name: values[k] for name, values in variables.items()})
    return path


def results(chosen=0.004):
    rows = [{"variable": f"position.{axis}", "interval": dt} for axis in "xyz" for dt in (0.01, 0.004, 0.002)]
    judged = {f"position.{axis}": {"chosen_interval": chosen} for axis in "xyz"}
    return {"compare": {"rows": rows}, "select": {"variables": judged}}


@pytest.fixture
def run(tmp_path):
    position, velocity = circling()
    return write(tmp_path / "run.h5", {"position": position, "velocity": velocity})


def shown(player, name):
    facts = player.facts
    places = unpack(player.streams[name], (facts["frames"], 3, facts["particles"]))
    return positions_at(places, Box(np.array(facts["lowest"]), facts["quantum"]))


def test_what_is_unpacked_lies_within_half_a_quantum_of_what_was_packed():
    position, _ = stirred(30, 200)
    box = box_of([position])
    assert box.quantum == pytest.approx(np.ptp(position, axis=(0, 1)).max() / STEPS)
    places = placed(position, box)
    again = unpack(pack(places), places.shape)
    assert np.array_equal(again, places)
    assert np.abs(positions_at(again, box) - position).max() <= 0.5 * box.quantum * (1 + 1e-9)


def test_jumps_from_side_to_side_of_the_box_survive_differences_of_16_bits():
    places = np.random.default_rng(1).choice([0, 1, 32767, 32768, STEPS], (9, 3, 50)).astype(np.uint16)
    assert np.array_equal(unpack(pack(places), places.shape), places)


def test_places_are_no_finer_than_asked_and_coarser_where_they_would_not_fit():
    position, _ = stirred(20, 100)
    box, packed = packed_within([position], 1e-5)
    assert box.quantum == 1e-5
    coarser, fewer = packed_within([position], 1e-5, most=len(packed[0]) - 1)
    assert coarser.quantum == 2e-5
    assert len(fewer[0]) < len(packed[0])


def test_the_coarsest_interval_is_shown_beside_the_one_that_suffices_for_all_of_position():
    assert intervals_shown(results()) == [0.01, 0.004]
    one_fails = results()
    one_fails["select"]["variables"]["position.z"]["chosen_interval"] = None
    assert intervals_shown(one_fails) == [0.01, 0.002]


def test_the_surrogate_that_is_shown_is_the_one_that_train_makes(run, tmp_path):
    player = player_of(run, results())
    for i, found in enumerate(player.facts["predictions"]):
        wish = Wish("position", found["interval"], found["surrogate"])
        with Run(run) as opened:
            card = train_model(opened, tmp_path / f"model{i}", wish, Reporter())
        assert (found["surrogate"], found["modes"]) == ("hermite", card["n_modes"])
        assert found["rmse"] == pytest.approx(card["rmse"], rel=1e-9)
    assert player.facts["predictions"][0]["rmse"] > 2 * player.facts["predictions"][1]["rmse"] > 0


def test_the_frames_in_the_page_have_the_errors_that_are_said_of_them(run):
    player = player_of(run, results())
    quantum, truth = player.facts["quantum"], shown(player, "truth")
    with Run(run) as opened:
        stored = np.stack([opened.snapshot(k).values["position"] for k in range(opened.n_snapshots)])
    assert np.abs(truth - stored[: len(truth)]).max() <= 0.5 * quantum * (1 + 1e-9)
    for i, found in enumerate(player.facts["predictions"]):
        off = np.sqrt(np.square(shown(player, str(i)) - truth).mean(axis=(1, 2)))
        assert np.abs(off - found["frame_rmse"]).max() <= quantum
        kept = np.array(found["kept"])
        assert off[~kept].mean() > off[kept].mean()


def test_beads_that_hardly_move_are_not_coloured_by_how_their_places_are_rounded(tmp_path):
    position, velocity = (1e-7 * values / 2e-3 for values in circling())
    path = write(tmp_path / "run.h5", {"position": position + 0.01 * np.arange(40)[:, None], "velocity": velocity})
    facts = player_of(path, results()).facts
    rounding = np.sqrt(3) * facts["quantum"]  # at most, of the distance of two rounded places
    assert all(found["largest"] > 10 * rounding for found in facts["predictions"])
    assert facts["fastest"] > 10 * rounding / INTERVAL


def test_a_run_without_velocities_is_shown_with_a_spline(tmp_path):
    player = player_of(write(tmp_path / "run.h5", {"position": circling()[0]}), results())
    assert {found["surrogate"] for found in player.facts["predictions"]} == {"spline"}


def test_a_run_without_positions_has_a_sentence_instead_of_a_player(tmp_path):
    path = write(tmp_path / "run.h5", {"velocity": circling()[1]})
    player = player_of(path, results())
    assert player == Player({"left_out": "the run holds no positions"}, {})
    page = render({"player": player})
    assert "Not shown: the run holds no positions." in page
    assert "<canvas" not in page


def test_nothing_is_shown_where_nothing_was_compared(run):
    assert player_of(run, {}) is None
    assert "Particles in motion" not in render({"player": None})


def test_the_page_holds_the_frames_and_the_facts_that_results_keep_do_not(run):
    player = player_of(run, results())
    page = render({"player": player})
    found = re.findall(
        r'<script type="application/octet-stream" class="player-stream" data-name="(\w+)">([^<]*)<', page
    )
    assert {name: b64decode(text) for name, text in found} == player.streams
    assert len(json.dumps(player.facts)) < 10_000


@pytest.mark.physics
def test_a_page_of_20000_beads_in_100_frames_with_two_predictions_is_below_30_megabytes():
    position, _ = stirred(100, 20_000)
    predicted = [position + 1e-4 * stirred(100, 20_000, seed)[0] / 0.05 for seed in (1, 2)]
    box, packed = packed_within([position, *predicted], 2e-6)
    assert sum(map(len, packed)) <= MOST_BYTES
    assert box.quantum <= 4e-6  # of beads of 1 mm
    facts = {"left_out": ""}
    assert len(render({"player": Player(facts, {})})) + sum(4 * (len(data) // 3 + 1) for data in packed) < 30e6


# what a reader would do, before the page's own scripts: turns what happens into attributes of the body
WATCH = """<script>
// a browser's own, virtual time has no screen that asks for frames
window.requestAnimationFrame = (tick) => setTimeout(() => tick(performance.now()), 16);
window.cancelAnimationFrame = clearTimeout;
const seen = { errors: [], frames: new Set() };
const note = () => { document.body.dataset.seen = JSON.stringify({ ...seen, frames: [...seen.frames] }); };
for (const kind of ["error", "unhandledrejection", "securitypolicyviolation"])
  addEventListener(kind, (event) => {
    seen.errors.push(`${kind} ${event.message || event.violatedDirective}`);
    note();
  });
console.error = (...words) => { seen.errors.push(words.join(" ")); note(); };
const drawn = () => [...document.querySelectorAll(".stages canvas")].map((canvas) => {
  const copy = document.createElement("canvas"), side = 200;
  copy.width = copy.height = side;
  const paper = copy.getContext("2d");
  paper.drawImage(canvas, 0, 0, side, side);
  const pixels = paper.getImageData(0, 0, side, side).data;
  let solid = 0, sum = 0;
  for (let i = 0; i < pixels.length; i += 4) { solid += pixels[i + 3] > 0; sum += pixels[i] + 3 * pixels[i + 1]; }
  return [solid / side / side, sum];
});
const choose = (name, value) => {
  const pick = document.querySelector(`[name=${name}]`);
  pick.value = value;
  pick.dispatchEvent(new Event("change"));
};
const wait = setInterval(() => {
  const section = document.querySelector("section[data-player=ready]");
  if (!section) return;
  clearInterval(wait);
  seen.speed = drawn();
  choose("player-colour", "error");
  seen.error = drawn();
  choose("player-interval", "1");
  seen.finer = drawn();
  const canvas = document.querySelector(".stages canvas");
  canvas.setPointerCapture = () => {}; // of a finger that is not there
  canvas.dispatchEvent(new PointerEvent("pointerdown", { pointerId: 1, clientX: 10, clientY: 10 }));
  canvas.dispatchEvent(new PointerEvent("pointermove", { pointerId: 1, clientX: 100, clientY: 30 }));
  seen.turned = drawn();
  new MutationObserver(() => { seen.frames.add(Number(section.dataset.frame)); note(); })
    .observe(section, { attributes: true });
  document.querySelector(".play").click();
  note();
}, 50);
</script>"""


def dom_of(page, folder, *flags):
    """Return what a browser makes of a page, after some seconds of its own time."""
    path = folder / "page.html"
    path.write_text(page, encoding="utf-8")
    asked = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", *flags]
    asked += ["--disable-background-networking", f"--user-data-dir={folder / 'profile'}"]
    asked += ["--virtual-time-budget=12000", "--dump-dom", path.as_uri()]
    return subprocess.run([CHROMIUM, *asked], capture_output=True, text=True, timeout=100, check=True).stdout


@pytest.mark.physics
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine to play the particles")
def test_a_browser_draws_beads_plays_turns_and_colours_them_without_an_error(run, tmp_path):
    page = render({"player": player_of(run, results())}).replace("<body>", f"<body>{WATCH}")
    dom = dom_of(page, tmp_path)
    seen = json.loads(re.search(r'data-seen="([^"]*)"', dom)[1].replace("&quot;", '"'))
    assert seen["errors"] == []
    assert all(0.01 < solid < 0.9 for solid, _ in seen["speed"])  # beads, and ground around them
    assert seen["speed"][0] != seen["speed"][1]  # the surrogate is not the truth
    assert seen["error"][0][0] == seen["speed"][0][0]  # the same beads …
    assert seen["error"][0][1] != seen["speed"][0][1]  # … in other colours
    assert seen["finer"][1] != seen["error"][1]
    assert seen["turned"][0] != seen["finer"][0]
    assert len(seen["frames"]) > 30
    assert "<canvas" in dom


@pytest.mark.physics
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine to play the particles")
@pytest.mark.parametrize(
    ("flag", "script", "said"),
    [
        ("--disable-3d-apis", "", "this browser has no WebGL 2, or it is switched off"),
        ("--mute-audio", "<script>delete window.DecompressionStream</script>", "this browser cannot inflate them"),
    ],
)
def test_a_browser_that_cannot_draw_says_why(run, tmp_path, flag, script, said):
    write_report({"player": player_of(run, results())}, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("<body>", f"<body>{script}")
    dom = dom_of(page, tmp_path, flag)
    assert f'<p class="player-said">The particles cannot be shown: {said}' in dom
    assert 'data-player="failed"' in dom
