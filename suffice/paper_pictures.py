"""The paper's figures that show beads and fluid in space: 1, 5 and 9, and with them 3 and 4."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pod import InputError as UnfitSnapshots
from selection.errors import InputError as UnfitIntervals
from selection.intervals import candidates
from sim import Scene
from suffice.bridge import Bridge, bridges_of
from suffice.gallery import Gallery, Moment, fastest_of, fluid_pictures, predicted, unseen_moment
from suffice.idea_drawing import idea_drawing
from suffice.mill_drawing import mill_drawing
from suffice.picture_figures import Curve, Picture, chart, not_shown, numbered, side_by_side
from suffice.ramps import ramp_html
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.wording import number, seconds_text
from surrogates import InputError as UnfitSeries

Array = NDArray[np.float64]

LARGE, MEDIUM, SMALL = 380, 320, 300  # pixels of a picture's width
GAPS_SHOWN = 6  # training intervals over which a bead's path is drawn
TYPICAL = (0.5, 0.99)  # share of the beads whose error is smaller than that of one whose path is drawn
FINELY = 8  # points of a predicted path in a dense interval
MOST_MOMENTS = 6  # of Figure 9
SIMULATED, PREDICTED, KEPT = "currentColor", "#e08214", "#3b8fd0"


def figure_1(run: Run, interval: float, sufficient: float | None = None) -> str:
    """Return simulation against a surrogate trained every `interval` (s), meant to be too coarse (paper Figure 1).

    Left the paths of two beads, right beads and fluid between two snapshots trained on. sufficient: s, the largest Δτ
    that the rule finds sufficient; None where none is.
    """
    title = f"Simulation and surrogate, Δτ = {seconds_text(interval)}, {_verdict(interval, sufficient)}"
    return _or_why_not("Figure 1", title, lambda: _figure_1(run, interval, title))


def figure_3(interval: float, dense: float, n_lr: int, n_c: int, limit: float = 2.0) -> str:
    """Return the idea with the numbers of a study: Δτ and the dense interval (s), n_lr and n_c (paper Figure 3)."""
    every = seconds_text(dense)
    caption = (
        f"Snapshots every Δτ = {seconds_text(interval)} are decomposed into modes. Their coefficients are interpolated "
        f"in between, and each prediction is a sum of modes, here every {every}, at any other time just as well."
    )
    return numbered("Figure 3", "The idea", idea_drawing(interval, dense, n_lr, n_c, limit), caption)


def figure_4(scene: Scene) -> str:
    """Return the dimensions of a mill (paper Figure 4)."""
    return numbered("Figure 4", "Dimensions of the mill", mill_drawing(scene), "")


def figure_5(run: Run, intervals: Sequence[float], sufficient: float | None = None) -> str:
    """Return one moment in the simulation and in surrogates of several Δτ (s), by distance (paper Figure 5).

    sufficient: s, the largest Δτ that the rule finds sufficient; None where none is.
    """
    title = "The same moment at several Δτ"
    return _or_why_not("Figure 5", title, lambda: _figure_5(run, intervals, sufficient, title))


def figure_9(run: Run, interval: float) -> str:
    """Return reproductions and predictions over one training interval Δτ (s) (paper Figure 9)."""
    title = f"Reproductions and predictions, Δτ = {seconds_text(interval)}"
    return _or_why_not("Figure 9", title, lambda: _figure_9(run, interval, title))


def _or_why_not(label: str, title: str, make: Callable[[], str]) -> str:
    try:
        return make()
    except (Refusal, UnfitIntervals, UnfitSnapshots, UnfitSeries) as error:
        return not_shown(label, title, str(error))


def _verdict(interval: float, sufficient: float | None) -> str:
    return "sufficient" if sufficient is not None and interval <= sufficient else "not sufficient"


def _ms(time: float) -> str:
    return f"{1e3 * time:.6g} ms"


def _bridge(run: Run, interval: float) -> Bridge:
    return bridges_of(run, "position", [interval])[interval]


def _figure_1(run: Run, interval: float, title: str) -> str:
    gallery, bridge = Gallery(run, LARGE), _bridge(run, interval)
    k = unseen_moment([bridge.case.training])
    moment = gallery.moment(k)
    place, speed = predicted(bridge, moment.time)
    fastest, when = fastest_of(moment.speed), f"t = {_ms(moment.time)}"
    beads = [
        Picture(gallery.by_speed(moment, moment.position, moment.speed, fastest), "Beads, simulation", when),
        Picture(gallery.by_speed(moment, place, speed, fastest), "Beads, surrogate", gallery.off(moment, place)),
    ]
    shown = [[picture] for picture in beads]
    scales = ramp_html("speed", f"{number(fastest, 2)} m/s or more (beads)")
    if run.grid is not None:
        simulated, surrogate, end = fluid_pictures(gallery, moment, interval)
        shown += [[Picture(simulated, "Fluid, simulation", when)], [Picture(surrogate, "Fluid, surrogate")]]
        scales += ramp_html("speed", f"{number(end, 2)} m/s or more (fluid, on the cut)")
    paths = _paths(gallery, bridge, moment, k)
    body = f'<div class="drawings"><div class="charts">{paths}</div><div>{side_by_side(shown)}{scales}</div></div>'
    caption = (
        "Paths: the bead whose error over these times is the median of all, and one that only a hundredth exceeds. "
        "Pictures: the mill cut in its middle, at the time that lies farthest from those trained on. Surrogate: "
        f"{bridge.surrogate.name} on {bridge.modes} modes of position, from {len(bridge.case.training)} snapshots."
    )
    return numbered("Figure 1", title, body, caption)


def _paths(gallery: Gallery, bridge: Bridge, moment: Moment, k: int) -> str:
    """Return the horizontal place of a typical bead over some training intervals around snapshot k."""
    run, training = gallery.run, bridge.case.training
    before = int(np.searchsorted(training, k)) - GAPS_SHOWN // 2
    first = min(max(before, 0), max(len(training) - 1 - GAPS_SHOWN, 0))
    kept = training[first : first + GAPS_SHOWN + 1]
    frames = np.arange(kept[0], kept[-1] + 1)
    truth = np.stack([run.snapshot(int(j)).values["position"] for j in frames]).astype(np.float64)
    error = np.square(bridge.at(run.times[frames]).reshape(truth.shape) - truth).sum(axis=(0, 2))
    worse = np.argsort(error)
    times = np.linspace(run.times[frames[0]], run.times[frames[-1]], FINELY * (len(frames) - 1) + 1)
    charts = []
    for share in TYPICAL:
        bead = int(worse[round(share * (len(worse) - 1))])
        path, true = (
            values @ moment.view.frame[0] for values in (bridge.at(times, 3 * bead + np.arange(3)), truth[:, bead])
        )
        curves = [
            Curve("simulation", 1e3 * run.times[frames], 1e3 * true, SIMULATED),
            Curve("surrogate", 1e3 * times, 1e3 * path, PREDICTED, dashed=True),
            Curve("trained on", 1e3 * run.times[kept], 1e3 * true[kept - kept[0]], KEPT, dots=True),
        ]
        charts.append(chart(curves, "time (ms)", f"bead {run.ids[bead]}, horizontal (mm)"))
    return "".join(charts)


def _figure_5(run: Run, intervals: Sequence[float], sufficient: float | None, title: str) -> str:
    gallery = Gallery(run, MEDIUM)
    coarse_first = sorted(intervals, reverse=True)
    trainings = [subset.training for subset in candidates(run.times, coarse_first)]
    moment = gallery.moment(unseen_moment(trainings))
    shown = [[Picture(gallery.by_distance(moment, moment.position), "Simulation", f"t = {_ms(moment.time)}")]]
    for interval in coarse_first:
        bridge = _bridge(run, interval)
        place, _ = predicted(bridge, moment.time)
        note = f"{len(bridge.case.training)} snapshots, {bridge.modes} modes; {gallery.off(moment, place)}"
        picture = gallery.by_distance(moment, place)
        shown.append([Picture(picture, f"Δτ = {seconds_text(interval)}, {_verdict(interval, sufficient)}", note)])
    caption = (
        "The mill cut in its middle, at a time that none was trained on. Colour: distance of each bead from its place "
        f"in the simulation, in diameters d = {number(1e3 * gallery.diameter)} mm."
    )
    return numbered("Figure 5", title, side_by_side(shown) + ramp_html("error", "1 d or more"), caption)


def _figure_9(run: Run, interval: float, title: str) -> str:
    gallery, bridge = Gallery(run, SMALL), _bridge(run, interval)
    training = bridge.case.training
    start = int(training[2 * (len(training) - 1) // 3])
    stride = int(training[1] - training[0])
    frames = start + np.unique(np.linspace(0, stride, min(stride + 1, MOST_MOMENTS)).round().astype(int))
    moments = [gallery.moment(int(k)) for k in frames]
    fastest, shown = fastest_of(moments[0].speed), []
    for k, moment in zip(frames, moments, strict=True):
        place, speed = predicted(bridge, moment.time)
        kind, name = ("kept", "Reproduction") if k in training else ("between", "Prediction")
        simulated = gallery.by_speed(moment, moment.position, moment.speed, fastest)
        surrogate = gallery.by_speed(moment, place, speed, fastest)
        shown.append(
            [
                Picture(simulated, f"Simulation, {_ms(moment.time)}"),
                Picture(surrogate, f"{name}, {_ms(moment.time)}", gallery.off(moment, place), kind),
            ]
        )
    caption = (
        f"Above the simulation, below {bridge.surrogate.name} on {bridge.modes} modes. The snapshots framed in green "
        "were trained on; those framed in blue were not."
    )
    return numbered(
        "Figure 9", title, side_by_side(shown) + ramp_html("speed", f"{number(fastest, 2)} m/s or more"), caption
    )
