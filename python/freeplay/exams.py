"""Fault tests of a controller."""

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
    """Injects faults into a controller, and judges how the run handles each fault.

    Parameters
    ----------
    controller : str, path, or Controller class or object
        Controller to test.
    kinds : sequence of str, optional
        Kinds of faults to inject, such as "nan", "hang", "crash". Default: all kinds, one after another.
    seeds : int
        Number of faults of each kind.
    standby : str, path, or Controller class or object
        Standby controller, which takes over from the tested one.
    scenario : path, optional
        Scenario file. Default: the arm of Erkaya (2018).
    set : dict, optional
        Scenario keys to change, dotted or nested.
    pace : {"lockstep", "realtime"}, optional
        Schedule of the ticks. "lockstep" is deterministic and as fast as possible; "realtime" follows the wall clock. Default: the value in
        the scenario, or "lockstep".
    seed : int, optional
        Seed of the fault ticks, of the random parts of faults, and of all noise. Default: 1.
    out : path, optional
        Folder for the results. Default: a temporary folder, which is removed together with the returned object.
    force : bool
        True: replace results of an earlier command in `out`.
    progress : callable or bool, optional
        Function that receives one line for each stage. True: print the lines on standard error.

    Returns
    -------
    Exam
        `Exam.passed` is False if a verdict does not hold.

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


# The parameter `set` of `examine` hides the type.
Names = set[str]


class Exam:
    """Results of the fault tests of a controller.

    Attributes
    ----------
    passed : bool
        True if every verdict holds.
    json : dict
        The JSON output of the command.
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
            holds; count, injected faults; detected, detected faults; slowest, longest time to a detection, ticks; bad_applied, bad commands
            that reached the arm; deviation_ratio, tool deviation relative to a run without faults; deviation_peak_mm, largest deviation, mm.
        """
        names = ["kind", "holds", "count", "detected", "slowest", "bad_applied", "deviation_ratio", "deviation_peak_mm"]
        rows = [{name: each.get(name) for name in names} for each in self.json["verdicts"]]
        return pd.DataFrame(rows, columns=names).set_index("kind")

    def report(self) -> Path:
        """Path of the report, one HTML file."""
        return self.folder / "faults.html"

    def __repr__(self) -> str:
        return f"<Exam {'passed' if self.passed else 'NOT passed'}: {', '.join(self.verdicts.index)}>"

    def _repr_html_(self) -> str:
        return _html.page("Exam passed" if self.passed else "Exam not passed", "", [_html.table(self.verdicts, 30)])
