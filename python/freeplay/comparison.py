"""Comparison of a recording with the predictions of a model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from . import _html
from ._command import PathLike, Progress, call, options
from ._scratch import Portable, Scratch
from .arm import ArmLike, model_options
from .recording import RecordingLike, recording_of, setup_frame


def compare(
    arm: ArmLike,
    recording: RecordingLike,
    *,
    mapping: PathLike | None = None,
    lowpass: float | None = None,
    trim: float | None = None,
    progress: Progress = None,
) -> Comparison:
    """Compares a recording with the predictions of a model for the recorded motion.

    Parameters
    ----------
    arm : Arm or path
        The model.
    recording : Recording, path or DataFrame
        The recording.
    mapping : path, optional
        Mapping file that defines the meaning of the columns, such as the `setup.toml` of a diagnosis.
    lowpass : float, optional
        Cutoff frequency of the low-pass filter for both sides, Hz. Default: 3 % of the recording's sample rate, between 10 and 40 Hz, or less
        if the motion is noisy.
    trim : float, optional
        Time to leave out at both ends, s. Default: five periods of the cutoff frequency, at most an eighth of the recording.
    progress : callable or bool, optional
        Function that receives one line for each stage. True: print the lines on standard error.

    Returns
    -------
    Comparison

    Raises
    ------
    BadInput
        A file can't be read, recording and model have different joints, or they have no channel to compare.
    """
    model = model_options(arm)
    scratch = Scratch()
    recording = recording_of(recording)
    chosen = options(recording=recording.path, mapping=mapping, lowpass=lowpass, trim=trim, format="json", out=scratch.path / "compared")
    done = call(["compare", *model, *chosen], progress=progress)
    return Comparison(done.stdout, scratch, recording)


class Comparison(Portable):
    """The error of a model on a recording, channel by channel.

    Attributes
    ----------
    json : dict
        The document `freeplay.compare/1`.
    text : str
        The same document as text, as the command printed it.
    notes : list of str
        Notes on the comparison, such as omitted channels.
    """

    def __init__(self, text: str, scratch: Scratch, recording: object = None) -> None:
        self.text = text
        self.json: dict[str, Any] = json.loads(text)
        self.notes: list[str] = self.json.get("notes", [])
        # Keeps the recording's folder alive, whose path the report contains.
        self._scratch, self._recording, self._folder = scratch, recording, scratch / "compared"

    @property
    def channels(self) -> pd.DataFrame:
        """The error of each channel.

        Returns
        -------
        DataFrame, one row for each channel, indexed by its name ("tau1", "x", …)
            unit; joint; rmse, rms_measured, mean_error, max_error, in that unit; nrmse, rmse divided by the RMS of the measured values;
            nrmse_std, rmse divided by their standard deviation; noise, standard deviation of the channel's noise, in that unit.
        """
        return pd.DataFrame(self.json["channels"]).set_index("name")

    @property
    def setup(self) -> pd.DataFrame:
        """Differences between the conventions of recording and model: kind, joint, value, unit, certainty, statement, remedy."""
        return setup_frame(self.json.get("setup", []))

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured and predicted values over time, after the low-pass filter. Positions that were simulated from commanded ones have no filter.

        Returns
        -------
        DataFrame
            t (s); stretch, number of the stretch without gaps; for each channel NAME_measured and NAME_model in the channel's unit, NaN where
            the recording has no value.
        """
        return pd.read_parquet(self._folder / "residuals.parquet")

    def report(self) -> Path:
        """Path of the report, one HTML file with measured and predicted values of every joint. The file is removed with this object."""
        return self._folder / "report.html"

    def __repr__(self) -> str:
        spread = self.channels["nrmse_std"].astype(float)
        worst = self.json.get("worst")
        if worst:
            return f"<Comparison of {len(spread)} channels: worst {worst}, error {spread[worst]:.1%} of its standard deviation>"
        return f"<Comparison of {len(spread)} channels>"

    def _repr_html_(self) -> str:
        shown = self.channels[["joint", "unit", "rms_measured", "rmse", "nrmse_std", "mean_error"]]
        named = shown.rename(columns={"rms_measured": "measured RMS", "rmse": "error RMS", "nrmse_std": "of standard deviation", "mean_error": "mean error"})
        checks = [f"CHECK {statement}" for statement in self.setup["statement"]]
        return _html.page("Model against recording", "", [_html.bullets(checks), _html.table(named), _html.bullets(self.notes)])
