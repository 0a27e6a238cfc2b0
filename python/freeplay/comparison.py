"""Comparison of a model with a recording."""

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
    """Compares measured channels with those that the model predicts for the recorded motion.

    Parameters
    ----------
    arm : Arm or path
        The model.
    recording : Recording, path or DataFrame
        The recording.
    mapping : path, optional
        A mapping file for the recording, such as the `setup.toml` of a diagnosis.
    lowpass : float, optional
        Cutoff of the low-pass that both sides pass, Hz. Without it: 3 % of the recording's rate, 10 to 40 Hz.
    trim : float, optional
        Time left out at both ends, s.
    progress : callable or bool, optional
        Gets a line for each stage; True prints them on standard error.

    Returns
    -------
    Comparison

    Raises
    ------
    BadInput
        A file can't be read, the joints do not fit, or there is nothing to compare.
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
        The same, as the command printed it.
    notes : list of str
        Notes on the comparison, such as channels that were left out.
    """

    def __init__(self, text: str, scratch: Scratch, recording: object = None) -> None:
        self.text = text
        self.json: dict[str, Any] = json.loads(text)
        self.notes: list[str] = self.json.get("notes", [])
        # Keeps the folder of the recording, which the report names.
        self._scratch, self._recording, self._folder = scratch, recording, scratch / "compared"

    @property
    def channels(self) -> pd.DataFrame:
        """The error of each channel.

        Returns
        -------
        DataFrame, one row a channel, indexed by its name ("tau1", "x", …)
            unit; joint; rmse, rms_measured, mean_error, max_error in that unit; nrmse, the error as a share of the measured RMS; nrmse_std, as
            a share of the measured standard deviation; noise, the standard deviation of the channel's own noise, in its unit.
        """
        return pd.DataFrame(self.json["channels"]).set_index("name")

    @property
    def setup(self) -> pd.DataFrame:
        """Differences in convention between recording and model: kind, joint, value, unit, certainty, statement, remedy."""
        return setup_frame(self.json.get("setup", []))

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured against model over time, both after the same low-pass; unfiltered where positions are compared with commanded ones alone.

        Returns
        -------
        DataFrame, M rows
            t (s); stretch, the number of the stretch without gaps; for each channel NAME_measured and NAME_model in the channel's unit, NaN
            where it was not measured.
        """
        return pd.read_parquet(self._folder / "residuals.parquet")

    def report(self) -> Path:
        """The report, one HTML file with measured against model for every joint. It lives as long as this object."""
        return self._folder / "report.html"

    def __repr__(self) -> str:
        spread = self.channels["nrmse_std"].astype(float)
        worst = self.json.get("worst")
        if worst:
            return f"<Comparison of {len(spread)} channels: worst {worst}, off by {spread[worst]:.1%} of its spread>"
        return f"<Comparison of {len(spread)} channels>"

    def _repr_html_(self) -> str:
        shown = self.channels[["joint", "unit", "rms_measured", "rmse", "nrmse_std", "mean_error"]]
        named = shown.rename(columns={"rms_measured": "measured RMS", "rmse": "error RMS", "nrmse_std": "of spread", "mean_error": "mean error"})
        checks = [f"CHECK {statement}" for statement in self.setup["statement"]]
        return _html.page("Model against recording", "", [_html.bullets(checks), _html.table(named), _html.bullets(self.notes)])
