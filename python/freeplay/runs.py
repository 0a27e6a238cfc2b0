"""Scenarios played under controllers."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import pandas as pd

from . import _html, _toml
from ._command import PathLike, Progress, call, options
from ._scratch import Portable, Scratch
from .arm import Arm, ArmLike
from .controller import Controller
from .errors import NotInstalled
from .hosting import ControllerLike, argument
from .recording import Recording

if TYPE_CHECKING:
    from hdrh.histogram import HdrHistogram

# `set` is an argument of `run`.
Names = set[str]

#: The path of a scenario, or its keys as a dict.
ScenarioLike = Union[PathLike, Mapping[str, object]]


def run(
    scenario: ScenarioLike | None = None,
    controllers: Sequence[ControllerLike] | ControllerLike | None = None,
    *,
    standby: Sequence[ControllerLike] = (),
    model: ArmLike | None = None,
    believed: ArmLike | None = None,
    pace: str | None = None,
    seed: int | None = None,
    set: Mapping[str, object] | None = None,
    out: PathLike | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Run:
    """Plays a scenario: a simulated arm in one process, a controller in another, one run for each controller.

    Parameters
    ----------
    scenario : path or dict, optional
        A scenario file, or its keys: `{"duration": 2.0, "path": {"kind": "circle"}}`. Without it: the arm of Erkaya (2018) with 0.6 mm of play
        in joint 5.
    controllers : list, optional
        Built-in names ("computed-torque", "quasi-static", "narx-qp"), paths of executables or FMUs, and classes or objects of Python that are a
        `Controller`. Without it: the scenario's.
    standby : list
        Controllers that run beside each of them and take over where it fails.
    model : Arm or path, optional
        The plant's arm: the truth.
    believed : Arm or path, optional
        The arm that the controllers believe in, such as `Diagnosis.model`.
    pace : {"lockstep", "realtime"}, optional
        "lockstep" runs as fast as it can, the same to the bit on every machine; "realtime" follows the wall clock.
    seed : int, optional
        Seed of all noise.
    set : dict, optional
        Keys of the scenario to change, dotted or nested: `{"path.period": 12.0}`.
    out : path, optional
        Folder for the results. Without it they live as long as the result.
    force : bool
        Whether results of an earlier run in `out` are replaced.
    progress : callable or bool, optional
        Gets a line for each stage; True prints them on standard error.

    Returns
    -------
    Run
        Also where an arm was stopped or a limit was broken: see `Run.failures`.

    Raises
    ------
    BadUsage
        A key of the scenario is unknown.
    BadInput
        A value of the scenario is out of range.
    PeerMissing
        A controller does not start.
    InternalFault
        A controller raised an exception.

    Examples
    --------
    >>> done = run({"duration": 1.0}, controllers=["computed-torque"])  # doctest: +SKIP
    >>> done.table["rms_after_start"]  # doctest: +SKIP
    """
    scratch = Scratch()
    folder = scratch.path / "run" if out is None else Path(out)
    taken: Names = Names()
    keys = dict(_toml.leaves(scenario)) if isinstance(scenario, Mapping) else {}
    if believed is not None:
        keys["controller.model"] = _toml.value(_model(believed))
        if isinstance(believed, Arm) and believed.tip:
            keys["controller.tip"] = _toml.value(believed.tip)
    keys.update(_toml.leaves(set or {}))
    words: list[object] = ["run"]
    if scenario is not None and not isinstance(scenario, Mapping):
        words.append(scenario)
    for name, value in keys.items():
        words += ["--set", f"{name}={value}"]
    words += options(
        controller=[argument(each, scratch, taken) for each in _several(controllers)],
        standby=[argument(each, scratch, taken) for each in standby],
        model=None if model is None else _model(model), tip=model.tip if isinstance(model, Arm) else None, pace=pace, seed=seed,
        recording="mcap", format="json", out=folder, force=force,
    )  # fmt: skip
    # Exit code 1: the run was played, and the arm left its limits.
    done = call(words, accept=(0, 1), progress=progress)
    return Run(done.stdout, folder, scratch)


def _several(controllers: Sequence[ControllerLike] | ControllerLike | None) -> list[ControllerLike]:
    if controllers is None:
        return []
    if isinstance(controllers, (str, os.PathLike, Controller, type)):
        return [controllers]
    return list(controllers)


def _in_words(item: object) -> str:
    """A failure of a summary: its numbers by name, such as "rule stopped, tick 6, reason speed"."""
    if isinstance(item, Mapping):
        return ", ".join(f"{name} {value}" for name, value in item.items() if value is not None)
    return str(item)


def _model(arm: ArmLike) -> str:
    path = arm.path if isinstance(arm, Arm) else arm
    return str(path) if str(path) == "paper" else str(Path(path).absolute())


class Run(Portable):
    """The results of a run, for each controller.

    Attributes
    ----------
    json : dict
        The document `freeplay.summary/1`.
    text : str
        The same, as the command printed it.
    folder : Path
        Recordings, histograms, `summary.json`, `report.html`.
    controllers : list of str
        Names of the controllers, in the order of the runs: built-in names, `Controller.name` of classes, file names of executables.
    """

    def __init__(self, text: str, folder: Path, scratch: Scratch | None = None) -> None:
        self.text = text
        self.json: dict[str, Any] = json.loads(text)
        self.folder = folder
        self.controllers: list[str] = [str(each.get("files") or each["controller"]) for each in self.json["runs"]]
        self._scratch = scratch
        self._recordings: dict[str, Recording] = {}

    @property
    def table(self) -> pd.DataFrame:
        """The result of each controller.

        Returns
        -------
        DataFrame, one row a controller
            rms, max, rms_after_start, max_after_start: deviation of the tool, mm, of the whole run and after its first 0.5 s, if it is longer; missed: ticks without
            an answer in time; rejected: commands that the gate refused; state_hash: SHA-256 of every state and command.
        """
        rows = []
        for each in self.json["runs"]:
            deviation = {name: each["deviation_mm"].get(name) for name in ("rms", "max", "rms_after_start", "max_after_start")}
            rejected = sum((each.get("gate") or {}).get("rejected", {}).values())
            missed = (each.get("deadlines") or {}).get("missed", 0)
            rows.append({**deviation, "missed": missed, "rejected": rejected, "state_hash": each.get("state_hash")})
        return pd.DataFrame(rows, index=pd.Index(self.controllers, name="controller"))

    @property
    def failures(self) -> dict[str, list[str]]:
        """The reasons why a run failed, by controller: the arm was stopped, or left its limits. Empty: none failed."""
        found: dict[str, list[str]] = {}
        for name, each in zip(self.controllers, self.json["runs"]):
            words = [_in_words(item) for item in each.get("failures") or []]
            if words or each.get("stopped"):
                found[name] = words or [_in_words(each["stopped"])]
        return found

    @property
    def latencies(self) -> pd.DataFrame:
        """The durations of each stage of the loop.

        Returns
        -------
        DataFrame, indexed by controller and stage ("round_trip", "plant_step", "compute", …)
            p50, p99, p99.9, max (µs), count.
        """
        rows, index = [], []
        for controller, each in zip(self.controllers, self.json["runs"]):
            for stage, numbers in (each.get("latency_us") or {}).items():
                if numbers:
                    index.append((controller, stage))
                    rows.append({name: numbers.get(name) for name in ("p50", "p99", "p99.9", "max", "count")})
        return pd.DataFrame(rows, index=pd.MultiIndex.from_tuples(index, names=["controller", "stage"]))

    def histogram(self, stage: str = "round_trip", controller: str | None = None) -> HdrHistogram:
        """The latencies of a stage as an HdrHistogram of nanoseconds, from the run's `.hlog`.

        Parameters
        ----------
        stage : str
            A stage of `latencies`.
        controller : str, optional
            Without it: the first one.

        Raises
        ------
        KeyError
            There is no such controller or stage.
        NotInstalled
            The package `hdrhistogram` is missing: `pip install hdrhistogram`.
        """
        try:
            from hdrh.histogram import HdrHistogram
        except ImportError:
            raise NotInstalled("histograms need the package hdrhistogram: pip install hdrhistogram") from None
        path = self.folder / f"{self._file(controller)}.hlog"
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith(f"Tag={stage},"):
                return HdrHistogram.decode(line.rsplit(",", 1)[1])
        raise KeyError(f"{path.name} has no stage {stage!r}")

    @property
    def recordings(self) -> dict[str, Recording]:
        """The recording of each controller's run."""
        return {name: self.recording(name) for name in self.controllers}

    def recording(self, controller: str | None = None) -> Recording:
        """The recording of the run under `controller`; without it: of the first."""
        name = self._file(controller)
        if name not in self._recordings:
            # The recording lies in the run's folder, which has to live as long.
            self._recordings[name] = Recording(self.folder / f"{name}.mcap", self._scratch)
        return self._recordings[name]

    def frame(self, controller: str | None = None) -> pd.DataFrame:
        """The recorded values of every tick.

        Returns
        -------
        DataFrame, one row a tick
            The columns of `Recording.to_frame`, `deviation_x` … (m), `command_1` … (N*m, or rad with mode "driven"), and more.
        """
        return self.recording(controller).to_frame()

    @property
    def frames(self) -> dict[str, pd.DataFrame]:
        """`frame` of every controller."""
        return {name: self.frame(name) for name in self.controllers}

    def report(self, path: PathLike | None = None) -> Path:
        """The report with its charts, one HTML file; with `path` a copy of it."""
        report = self.folder / "report.html"
        return report if path is None else Path(shutil.copyfile(report, path))

    def _file(self, controller: str | None) -> str:
        """The name of the files of `controller`."""
        names = self.controllers
        if controller is not None and controller not in names:
            raise KeyError(f"no controller {controller!r} in this run: there are {', '.join(names)}")
        return names[0] if controller is None else controller

    def __repr__(self) -> str:
        return f"<Run of {', '.join(self.controllers)}>"

    def _repr_html_(self) -> str:
        shown = self.table[["rms_after_start", "max_after_start", "missed", "rejected"]]
        named = shown.rename(columns={"rms_after_start": "deviation RMS [mm]", "max_after_start": "max [mm]"})
        round_trip = self.latencies
        if "round_trip" in round_trip.index.get_level_values("stage"):
            named = named.join(round_trip.xs("round_trip", level="stage")[["p50", "p99.9"]].add_prefix("round trip ").add_suffix(" [µs]"))
        lines = [f"{name}: {words}" for name, each in self.failures.items() for words in each]
        return _html.page("Run", "Deviation of the tool after the first 0.5 s", [_html.table(named), _html.bullets(lines)])
