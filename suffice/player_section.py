"""Section of the report: the particles in motion, simulated and predicted, side by side."""

import json
from base64 import b64encode
from collections.abc import Mapping
from typing import Any

from suffice.player import Player
from suffice.section import Section
from suffice.wording import bytes_text, escape, number, seconds_text

TITLE = "Particles in motion"
SCRIPTS = ("player_data.js", "player_view.js", "player_hand.js", "player.js")
FLUID_SCALE = '<div class="fluid-ramp"><span>fluid 0</span><i></i><span class="end"></span></div>'
# what the script fills in and draws on; without it a sentence stands there
STAGE = (
    '<div class="player" hidden><div class="picks">'
    '<label>colour <select name="player-colour"><option value="speed">speed</option>'
    '<option value="error">error of the surrogate</option></select></label>'
    '<label>surrogate trained every <select name="player-interval">{intervals}</select></label>'
    "{planes}</div>"
    '<div class="stages"><figure><figcaption>simulation</figcaption>'
    '<canvas tabindex="0" aria-label="simulated particles"></canvas></figure>'
    '<figure><figcaption class="named"></figcaption><canvas tabindex="0" aria-label="predicted particles"></canvas>'
    '</figure></div><div class="ramps">'
    '<div class="ramp"><span>beads 0</span><i></i><span class="end"></span></div>{scale}</div>'
    '<div class="transport"><button type="button" class="play">Play</button>'
    '<input type="range" class="scrub" min="0" max="{last}" value="0" aria-label="frame"></div>'
    '<p class="moment" aria-live="off"></p></div>'
    '<p class="player-said">The particles are being unpacked; this needs JavaScript and WebGL 2.</p>'
)


def player_section(results: Mapping[str, Any]) -> Section | None:
    """Show a run and its surrogate as spheres that can be played, turned and coloured; None where none was made.

    results["player"]: a `Player`. Where there is nothing to show, the section says why.
    """
    player: Player | None = results.get("player")
    if player is None:
        return None
    facts = player.facts
    if "left_out" in facts:
        return Section(TITLE, f'<p class="quiet">Not shown: {escape(str(facts["left_out"]))}.</p>')
    options = "".join(
        f'<option value="{i}">{seconds_text(found["interval"])}</option>'
        for i, found in enumerate(facts["predictions"])
    )
    fluid = facts["fluid"]
    planes, scale = ("", "") if fluid is None else (_planes(fluid), FLUID_SCALE)
    stage = STAGE.format(intervals=options, planes=planes, scale=scale, last=facts["frames"] - 1)
    return Section(TITLE, _text(facts) + stage + _data(player), scripts=SCRIPTS)


def _planes(fluid: Mapping[str, Any]) -> str:
    """Return what picks the plane on which the speed of the fluid is shown: the first of them, or none."""
    options = "".join(
        f'<option value="{i}"{"" if i else " selected"}>across {plane["across"]}</option>'
        for i, plane in enumerate(fluid["planes"])
    )
    return (
        f'<label>fluid on a plane <select name="player-fluid">{options}<option value="">off</option></select></label>'
    )


def _text(facts: Mapping[str, Any]) -> str:
    """Return what is shown, and how wrong it is over all particles and unseen times."""
    items = "".join(_item(i, facts) for i in range(len(facts["predictions"])))
    diameter, times = facts["diameter"], facts["times"]
    fewer = facts["particles"] < facts["of_particles"]
    particles = f"{facts['particles']} of {facts['of_particles']}" if fewer else f"All {facts['particles']}"
    fine = f"{facts['quantum'] / diameter:.1g} d" if diameter else f"{number(facts['quantum'])} m"
    text = (
        f"{particles} particles of {escape(str(facts['run']))} in {facts['frames']} consecutive snapshots, "
        f"{seconds_text(times[0])} to {seconds_text(times[-1])}, places to {fine}, {bytes_text(facts['bytes'])} "
        "deflated. The RMSE is that of a component, over all particles or cells, mean over the snapshots between those "
        "trained on. "
    )
    if facts["fluid"] is not None:
        text += (
            "The plane shows the speed of the fluid in the middle layer of cells, within moving walls that of the "
            "wall; particles before it are cut away. "
        )
    if facts["fluid_left_out"]:
        text += f"The fluid is not shown: {escape(str(facts['fluid_left_out']))}. "
    text += "Drag to turn, wheel or pinch to zoom, double click or tap to return; space plays, arrows step."
    return f'<ul class="verdicts">{items}</ul><p class="quiet">{text}</p>'


def _item(i: int, facts: Mapping[str, Any]) -> str:
    """Return what was trained, how far off it is, and whether the paper's rule lets one expect so."""
    found, diameter = facts["predictions"][i], facts["diameter"]
    error = f"{number(found['rmse'] / diameter)} d" if diameter else f"{number(found['rmse'])} m"
    text = (
        f"Trained every <b>{seconds_text(found['interval'])}</b>{_judged(found, facts)}: {escape(found['surrogate'])} "
        f"on {found['modes']} modes of position, RMSE at unseen times <b>{error}</b>"
    )
    if facts["fluid"] is not None:
        own = facts["fluid"]["predictions"][i]
        text += (
            f"; {escape(own['surrogate'])} on {own['modes']} modes of the fluid's velocity, {number(own['rmse'])} m/s"
        )
    return f"<li>{text}</li>"


def _judged(found: Mapping[str, Any], facts: Mapping[str, Any]) -> str:
    """Say whether the paper's rule finds this Δτ sufficient for every component of position."""
    enough = facts["sufficient"] is not None and found["interval"] <= facts["sufficient"]
    return f" ({'' if enough else 'not '}sufficient for all of position)"


def _data(player: Player) -> str:
    """Return the facts as JSON and each stream as base64, in elements that no browser runs."""
    facts = json.dumps(player.facts, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    streams = "".join(
        f'<script type="application/octet-stream" class="player-stream" data-name="{name}">'
        f"{b64encode(data).decode('ascii')}</script>"
        for name, data in player.streams.items()
    )
    return f'<script type="application/json" id="player-facts">{facts}</script>{streams}'
