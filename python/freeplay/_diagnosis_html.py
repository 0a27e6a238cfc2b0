"""HTML of a diagnosis for notebooks."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import pandas as pd

from . import _html

if TYPE_CHECKING:
    from .diagnosis import Diagnosis

TITLES = {
    "named": "Found",
    "one_of": "One of several causes",
    "unknown": "Unknown physics",
    "nothing_missing": "Nothing missing",
    "insufficient_data": "Not enough data",
    "setup": "Recording and model differ in convention",
}
# Factor and unit of displayed numbers, by SI unit.
SHOWN = {"m": (1e3, "mm"), "rad": (1e3, "mrad"), "N*m": (1.0, "N·m")}
# Both colours have enough contrast on white and on black.
GIVEN, AFTER = "#cf5c43", "#2a93a5"


def card(diagnosis: Diagnosis) -> str:
    """HTML with verdict, findings, errors and next steps."""
    checks = [f"CHECK {line}" for line in diagnosis.setup["statement"].dropna()]
    parts = [_html.bullets(checks), _html.table(_found(diagnosis)), bars(diagnosis)]
    same = diagnosis.alternatives
    same = same[same["indistinguishable"]]
    if len(same):
        words = ", ".join(f"{what} at {joint}" if joint else str(what) for what, joint in zip(same["what"], same["joint"]))
        parts.append(f"<p>This recording can't distinguish it from: {escape(words)}.</p>")
    following = diagnosis.json.get("next") or []
    lines = [item if isinstance(item, str) else str(item.get("statement", item)) for item in following]
    parts += [_html.bullets(lines), _html.bullets(diagnosis.notes)]
    return _html.page(TITLES.get(diagnosis.verdict, diagnosis.verdict), diagnosis.statement, parts)


def _found(diagnosis: Diagnosis) -> pd.DataFrame:
    frame = diagnosis.found.reset_index()
    frame["share"] = [f"{share:.0%}" if share == share else "–" for share in frame["share"]]
    return frame.rename(columns={"interval": "95 %", "share": "of the error", "finding": "#"})


def bars(diagnosis: Diagnosis) -> str:
    """Bar chart of the channel errors: the model as given, and with the findings."""
    errors = diagnosis.errors.dropna(subset=["as_given", "with_findings"])
    if errors.empty:
        return ""
    rows = []
    for unit, group in errors.groupby("unit", sort=False):
        scale, name = SHOWN.get(str(unit), (1.0, str(unit)))
        longest = float(group[["as_given", "with_findings"]].to_numpy().max()) or 1.0
        for channel in group.index:
            before, after = (float(group["as_given"][channel]), float(group["with_findings"][channel]))
            rows.append(
                f"<tr><td>{escape(str(channel))}</td><td>{_bar(before / longest, GIVEN)}<br>{_bar(after / longest, AFTER)}</td>"
                f'<td class="n">{before * scale:.3g}<br>{after * scale:.3g}</td><td>{escape(name)}</td></tr>'
            )
    key = f'{_bar(0.08, GIVEN)} as given &nbsp; {_bar(0.08, AFTER)} with findings, on held-out data'
    return f'<p class="q">Error RMS: {key}</p><table><tbody>{"".join(rows)}</tbody></table>'


def _bar(share: float, colour: str) -> str:
    return f'<span class="bar" style="width:{max(0.15, 18.0 * share):.2f}em;background:{colour}"></span>'
