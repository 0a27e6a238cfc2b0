"""Recordings convert to and from pandas frames without loss, and errors have the command's messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import freeplay


def test_a_frame_has_the_columns_and_units_of_the_recording(recording: freeplay.Recording) -> None:
    frame = recording.to_frame()
    assert len(frame) == len(recording) == 6000
    assert frame.attrs["joints"] == recording.joints == [f"joint_{k}" for k in range(1, 7)]
    assert frame.attrs["units"]["tau3"] == "N*m" and frame.attrs["units"]["x"] == "m"
    assert recording.rate == pytest.approx(1000.0) and recording.duration == pytest.approx(5.999)


def test_a_frame_comes_back_to_the_bit(recording: freeplay.Recording) -> None:
    frame = recording.to_frame()
    named = [column for column in frame if column in recording.to_frame().attrs["units"]]
    again = freeplay.Recording.from_frame(frame[named], joints=recording.joints)
    assert again.joints == recording.joints
    pd.testing.assert_frame_equal(again.to_frame()[named], frame[named], check_exact=True)


def test_units_names_and_an_index_of_times_are_understood(recording: freeplay.Recording) -> None:
    frame = recording.to_frame().iloc[::10]
    joints = recording.joints
    foreign = pd.DataFrame({f"q_{joint}": np.degrees(frame[f"q{k + 1}"]) for k, joint in enumerate(joints)})
    foreign.index = pd.to_datetime("2026-01-01") + pd.to_timedelta(frame["t"], unit="s")
    read = freeplay.Recording.from_frame(foreign, joints=joints, units={"q": "deg"})
    np.testing.assert_allclose(read.to_frame()["q2"], frame["q2"], atol=1e-12)
    np.testing.assert_allclose(read.to_frame()["t"], frame["t"] - frame["t"].iloc[0], atol=1e-8)


def test_what_was_not_measured_is_missing_there(recording: freeplay.Recording) -> None:
    frame = recording.to_frame()[["t", "q1", "q2", "tau1"]]
    frame.loc[100:200, "tau1"] = np.nan
    read = freeplay.Recording.from_frame(frame).to_frame()
    assert read["tau1"].isna().sum() == 101 and read["q2"].notna().all()


@pytest.mark.parametrize("ending", ["csv", "parquet", "mcap"])
def test_a_saved_recording_is_read_again(recording: freeplay.Recording, tmp_path: Path, ending: str) -> None:
    again = freeplay.Recording.read(recording.save(tmp_path / f"saved.{ending}"))
    pd.testing.assert_series_equal(again.to_frame()["q5"], recording.to_frame()["q5"], check_exact=True)
    with pytest.raises(freeplay.BadUsage, match="the file exists already"):
        recording.save(tmp_path / f"saved.{ending}")


def test_errors_have_the_words_and_the_code_of_the_command(tmp_path: Path) -> None:
    with pytest.raises(freeplay.BadInput, match="No such file") as raised:
        freeplay.Recording.read(tmp_path / "missing.csv")
    assert raised.value.code == 3 and raised.value.command[1:3] == ["record", "info"]
    with pytest.raises(freeplay.BadInput):
        freeplay.Recording.from_frame(pd.DataFrame({"t": [0.0, 0.1], "temperature": [1.0, 2.0]}))
    with pytest.raises(ValueError, match="no group of columns"):
        freeplay.Recording.from_frame(pd.DataFrame({"t": [0.0], "q1": [0.0]}), units={"torque": "N*m"})
