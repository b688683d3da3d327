"""A list of names and values, as text and as the HTML that a notebook shows."""

from collections.abc import Mapping
from html import escape


def facts_text(title: str, facts: Mapping[str, str]) -> str:
    """Return the title and one line for each fact, values under each other."""
    width = max(map(len, facts), default=0)
    return "\n".join([title, *(f"  {name:<{width}}  {value}" for name, value in facts.items())])


def facts_html(title: str, facts: Mapping[str, str]) -> str:
    """Return one `<table>` without scripts or style sheets, everything in it escaped."""
    left = ' style="text-align:left"'
    rows = "".join(
        f"<tr><th{left}>{escape(name)}</th><td{left}>{escape(value)}</td></tr>" for name, value in facts.items()
    )
    caption = f'<caption style="text-align:left;caption-side:top">{escape(title)}</caption>'
    return f"<table>{caption}<tbody>{rows}</tbody></table>"
