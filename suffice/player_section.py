"""Section of the report: the particles in motion, simulated and predicted, side by side."""

import json
from base64 import b64encode
from collections.abc import Mapping
from typing import Any

from suffice.player import Player
from suffice.section import Section
from suffice.wording import bytes_text, escape, number, seconds_text

TITLE = "Particles in motion"
# what the script fills in and draws on; without it a sentence stands there
STAGE = (
    '<div class="player" hidden><div class="picks">'
    '<label>colour <select name="player-colour"><option value="speed">speed</option>'
    '<option value="error">error of the surrogate</option></select></label>'
    '<label>surrogate trained every <select name="player-interval">{intervals}</select></label></div>'
    '<div class="stages"><figure><figcaption>simulation</figcaption>'
    '<canvas aria-label="simulated particles"></canvas></figure>'
    '<figure><figcaption class="named"></figcaption><canvas aria-label="predicted particles"></canvas>'
    '</figure></div><div class="ramp"><span>0</span><i></i><span class="end"></span></div>'
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
    stage = STAGE.format(intervals=options, last=facts["frames"] - 1)
    return Section(TITLE, _text(facts) + stage + _data(player), script="player.js")


def _text(facts: Mapping[str, Any]) -> str:
    """Return what is shown, and how wrong it is over all particles and unseen times."""
    diameter, items = facts["diameter"], []
    for found in facts["predictions"]:
        error = f"{number(found['rmse'] / diameter)} d" if diameter else f"{number(found['rmse'])} m"
        items.append(
            f"<li>Trained every <b>{seconds_text(found['interval'])}</b>{_judged(found, facts)}: "
            f"{escape(found['surrogate'])} on "
            f"{found['modes']} modes of position, RMSE at unseen times <b>{error}</b></li>"
        )
    fewer = facts["particles"] < facts["of_particles"]
    particles = f"{facts['particles']} of {facts['of_particles']}" if fewer else f"All {facts['particles']}"
    fine = f"{facts['quantum'] / diameter:.1g} d" if diameter else f"{number(facts['quantum'])} m"
    times = facts["times"]
    text = (
        f"{particles} particles in {facts['frames']} consecutive snapshots, {seconds_text(times[0])} to "
        f"{seconds_text(times[-1])}, places to {fine}, {bytes_text(facts['bytes'])} deflated. The RMSE is that of a "
        "component, over all particles, mean over the snapshots between those trained on. Drag to turn; a double click "
        "turns back."
    )
    return f'<ul class="verdicts">{"".join(items)}</ul><p class="quiet">{text}</p>'


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
