"""A small table, as text and as the HTML that a notebook shows."""

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

COLOURS = {  # ink and ground of our verdicts, as in the report; both are set, so either theme of a notebook can be read
    "sufficient": "color:#1a7f4b;background:#dff3e7",
    "insufficient": "color:#b3362b;background:#fae4e1",
    "undecidable": "color:#8a6100;background:#fbf0d2",
}
NONE = "–"


class Cell(NamedTuple):
    """What stands in one place of a table."""

    text: str
    verdict: str = ""  # that colours it
    hint: str = ""  # shown when the mouse rests on it
    strong: bool = False


class Table(NamedTuple):
    """Rows under heads, with a sentence above them."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[Cell]]

    def text(self) -> str:
        """Columns aligned to the right, one row a line."""
        lines = [list(self.heads), *[[cell.text for cell in row] for row in self.rows]]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        body = ["  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines]
        return "\n".join([self.title, *body])

    def html(self) -> str:
        """Return one `<table>` without scripts or style sheets, everything in it escaped."""
        heads = "".join(f"<th>{escape(head)}</th>" for head in self.heads)
        rows = "".join(f"<tr>{''.join(map(_html, row))}</tr>" for row in self.rows)
        caption = f'<caption style="text-align:left;caption-side:top">{escape(self.title)}</caption>'
        return f"<table>{caption}<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, `–` where there is none."""
    return NONE if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def _html(cell: Cell) -> str:
    colour = COLOURS.get(cell.verdict, "")
    style = f' style="{colour}"' if colour else ""
    hint = f' title="{escape(cell.hint)}"' if cell.hint else ""
    text = f"<b>{escape(cell.text)}</b>" if cell.strong else escape(cell.text)
    return f"<td{style}{hint}>{text}</td>"
