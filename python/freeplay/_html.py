"""HTML for notebooks with light and dark themes."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import pandas as pd

# Text and lines inherit the colour of the notebook, so that they have contrast in every theme.
STYLE = """<style>
.freeplay{font:13px/1.45 system-ui,sans-serif;color:inherit;max-width:64em}
.freeplay h4{margin:.2em 0 .3em!important;font-size:15px!important;font-weight:600!important}
.freeplay p{margin:.25em 0}
.freeplay table{border-collapse:collapse;margin:.5em 0;font-variant-numeric:tabular-nums}
.freeplay tr{background:none!important}
.freeplay th,.freeplay td{padding:.15em .8em .15em 0;border:0;text-align:left!important;background:none;color:inherit}
.freeplay th{border-bottom:1px solid currentColor;font-weight:600}
.freeplay td.n,.freeplay th.n{text-align:right!important}
.freeplay ul{margin:.3em 0;padding-left:1.2em}
.freeplay .q{opacity:.72}
.freeplay .bar{display:inline-block;height:.62em;border-radius:2px;vertical-align:baseline}
</style>"""


def page(title: str, words: str, parts: Sequence[str]) -> str:
    """HTML of a heading, a sentence and the `parts` below it."""
    sentence = f"<p>{escape(words)}</p>" if words else ""
    return f'{STYLE}<div class="freeplay"><h4>{escape(title)}</h4>{sentence}{"".join(parts)}</div>'


def table(frame: pd.DataFrame, limit: int = 20) -> str:
    """HTML table of the first `limit` rows. An empty frame gives an empty string."""
    if frame.empty:
        return ""
    shown = frame.head(limit)
    if not isinstance(shown.index, pd.RangeIndex):
        shown = shown.reset_index()
    if "unit" in shown.columns:
        shown = shown.assign(unit=shown["unit"].astype(str).str.replace("*", "·"))
    numeric = [pd.api.types.is_numeric_dtype(shown[column]) for column in shown.columns]
    kinds = [' class="n"' if number else "" for number in numeric]
    head = "".join(f"<th{kind}>{escape(str(column))}</th>" for column, kind in zip(shown.columns, kinds))
    body = "".join(
        "<tr>" + "".join(f"<td{kind}>{escape(cell(item))}</td>" for item, kind in zip(row, kinds)) + "</tr>"
        for row in shown.itertuples(index=False)
    )
    rest = len(frame) - len(shown)
    more = f'<p class="q">and {rest} more</p>' if rest > 0 else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def cell(item: object) -> str:
    """Text of a cell. Numbers have four significant digits, large ones no decimals. An interval contains "to", a missing value is a dash."""
    if isinstance(item, (tuple, list)):
        return " to ".join(cell(part) for part in item)
    if item is None or item is pd.NA or (isinstance(item, float) and item != item):
        return "–"
    if isinstance(item, float):
        return f"{item:.0f}" if 1e3 <= abs(item) < 1e9 else f"{item:.4g}"
    return str(item)


def bullets(lines: Sequence[str], limit: int = 8) -> str:
    """HTML list of the first `limit` lines, in faint text."""
    if not lines:
        return ""
    shown = [escape(line) for line in lines[:limit]]
    if len(lines) > limit:
        shown.append(f"and {len(lines) - limit} more")
    return '<ul class="q">' + "".join(f"<li>{line}</li>" for line in shown) + "</ul>"
