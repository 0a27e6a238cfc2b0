"""Charts of a diagnosis with matplotlib, in light and dark colours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.colors import to_rgb

from ._diagnosis_html import SHOWN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .diagnosis import Diagnosis

# Colours of the given model, of the model with the findings, of noise, of the background, of text and of grid lines.
LIGHT = {"given": "#c2452d", "after": "#00798c", "noise": "#7a7a7a", "page": "#ffffff", "ink": "#1b1b1b", "line": "#d9d9d9"}
DARK = {"given": "#ff8c70", "after": "#52c7d9", "noise": "#9a9a9a", "page": "#111418", "ink": "#e8e8e8", "line": "#3a3f45"}


def colours(theme: str) -> dict[str, str]:
    """The colours of `theme`. "auto" means dark if matplotlib's figures have a dark background.

    Raises
    ------
    ValueError
        The theme is unknown.
    """
    if theme == "auto":
        theme = "dark" if np.dot(to_rgb(mpl.rcParams["figure.facecolor"]), (0.2126, 0.7152, 0.0722)) < 0.5 else "light"
    if theme not in ("light", "dark"):
        raise ValueError(f'unknown theme {theme!r}: choose "auto", "light" or "dark"')
    return LIGHT if theme == "light" else DARK


@contextmanager
def themed(theme: str) -> Iterator[dict[str, str]]:
    """Context manager that sets matplotlib's parameters to the colours of `theme`, and restores them."""
    palette = colours(theme)
    page, ink = palette["page"], palette["ink"]
    parameters: dict[str, Any] = {
        "figure.facecolor": page, "axes.facecolor": page, "savefig.facecolor": page, "text.color": ink, "axes.labelcolor": ink,
        "axes.titlecolor": ink, "xtick.color": ink, "ytick.color": ink, "axes.edgecolor": palette["noise"], "axes.grid": True,
        "grid.color": palette["line"], "grid.linewidth": 0.6, "axes.spines.top": False, "axes.spines.right": False,
        "axes.axisbelow": True, "font.size": 9.5, "axes.titlesize": 10.5, "axes.titlelocation": "left", "legend.frameon": False,
        "legend.labelcolor": ink, "figure.dpi": 110,
    }  # fmt: skip
    # Restores only these parameters: `rc_context` would also undo the settings that pyplot makes on its first use in a notebook.
    before = {name: mpl.rcParams[cast("Any", name)] for name in parameters}
    mpl.rcParams.update(cast("Any", parameters))
    try:
        yield palette
    finally:
        mpl.rcParams.update(cast("Any", before))


def shown(unit: str) -> tuple[float, str]:
    """Factor and unit for displaying numbers of the SI unit `unit`."""
    return SHOWN.get(unit, (1.0, unit))


def errors(diagnosis: Diagnosis, theme: str) -> list[Axes]:
    """See `Diagnosis.plot_errors`."""
    frame = diagnosis.errors.dropna(subset=["as_given"])
    groups = list(frame.groupby("unit", sort=False))
    if not groups:
        raise ValueError(f"the diagnosis contains no errors to draw: its verdict is {diagnosis.verdict}")
    with themed(theme) as palette:
        heights = [len(group) + 1.2 for _, group in groups]
        figure, grid = plt.subplots(
            len(groups), 1, figsize=(7.2, 0.9 + 0.3 * sum(heights)), squeeze=False, height_ratios=heights, layout="constrained"
        )
        axes = [row[0] for row in grid]
        for ax, (unit, group) in zip(axes, groups):
            _dumbbells(ax, group, str(unit), palette)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return axes


