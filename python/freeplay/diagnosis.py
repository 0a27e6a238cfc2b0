"""Diagnosis of recordings: the physics that a model lacks."""

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

# Columns of `Diagnosis.errors`, and the key of `fit` that each is from.
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
    """Finds the physics that a model of a machine lacks, from recordings of the machine.

    Parameters
    ----------
    arm : Arm or path
        The model to complete.
    recordings : Recording, path or DataFrame, or a list of them
        Recordings of one machine with the same columns. The last 30 % of each are the test part.
    mapping : path, optional
        A mapping file for the recordings.
    seed : int, optional
        Seed of everything that is drawn; 1 without it.
    lowpass : float, optional
        Cutoff of the low-pass, Hz.
    mass_tolerance, friction_tolerance : float, optional
        Tolerances of masses with inertias, and of the friction that the model names, %.
    zero_tolerance : float, optional
        Tolerance of encoder zeros, mrad (mm for a slide).
    length_tolerance : float, optional
        Tolerance of lengths, mm.
    delay_tolerance : float, optional
        Tolerance of delays between channels, ms.
    out : path, optional
        Folder for `diagnosis.json`, `report.html` and `model.toml`. Without it they live as long as the result.
    force : bool
        Whether results of an earlier call in `out` are replaced.
    progress : callable or bool, optional
        Gets a line for each stage; True prints them on standard error.

    Returns
    -------
    Diagnosis

    Raises
    ------
    BadInput
        A file can't be read, the joints do not match, or no channel can be compared.

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
        raise BadUsage("no recording: give one or more of the same machine")
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
    """The physics that a model lacks, with intervals, and the error of the model without and with it.

    Attributes
    ----------
    json : dict
        The document `freeplay.diagnosis/1`.
    text : str
        The same, as the command printed it.
    verdict : str
        "named", "one_of", "unknown", "nothing_missing", "insufficient_data" or "setup".
    statement : str
        The finding in one sentence.
    notes : list of str
        Notes on the quality of the recordings, and on data that was left out.
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
        """Differences in convention between recordings and model: units, signs, order, zeros, gravity, clocks.

        Returns
        -------
        DataFrame
            kind, joint, value, unit, certainty ("sure" or "likely"), statement, remedy. Empty where both agree.
        """
        return setup_frame(self.json.get("setup", []))

    @property
    def found(self) -> pd.DataFrame:
        """The effects that the model lacks.

        Returns
        -------
        DataFrame, one row a parameter, indexed by the number of the finding (the `i` of `plot_found`)
            what, the kind of effect; joint (None for the whole arm); parameter; value and interval (95 %, a pair) in unit (SI); share of the
            error on held-out data that the finding removes, 0 to 1; NaN: unknown.
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
        """Other effects that were tried in place of a finding.

        Returns
        -------
        DataFrame
            what, joint, instead_of, why_not, indistinguishable (True: this recording can't tell them apart), what_would_separate.
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
        """The error of each channel on held-out data, which no step of the search has seen.

        Returns
        -------
        DataFrame, indexed by channel ("tau1", "x", …)
            unit; RMS errors in that unit: noise_floor (what the instruments alone leave), as_given (the model as it is), retuned (its masses,
            lengths, frictions, zeros and delays moved inside their tolerances), with_findings (re-tuned, with the findings: the model that is
            written), black_box (re-tuned, with splines in the place of the findings). NaN: not in the document.
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
        """Measured minus model over time, by the model as given and by the one with the findings.

        Returns
        -------
        DataFrame
            recording (its number), t (s), and for each channel NAME_measured, NAME_before and NAME_after in the channel's unit: the measured
            value and the two errors. The first call computes them by two comparisons a recording.
        """
        if self._residuals is None:
            frames = [self._residuals_of(number) for number in range(len(self.recordings))]
            self._residuals = pd.concat(frames, ignore_index=True)
        return self._residuals.copy()

    @property
    def untestable(self) -> pd.DataFrame:
        """Effects that these motions do not excite: kind, joint, because."""
        return pd.DataFrame(self.json.get("untestable", []), columns=["kind", "joint", "because"])

    @property
    def model(self) -> Arm:
        """The model with the found effects and with parameters tuned inside their tolerances. `compare`, `diagnose` and `run` take it."""
        path = self._folder / (self.json.get("model") or "model.toml")
        if not path.is_file():
            return self._arm if isinstance(self._arm, Arm) else Arm.read(self._arm)
        return Arm._read(path.absolute(), None, self._scratch)

    @property
    def mapping(self) -> Path | None:
        """The mapping file with the conventions that the diagnosis found; None where the recordings needed no change."""
        path = self._folder / "setup.toml"
        return path if path.is_file() else None

    def report(self, path: PathLike | None = None) -> Path:
        """The report with its charts, one HTML file.

        Parameters
        ----------
        path : path, optional
            Place of a copy. Without it the file lives as long as this object, or in the folder that was given as `out`.
        """
        report = self._folder / (self.json.get("report") or "report.html")
        return report if path is None else Path(shutil.copyfile(report, path))

    def save(self, folder: PathLike) -> Path:
        """Copies `diagnosis.json`, `report.html`, `model.toml` and all other results into the new folder `folder`."""
        return Path(shutil.copytree(self._folder, folder))

    def plot_found(self, i: int = 0, *, theme: str = "auto") -> list[Axes]:
        """Draws finding number `i`.

        Left: the error over time, as given and with the findings. Right: the error of the model that was only tuned inside its tolerances, over
        the variable that shows it best.

        Parameters
        ----------
        i : int
            Number of the finding, the index of `found`.
        theme : {"auto", "light", "dark"}
            Colours; "auto" follows matplotlib's style.

        Returns
        -------
        list of Axes

        Raises
        ------
        IndexError
            There is no such finding.
        """
        from . import plots

        return plots.found(self, i, theme)

    def plot_errors(self, *, theme: str = "auto") -> list[Axes]:
        """Draws the error of each channel as given and with the findings, beside the noise.

        Parameters
        ----------
        theme : {"auto", "light", "dark"}
            Colours; "auto" follows matplotlib's style.

        Returns
        -------
        list of Axes
            One for each unit.
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
    """The share of the held-out error that `effect` takes away: a field of its own where the document has one."""
    evidence = effect.get("evidence") or {}
    for holder in (effect, evidence):
        for name in ("share", "share_of_error", "error_share", "held_out_gain"):
            found = holder.get(name)
            value = found.get("value") if isinstance(found, Mapping) else found
            if isinstance(value, (int, float)):
                return float(value)
    return float("nan")
