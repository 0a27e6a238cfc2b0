"""The exam of a controller."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from . import _html, _toml
from ._command import PathLike, Progress, call, options
from ._scratch import Scratch
from .hosting import ControllerLike, argument


def examine(
    controller: ControllerLike,
    *,
    kinds: Sequence[str] | None = None,
    seeds: int = 5,
    standby: ControllerLike = "computed-torque",
    scenario: PathLike | None = None,
    set: Mapping[str, object] | None = None,
    pace: str | None = None,
    seed: int | None = None,
    out: PathLike | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Exam:
    """Examines a controller: injects faults, and measures how the plant, its gate and a standby take each.

    Parameters
    ----------
    controller : str, path, or Controller class or object
        The controller to examine.
    kinds : sequence of str, optional
        Kinds of fault, such as "nan", "hang", "crash"; without it all, one after the other.
    seeds : int
        Faults of each kind.
    standby : str, path, or Controller class or object
        The controller that stands by.
    scenario : path, optional
        The scenario; without it: the arm of Erkaya (2018).
    set : dict, optional
        Keys of the scenario to change.
    pace : {"lockstep", "realtime"}, optional
        As fast as it goes, or by the wall clock.
    seed : int, optional
        Seed of the ticks and of all noise.
    out : path, optional
        Folder for the results. Without it they live as long as the result.
    force : bool
        Whether results of an earlier exam in `out` are replaced.
    progress : callable or bool, optional
        Gets a line for each stage; True prints them on standard error.

    Returns
    -------
    Exam
        Also where a verdict does not hold: see `Exam.passed`.

    Raises
    ------
    PeerMissing
        The controller does not start, or fails without an injected fault.
    """
    scratch = Scratch()
    folder = scratch.path / "exam" if out is None else Path(out)
    taken: Names = Names()
    sets = [f"{name}={value}" for name, value in _toml.leaves(set or {})]
    chosen = options(
        scenario=scenario, standby=argument(standby, scratch, taken), kind=list(kinds or []), seeds=seeds, pace=pace, set=sets, seed=seed,
        out=folder, force=force, format="json",
    )  # fmt: skip
    done = call(["faults", argument(controller, scratch, taken), *chosen], accept=(0, 1), progress=progress)
    return Exam(done.stdout, folder, done.code == 0, scratch)


# `set` is an argument of `examine`.
Names = set[str]


class Exam:
    """The exam of a controller.

    Attributes
    ----------
    passed : bool
        Whether every verdict holds.
    json : dict
        The document that the command printed.
    """

    def __init__(self, text: str, folder: Path, passed: bool, scratch: Scratch | None = None) -> None:
        self.json: dict[str, Any] = json.loads(text)
        self.folder, self.passed, self._scratch = folder, passed, scratch

    @property
    def verdicts(self) -> pd.DataFrame:
        """The verdict on each kind of fault.

        Returns
        -------
        DataFrame, indexed by kind
            holds; count and detected (faults); slowest, ticks until the slowest was detected; bad_applied, bad commands that reached the arm;
            deviation_ratio, the tool's deviation as a multiple of that of a sound run, and deviation_peak_mm (mm).
        """
        names = ["kind", "holds", "count", "detected", "slowest", "bad_applied", "deviation_ratio", "deviation_peak_mm"]
        rows = [{name: each.get(name) for name in names} for each in self.json["verdicts"]]
        return pd.DataFrame(rows, columns=names).set_index("kind")

    def report(self) -> Path:
        """The report, one HTML file."""
        return self.folder / "faults.html"

    def __repr__(self) -> str:
        return f"<Exam {'passed' if self.passed else 'NOT passed'}: {', '.join(self.verdicts.index)}>"

    def _repr_html_(self) -> str:
        return _html.page("Exam passed" if self.passed else "Exam not passed", "", [_html.table(self.verdicts, 30)])
