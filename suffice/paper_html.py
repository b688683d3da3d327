"""The paper's tables and statements as HTML."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from suffice.verdicts import SUBSCRIPT, SYMBOL, VERDICTS
from suffice.wording import bytes_text, escape, plain_number, seconds_text

TEXT = ("property", "unit", "case")
DECIMALS = {"K_f": 2, "K_f_low": 2, "K_f_high": 2, "R_rom_n_lr": 3}


def table_html(table: Mapping[str, Any]) -> str:
    """Return a numbered table with its caption; columns of words left, of numbers right."""
    columns: Mapping[str, Mapping[str, str]] = table["columns"]
    head = "".join(f'<th class="{_class(key)}">{_title(column)}</th>' for key, column in columns.items())
    body = "".join(
        f"<tr>{''.join(_cell(key, row[key], column['unit']) for key, column in columns.items())}</tr>"
        for row in table["rows"]
    )
    caption = f"<p><b>Table {table['number']}.</b> {symbols(escape(table['caption']))}</p>"
    return f'{caption}<div class="scroll"><table class="plain"><tr>{head}</tr>{body}</table></div>'


def differences_html(rows: Sequence[Mapping[str, str]]) -> str:
    """Return the paper's statements, ours and the reasons, side by side; on a phone the reasons below."""
    body = "".join(
        f"<tr><th>{symbols(escape(row['statement']))}</th><td>{symbols(escape(row['paper']))}</td>"
        f"<td>{symbols(escape(row['here']))}</td></tr>"
        f'<tr><td colspan="3" class="quiet">{symbols(escape(row["why"]))}</td></tr>'
        for row in rows
    )
    head = "<tr><th>statement</th><th>paper</th><th>here</th></tr>"
    return f'<table class="plain wrapped">{head}{body}</table>'


def _class(key: str) -> str:
    return "" if key in TEXT else "number"


def _title(column: Mapping[str, str]) -> str:
    title, unit = symbols(escape(column["title"])), column["unit"]
    return title if unit in ("", "s", "B") else f"{title} ({escape(unit)})"


def _cell(key: str, value: Any, unit: str) -> str:
    decimals = DECIMALS.get(key)
    shown = _shown(value, unit) if decimals is None or value is None else f"{value:.{decimals}f}"
    if key == "verdict" and value in VERDICTS:
        shown = f'<span class="pill {value}">{value}</span>'
    return f'<td class="{_class(key)}">{shown}</td>'


def _shown(value: Any, unit: str) -> str:
    """Write a value: a time, a size, a number, yes or no, several numbers, words."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return " + ".join(map(str, value))
    if isinstance(value, str):
        return escape(value)
    units: Mapping[str, Callable[[Any], str]] = {"s": seconds_text, "B": bytes_text}
    if unit not in units and isinstance(value, int):
        return f"{value:,}"
    return units.get(unit, plain_number)(value)


def symbols(text: str) -> str:
    """Set the indices of symbols below the line: K_f, n_lr, c_1."""
    return SYMBOL.sub(SUBSCRIPT, text)
