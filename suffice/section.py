"""A part of the report."""

from collections.abc import Mapping
from typing import NamedTuple

from suffice.plots import Figure


class Section(NamedTuple):
    """A part of the page and the figures it draws, by the values of its pickers joined with `|`."""

    title: str
    body: str  # HTML above the figure
    figures: Mapping[str, Figure] = {}
    pickers: Mapping[str, Mapping[str, str]] = {}  # name -> value -> what the reader sees
    below: str = ""
    scripts: tuple[str, ...] = ()  # files of the folder `page` that this section needs, in their order
