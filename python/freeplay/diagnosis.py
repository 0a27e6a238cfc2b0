"""Diagnosis of recordings: finds the physics that a model lacks."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from . import _diagnosis_html
from ._command import PathLike, Progress, call, options
from ._scratch import Portable, Scratch
from .arm import Arm, ArmLike, model_options
from .comparison import compare
from .errors import BadUsage
from .recording import Recording, RecordingLike, recording_of, setup_frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Columns of `Diagnosis.errors`, each with its key in the table `fit` of the document.
ERRORS = {
    "noise_floor": "noise_floor",
    "as_given": "before",
    "retuned": "retuned",
    "with_findings": "after",
    "black_box": "black_box",
}


def diagnose(
    arm: ArmLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    *,
    mapping: PathLike | None = None,
    seed: int | None = None,
    lowpass: float | None = None,
    mass_tolerance: float | None = None,
    friction_tolerance: float | None = None,
    zero_tolerance: float | None = None,
    length_tolerance: float | None = None,
    delay_tolerance: float | None = None,
    out: PathLike | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Diagnosis:
    """Finds where a model and recordings differ, names the missing physics, and writes a better model.

    The search uses the first 70 % of each recording. No law is fitted to the last 30 %: the errors and gains come from there. With commanded
    positions instead of torques, the last of several recordings takes the place of that part.

    Parameters
    ----------
    arm : Arm or path
        The model to complete.
    recordings : Recording, path or DataFrame, or a list of them
        Recordings of one machine with the same columns.
    mapping : path, optional
        Mapping file that defines the meaning of the columns, such as the `setup.toml` of a diagnosis.
    seed : int, optional
        Seed of all random numbers. Default: 1.
    lowpass : float, optional
        Cutoff frequency of the low-pass filter, Hz. Default: 3 % of the recording's sample rate, between 10 and 40 Hz, or less if the motion
        is noisy.
    mass_tolerance, friction_tolerance : float, optional
        Tolerance of masses and inertias, and tolerance of the friction in the model, %.
    zero_tolerance : float, optional
        Tolerance of encoder zeros, mrad (mm for a prismatic joint).
    length_tolerance : float, optional
        Tolerance of lengths, mm.
    delay_tolerance : float, optional
        Tolerance of delays between channels, ms.
    out : path, optional
        Folder for `diagnosis.json`, `report.html` and `model.toml`. Default: a temporary folder, which is removed together with the returned
        object.
    force : bool
        True: replace results of an earlier command in `out`.
    progress : callable or bool, optional
        Function that receives one line for each stage. True: print the lines on standard error.

    Returns
    -------
    Diagnosis

    Raises
    ------
    BadInput
        A file can't be read, model and recordings have different joints, or they have no channel to compare.

    Examples
    --------
    >>> found = diagnose("arm.urdf", ["run.csv"])  # doctest: +SKIP
    >>> found.verdict  # doctest: +SKIP
    'named'
    """
    if isinstance(recordings, (str, os.PathLike, Recording, pd.DataFrame)):
        recordings = [recordings]
    model = model_options(arm)
    read = [recording_of(each) for each in recordings]
    if not read:
        raise BadUsage("no recording: give one or more recordings of the same machine")
    scratch = Scratch()
    folder = scratch.path / "found" if out is None else Path(out)
    chosen = options(
        mapping=mapping, seed=seed, lowpass=lowpass, mass_tolerance=mass_tolerance, friction_tolerance=friction_tolerance,
        zero_tolerance=zero_tolerance, length_tolerance=length_tolerance, delay_tolerance=delay_tolerance, format="json", out=folder,
        force=force,
    )  # fmt: skip
    files = [word for recording in read for word in ("--recording", str(recording.path))]
    done = call(["diagnose", *model, *files, *chosen], progress=progress)
    return Diagnosis(done.stdout, folder, arm, read, mapping, scratch)


class Diagnosis(Portable):
    """Results of a diagnosis: the missing physics with intervals, and the errors of the model with and without it.

    Attributes
    ----------
    json : dict
        The document `freeplay.diagnosis/1`.
    text : str
        The same document as text, as the command printed it.
    verdict : str
        "named", "one_of", "unknown", "nothing_missing", "insufficient_data" or "setup".
    statement : str
        The finding in one sentence.
    notes : list of str
        Notes on the quality of the recordings and on omitted data.
    recordings : list of Recording
        The diagnosed recordings.
    """

    def __init__(
        self,
        text: str,
        folder: Path,
        arm: ArmLike,
        recordings: Sequence[Recording],
        mapping: PathLike | None = None,
        scratch: Scratch | None = None,
    ) -> None:
        self.text = text
        self.json: dict[str, Any] = json.loads(text)
        self.verdict: str = self.json["verdict"]
        self.statement: str = self.json.get("statement", "")
        self.notes: list[str] = self.json.get("quality", [])
        self.recordings = list(recordings)
        self._folder, self._arm, self._mapping, self._scratch = folder, arm, mapping, scratch
        self._residuals: pd.DataFrame | None = None

    @property
    def setup(self) -> pd.DataFrame:
        """Differences between the conventions of recordings and model: units, signs, order, zeros, gravity, clocks.

        Returns
        -------
        DataFrame
            kind, joint, value, unit, certainty ("sure" or "likely"), statement, remedy. Empty if the conventions agree.
        """
        return setup_frame(self.json.get("setup", []))

    @property
    def found(self) -> pd.DataFrame:
        """The effects that the model lacks.

        Returns
        -------
        DataFrame, one row for each parameter, indexed by the number of the finding (the `i` of `plot_found`)
            what, kind of effect; joint (None for the whole arm); parameter; value; interval, a pair (95 %); unit (SI); share, part of the
            held-out error that the finding removes, 0 to 1 (NaN: unknown).
        """
        rows = []
        for number, effect in enumerate(self.json.get("effects", [])):
            for name, parameter in (effect.get("parameters") or {}).items():
                interval = parameter.get("ci95")
                rows.append(
                    {
                        "finding": number,
                        "what": _in_words(effect["kind"]),
                        "joint": effect.get("joint"),
                        "parameter": name,
                        "value": parameter.get("value"),
                        "interval": tuple(interval) if interval else None,
                        "unit": parameter.get("unit", ""),
                        "share": _share(effect),
                    }
                )
        names = ["finding", "what", "joint", "parameter", "value", "interval", "unit", "share"]
        return pd.DataFrame(rows, columns=names).set_index("finding")

    @property
    def alternatives(self) -> pd.DataFrame:
        """Alternatives: effects that the diagnosis tried in place of a finding.

        Returns
        -------
        DataFrame
            what; joint; instead_of, the finding; why_not; indistinguishable, True if the recordings can't distinguish the two;
            what_would_separate, a motion or measurement that would distinguish them.
        """
        rows = [
            {
                "what": _in_words(other["kind"]),
                "joint": other.get("joint"),
                "instead_of": _in_words(other.get("instead_of") or ""),
                "why_not": other.get("why_not", ""),
                "indistinguishable": bool(other.get("indistinguishable", False)),
                "what_would_separate": other.get("what_would_separate"),
            }
            for other in self.json.get("alternatives", [])
        ]
        names = ["what", "joint", "instead_of", "why_not", "indistinguishable", "what_would_separate"]
        return pd.DataFrame(rows, columns=names)

    @property
    def errors(self) -> pd.DataFrame:
        """The errors of each channel on held-out data, to which no law is fitted.

        Returns
        -------
        DataFrame, indexed by channel ("tau1", "x", …)
            unit; RMS errors in that unit: noise_floor (the error of the instruments alone), as_given (the given model), retuned (the given model with masses,
            lengths, frictions, zeros and delays tuned within their tolerances), with_findings (the written model: tuned, with the findings),
            black_box (tuned, with splines in place of the findings). NaN: not in the document.
        """
        fit = self.json.get("fit") or {}
        parts = {column: fit.get(key) or {} for column, key in ERRORS.items()}
        channels = list(dict.fromkeys(channel for part in parts.values() for channel in part))
        units = fit.get("units", {})
        rows = [
            {"unit": units.get(channel, _unit(channel)), **{c: (p.get(channel) or {}).get("rmse") for c, p in parts.items()}}
            for channel in channels
        ]
        frame = pd.DataFrame(rows, index=pd.Index(channels, name="channel"), columns=["unit", *ERRORS])
        return frame.astype({column: float for column in ERRORS})

    @property
    def residuals(self) -> pd.DataFrame:
        """Errors over time (measured minus predicted) of the given model and of the model with the findings.

        Returns
        -------
        DataFrame
            recording (number); t (s); for each channel, in its unit: NAME_measured, the measured value, and NAME_before and NAME_after, the
            errors of the two models. The first call runs two comparisons for each recording.
        """
        if self._residuals is None:
            frames = [self._residuals_of(number) for number in range(len(self.recordings))]
            self._residuals = pd.concat(frames, ignore_index=True)
        return self._residuals.copy()

    @property
    def untestable(self) -> pd.DataFrame:
        """Effects that the recorded motions do not excite, so that the diagnosis cannot test them: kind, joint, because (the reason)."""
        return pd.DataFrame(self.json.get("untestable", []), columns=["kind", "joint", "because"])

    @property
    def model(self) -> Arm:
        """The model with the findings, and with parameters tuned within their tolerances. `compare`, `diagnose` and `run` accept it."""
        path = self._folder / (self.json.get("model") or "model.toml")
        if not path.is_file():
            return self._arm if isinstance(self._arm, Arm) else Arm.read(self._arm)
        return Arm._read(path.absolute(), None, self._scratch)

    @property
    def mapping(self) -> Path | None:
        """Path of the mapping file with the conventions that the diagnosis found. None if the recordings need no correction."""
        path = self._folder / "setup.toml"
        return path if path.is_file() else None

    def report(self, path: PathLike | None = None) -> Path:
        """Path of the report, one HTML file, or of a copy.

        Parameters
        ----------
        path : path, optional
            Path for a copy. Default: no copy. Unless `diagnose` had the argument `out`, the report itself is removed with this object.
        """
        report = self._folder / (self.json.get("report") or "report.html")
        return report if path is None else Path(shutil.copyfile(report, path))

    def save(self, folder: PathLike) -> Path:
        """Copies `diagnosis.json`, `report.html`, `model.toml` and all other results to the new folder `folder`, and returns its path."""
        return Path(shutil.copytree(self._folder, folder))

    def plot_found(self, i: int = 0, *, theme: str = "auto") -> list[Axes]:
        """Draws the finding with the number `i`.

        Left: the error over time, of the given model and of the model with the findings. Right: the error of the given model, tuned within its
        tolerances, over the variable that explains most of it.

        Parameters
        ----------
        i : int
            Number of the finding, the index of `found`.
        theme : {"auto", "light", "dark"}
            Colours. "auto" follows matplotlib's style.

        Returns
        -------
        list of Axes

        Raises
        ------
        IndexError
            No finding has this number.
        """
        from . import plots

        return plots.found(self, i, theme)

    def plot_errors(self, *, theme: str = "auto") -> list[Axes]:
        """Draws the error of each channel, of the given model and with the findings, beside the noise floor.

        Parameters
        ----------
        theme : {"auto", "light", "dark"}
            Colours. "auto" follows matplotlib's style.

        Returns
        -------
        list of Axes
            One plot for each unit.
        """
        from . import plots

        return plots.errors(self, theme)

    def _residuals_of(self, number: int) -> pd.DataFrame:
        recording, mapping = self.recordings[number], self.mapping or self._mapping
        before = compare(self._arm, recording, mapping=mapping).residuals
        after = compare(self.model, recording, mapping=mapping).residuals
        frame = pd.DataFrame({"recording": number, "t": before["t"]})
        later = after.set_index("t")
        for column in before.columns:
            if not column.endswith("_measured"):
                continue
            channel = column.removesuffix("_measured")
            frame[column] = before[column]
            frame[f"{channel}_before"] = before[column] - before[f"{channel}_model"]
            if column in after:
                error = later[column] - later[f"{channel}_model"]
                frame[f"{channel}_after"] = error.reindex(before["t"]).to_numpy()
        return frame

    def __repr__(self) -> str:
        return f"<Diagnosis {self.verdict}: {self.statement}>"

    def _repr_html_(self) -> str:
        return _diagnosis_html.card(self)


def _in_words(kind: str) -> str:
    return kind.replace("_", " ")


def _unit(channel: str) -> str:
    return "N*m" if channel.startswith("tau") else "m" if channel in ("x", "y", "z") else "rad"


def _share(effect: Mapping[str, Any]) -> float:
    """The share of the held-out error that `effect` removes, from the field of the effect or of its evidence. NaN without such a field."""
    evidence = effect.get("evidence") or {}
    for holder in (effect, evidence):
        for name in ("share", "share_of_error", "error_share", "held_out_gain"):
            found = holder.get(name)
            value = found.get("value") if isinstance(found, Mapping) else found
            if isinstance(value, (int, float)):
                return float(value)
    return float("nan")