def _dumbbells(ax: Axes, group: pd.DataFrame, unit: str, palette: dict[str, str]) -> None:
    """Draws one line for each channel, from the error of the given model to the error with the findings, beside the noise floor."""
    factor, name = shown(unit)
    rows = np.arange(len(group))
    before, after, noise = (group[column].to_numpy(dtype=float) * factor for column in ("as_given", "with_findings", "noise_floor"))
    ax.hlines(rows, np.fmin(before, after), np.fmax(before, after), color=palette["noise"], linewidth=1.2)
    ax.scatter(noise, rows, marker="|", s=120, color=palette["noise"], label="noise floor")
    # A ring and a dot: both are visible even if the error did not change.
    ax.scatter(before, rows, s=60, facecolors="none", edgecolors=palette["given"], linewidths=1.8, label="as given", zorder=3)
    ax.scatter(after, rows, s=26, color=palette["after"], label="with findings", zorder=4)
    values = np.concatenate([before, after, noise])
    values = values[np.isfinite(values) & (values > 0.0)]
    if values.size and values.max() > 20.0 * values.min():
        ax.set_xscale("log")
    else:
        ax.set_xlim(left=0.0)
    ax.set_yticks(rows, [str(channel) for channel in group.index])
    ax.set_ylim(len(group) - 0.4, -0.6)
    ax.set_xlabel(f"error RMS on held-out data [{name}]")
    ax.grid(axis="y", visible=False)


def found(diagnosis: Diagnosis, i: int, theme: str) -> list[Axes]:
    """See `Diagnosis.plot_found`."""
    effects = diagnosis.json.get("effects", [])
    if not 0 <= i < len(effects):
        raise IndexError(f"no finding {i}: the diagnosis has {len(effects)} findings")
    effect = effects[i]
    channel = _channel(diagnosis, effect)
    best = _map(diagnosis, channel)
    with themed(theme) as palette:
        count = 2 if best else 1
        figure, grid = plt.subplots(1, count, figsize=(3.6 + 2.9 * count, 3.0), squeeze=False, layout="constrained", width_ratios=[1.6, 1][:count])
        axes = list(grid[0])
        _over_time(axes[0], diagnosis, channel, palette)
        if best:
            _over_variable(axes[1], best, palette)
        joint = f" · {effect['joint']}" if effect.get("joint") else ""
        figure.suptitle(effect.get("phrase", effect["kind"].replace("_", " ")) + joint, x=0.01, ha="left", fontsize=11)
    return axes


def _channel(diagnosis: Diagnosis, effect: dict[str, Any]) -> str:
    """The channel that shows `effect` best: of those in its evidence, else of all, the one whose squared error relative to the noise falls most."""
    errors = diagnosis.errors
    named = [channel for channel in (effect.get("evidence") or {}).get("channels", []) if channel in errors.index]
    pool = errors.loc[named] if named else errors
    gain = pool["as_given"].pow(2).sub(pool["with_findings"].pow(2)) / pool["noise_floor"].pow(2).replace(0.0, np.nan)
    return str(gain.idxmax() if gain.notna().any() else pool.index[0])


def _map(diagnosis: Diagnosis, channel: str) -> dict[str, Any] | None:
    """The error map of `channel` that explains most: the error of the tuned model over one variable. None without maps."""
    maps = [each for each in diagnosis.json.get("maps", []) if each.get("channel") == channel and each.get("at")]
    return max(maps, key=lambda each: float(each.get("explained", 0.0)), default=None)


def _over_time(ax: Axes, diagnosis: Diagnosis, channel: str, palette: dict[str, str]) -> None:
    frame = diagnosis.residuals
    frame = frame[frame["recording"] == frame["recording"].max()]
    factor, name = shown(str(diagnosis.errors["unit"].get(channel, "")))
    for suffix, label in (("before", "as given"), ("after", "with findings")):
        column = f"{channel}_{suffix}"
        if column in frame:
            colour = palette["given" if suffix == "before" else "after"]
            ax.plot(frame["t"], factor * frame[column], color=colour, linewidth=1.1, label=label)
    ax.set_xlabel("time [s]")
    ax.set_ylabel(f"measured − model, {channel} [{name}]")
    ax.legend(loc="best")


def _over_variable(ax: Axes, best: dict[str, Any], palette: dict[str, str]) -> None:
    factor, name = shown(str(best.get("unit", "")))
    mean = np.array([np.nan if value is None else value for value in best["mean"]], dtype=float)
    ax.plot(best["at"], factor * mean, ".-", color=palette["given"], linewidth=1.1, markersize=4)
    ax.set_xlabel(f"{best['variable']} [{best.get('variable_unit', '')}]")
    ax.set_ylabel(f"mean error, tuned model [{name}]")
    share = best.get("explained")
    if share is not None:
        ax.set_title(f"explains {float(share):.0%} of its variance")
