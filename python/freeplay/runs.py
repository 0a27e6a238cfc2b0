"""Simulated runs of scenarios with controllers."""

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

# The parameter `set` of `run` hides the type.
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
    """Runs a scenario: one process simulates an arm, and another process runs the controller. Several controllers run one after another.

    Parameters
    ----------
    scenario : path or dict, optional
        Scenario file, or its keys: `{"duration": 2.0, "path": {"kind": "circle"}}`. Default: the arm of Erkaya (2018), 0.6 mm of play in joint
        5, the smooth path in 6 s.
    controllers : list, optional
        Built-in names ("computed-torque", "quasi-static", "narx-qp"), paths of executables or FMUs, and subclasses or objects of `Controller`.
        Default: the controller in the scenario.
    standby : list
        Standby controllers. They run beside each controller and take over when it fails.
    model : Arm or path, optional
        Arm of the plant.
    believed : Arm or path, optional
        The controllers' model of the arm, such as `Diagnosis.model`. Default: the plant's arm with its clearances.
    pace : {"lockstep", "realtime"}, optional
        Schedule of the ticks. "lockstep" is deterministic and as fast as possible; "realtime" follows the wall clock. Default: the value in
        the scenario, or "lockstep".
    seed : int, optional
        Seed of all noise.
    set : dict, optional
        Scenario keys to change, dotted or nested: `{"path.period": 12.0}`.
    out : path, optional
        Folder for the results. Default: a temporary folder, which is removed together with the returned object.
    force : bool
        True: replace results of an earlier command in `out`.
    progress : callable or bool, optional
        Function that receives one line for each stage. True: print the lines on standard error.

    Returns
    -------
    Run
        `Run.failures` lists the reasons if the run stopped the arm or the arm exceeded a limit.

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
    # Exit code 1: the run ended, but the arm exceeded a limit.
    done = call(words, accept=(0, 1), progress=progress)
    return Run(done.stdout, folder, scratch)


def _several(controllers: Sequence[ControllerLike] | ControllerLike | None) -> list[ControllerLike]:
    if controllers is None:
        return []
    if isinstance(controllers, (str, os.PathLike, Controller, type)):
        return [controllers]
    return list(controllers)


def _in_words(item: object) -> str:
    """Text of a failure in a summary, such as "rule stopped, tick 6, reason speed"."""
    if isinstance(item, Mapping):
        return ", ".join(f"{name} {value}" for name, value in item.items() if value is not None)
    return str(item)


def _model(arm: ArmLike) -> str:
    path = arm.path if isinstance(arm, Arm) else arm
    return str(path) if str(path) == "paper" else str(Path(path).absolute())


class Run(Portable):
    """Results of a scenario, for each controller.

    Attributes
    ----------
    json : dict
        The document `freeplay.summary/1`.
    text : str
        The same document as text, as the command printed it.
    folder : Path
        Folder with the recordings, histograms, `summary.json` and `report.html`.
    controllers : list of str
        Names of the controllers, in the order of their runs: built-in names, `Controller.name` of classes, file names of executables.
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
        """The results in numbers.

        Returns
        -------
        DataFrame, one row for each controller
            rms, max, tool deviation during the whole run, mm; rms_after_start, max_after_start, tool deviation after the first 0.5 s, mm (NaN
            for shorter runs); missed, ticks without an answer in time; rejected, commands that the gate rejected; state_hash, SHA-256 of all
            states and commands.
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
        """Reasons for failed runs, by controller: the run stopped the arm, or the arm exceeded a limit. Empty: no run failed."""
        found: dict[str, list[str]] = {}
        for name, each in zip(self.controllers, self.json["runs"]):
            words = [_in_words(item) for item in each.get("failures") or []]
            if words or each.get("stopped"):
                found[name] = words or [_in_words(each["stopped"])]
        return found

    @property
    def latencies(self) -> pd.DataFrame:
        """Latencies of each stage of the loop.

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
        """The latencies of a stage as an HdrHistogram in nanoseconds, from the `.hlog` file of the run.

        Parameters
        ----------
        stage : str
            A stage of `latencies`.
        controller : str, optional
            Name of the controller. Default: the first one.

        Raises
        ------
        KeyError
            The controller or the stage does not exist.
        NotInstalled
            The package `hdrhistogram` is missing: `pip install hdrhistogram`.
        """
        try:
            from hdrh.histogram import HdrHistogram
        except ImportError:
            raise NotInstalled("histograms need a package: pip install hdrhistogram") from None
        path = self.folder / f"{self._file(controller)}.hlog"
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith(f"Tag={stage},"):
                return HdrHistogram.decode(line.rsplit(",", 1)[1])
        raise KeyError(f"{path.name} has no stage {stage!r}")

    @property
    def recordings(self) -> dict[str, Recording]:
        """The recordings, by controller."""
        return {name: self.recording(name) for name in self.controllers}

    def recording(self, controller: str | None = None) -> Recording:
        """The recording of the run with `controller`. Default: the first controller."""
        name = self._file(controller)
        if name not in self._recordings:
            # The recording is in the run's folder, and keeps it alive.
            self._recordings[name] = Recording(self.folder / f"{name}.mcap", self._scratch)
        return self._recordings[name]

    def frame(self, controller: str | None = None) -> pd.DataFrame:
        """The recorded values of every tick. Default: the run with the first controller.

        Returns
        -------
        DataFrame, one row for each tick
            The columns of `Recording.to_frame`, `deviation_x` … (m), `command_1` … (N*m, or rad with the modes "driven" and "servo"), and
            others.
        """
        return self.recording(controller).to_frame()

    @property
    def frames(self) -> dict[str, pd.DataFrame]:
        """The recorded values of every tick, by controller."""
        return {name: self.frame(name) for name in self.controllers}

    def report(self, path: PathLike | None = None) -> Path:
        """Path of the report, one HTML file. With `path`: copies the report to `path` and returns that path."""
        report = self.folder / "report.html"
        return report if path is None else Path(shutil.copyfile(report, path))

    def _file(self, controller: str | None) -> str:
        """Base name of the files of `controller`."""
        names = self.controllers
        if controller is not None and controller not in names:
            raise KeyError(f"this run has no controller {controller!r}, only {', '.join(names)}")
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
