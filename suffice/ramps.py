"""Colours of a quantity from 0 to the end of its scale, the same in pictures and in the player of the report."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# even steps; those of page/player.js
RAMPS: Mapping[str, tuple[str, ...]] = {
    "speed": ("#3b4cc0", "#2f8fbf", "#35b779", "#b5cf3a", "#fde04a"),
    "error": ("#8d99a8", "#c9a24b", "#e8863a", "#d9442f", "#9c1560"),
}


def colours_of(values: ArrayLike, end: float, ramp: str) -> Array:
    """Return red, green and blue (…, 3), 0 to 1, of values from 0 to `end`; beyond it the colour is that of the end."""
    steps = np.array([[int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for colour in RAMPS[ramp]])
    level = np.clip(np.asarray(values, np.float64) / end, 0.0, 1.0) * (len(steps) - 1)
    return np.stack([np.interp(level, np.arange(len(steps)), channel) for channel in steps.T], axis=-1)


def ramp_html(ramp: str, end: str) -> str:
    """Return the scale as a bar between 0 and a text, which must be escaped."""
    colours = ", ".join(RAMPS[ramp])
    bar = f'<i style="background:linear-gradient(to right, {colours})"></i>'
    return f'<div class="ramp"><span>0</span>{bar}<span>{end}</span></div>'
