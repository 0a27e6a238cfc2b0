"""Typical use in notebooks: various frames, wrong names, copies, pickles, threads, Ctrl-C."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import freeplay
from freeplay import _command

WORN = Path(__file__).resolve().parent.parent / "notebooks" / "worn-bearing.csv"
JOINTS = [f"joint_{k}" for k in range(1, 7)]
POSITIONS = [f"q{k}" for k in range(1, 7)]


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    return pd.read_csv(WORN, usecols=["t", *POSITIONS, *(f"tau{k}" for k in range(1, 7)), "x", "y", "z"])


def dated(frame: pd.DataFrame, zone: str | None = None) -> pd.DatetimeIndex:
    return pd.date_range("2026-01-01", periods=len(frame), freq="4ms", tz=zone)


@pytest.mark.parametrize(
    "made",
    [
        lambda f: f.drop(columns="t").set_axis(dated(f)),
        lambda f: f.drop(columns="t").set_axis(dated(f, "Europe/Berlin")),
        lambda f: f.drop(columns="t").assign(time=dated(f)),
        lambda f: f.drop(columns="t").assign(timestamp=dated(f) - dated(f)[0]),
        lambda f: f.rename(columns={"t": "timestamp"}),
        lambda f: f.set_index("t").rename_axis(None),
        lambda f: f.rename(columns=dict(zip(POSITIONS, JOINTS))),
        lambda f: pd.concat({"q": f[POSITIONS].set_axis(JOINTS, axis=1)}, axis=1).set_axis(pd.Index(f["t"], name="time")),
    ],
    ids=["dates", "dates of a zone", "a column of dates", "a column of spans", "timestamp", "index", "names of joints", "two levels"],
)
def test_times_and_names_as_frames_have_them(frame: pd.DataFrame, made: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    read = freeplay.Recording.from_frame(made(frame), joints=JOINTS)
    assert read.joints == JOINTS and read.duration == pytest.approx(5.996) and read.rate == pytest.approx(250.0)
    np.testing.assert_array_equal(read.to_frame()["q5"], frame["q5"])


def test_what_is_wrong_with_a_frame_is_said_of_the_frame(frame: pd.DataFrame) -> None:
    for bad, joints, words in [
        (frame.drop(columns="t"), JOINTS, "no time: give a column t"),
        (frame[["t", "x"]], JOINTS, "no positions: give columns q1"),
        (frame[["t", "x"]], None, "no positions: give columns q1"),
        (frame, JOINTS[:2], "2 names of joints .*has q3"),
        (frame.rename(columns=dict(zip(POSITIONS, JOINTS))), [*JOINTS[:5], "wrist"], "no position of joint wrist: looked for q_wrist"),
    ]:
        with pytest.raises(freeplay.BadInput, match=words):
            freeplay.Recording.from_frame(bad, joints=joints)


def test_wrong_arguments_are_told_before_anything_runs(frame: pd.DataFrame) -> None:
    with pytest.raises(freeplay.BadUsage, match="no recording"):
        freeplay.diagnose("paper", [])
    with pytest.raises(TypeError, match="not ndarray"):
        freeplay.diagnose("paper", [frame.to_numpy()])  # type: ignore[list-item]
    with pytest.raises(TypeError, match="the model comes before the recording"):
        freeplay.compare(freeplay.Recording.read(WORN), "paper")  # type: ignore[arg-type]
    assert freeplay.Recording.read(WORN, joints="joint_1,joint_2").joints == JOINTS[:2]


def test_an_arm_without_masses_says_what_it_is_good_for(frame: pd.DataFrame, tmp_path: Path) -> None:
    link = '<link name="{}"/>'
    joint = '<joint name="j1" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="2"/></joint>'
    (tmp_path / "bare.urdf").write_text(f'<robot name="bare">{link.format("a")}{link.format("b")}{joint}</robot>')
    arm = freeplay.Arm.read(tmp_path / "bare.urdf")
    assert any("torques and simulations need masses" in note for note in arm.notes)
    with pytest.raises(freeplay.BadInput, match="need masses"):
        freeplay.diagnose(arm, freeplay.Recording.from_frame(frame[["t", "q1", "tau1"]], joints=["j1"]))


@pytest.mark.parametrize("copied", [lambda held: pickle.loads(pickle.dumps(held)), copy.deepcopy, copy.copy], ids=["pickle", "deepcopy", "copy"])
def test_copies_outlive_what_they_are_of(frame: pd.DataFrame, copied: Callable[[Any], Any]) -> None:
    recording = freeplay.Recording.from_frame(frame, joints=JOINTS)
    compared = freeplay.compare("paper", recording)
    wanted = [repr(recording), repr(compared), compared.residuals.shape]
    recording, compared = copied(recording), copied(compared)
    assert [repr(recording), repr(compared), compared.residuals.shape] == wanted
    assert recording.to_frame().shape[0] == len(recording) and compared.report().is_file()


def test_a_diagnosis_is_pickled_with_its_report_and_its_model(found: freeplay.Diagnosis) -> None:
    again = pickle.loads(pickle.dumps(found))
    assert again.report() != found.report() and again.report().read_bytes() == found.report().read_bytes()
    assert list(again.model.effects["kind"]) == list(found.model.effects["kind"])
    pd.testing.assert_frame_equal(again.residuals, found.residuals)


def test_two_at_once_in_threads_say_the_same() -> None:
    told: list[str] = []
    threads = [threading.Thread(target=lambda: told.append(freeplay.compare("paper", WORN).text)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(told) == 2 and told[0] == told[1]


def interrupted(script: str, ready: Path, tmp_path: Path) -> str:
    """Interrupts a Python process, like Ctrl-C in a notebook, as soon as `ready` exists. Returns its standard error."""
    environment = {**os.environ, "FREEPLAY_EXECUTABLE": str(tmp_path / "freeplay")}
    # A background job ignores SIGINT, and its child processes inherit this.
    process = subprocess.Popen(
        [sys.executable, "-c", script], env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    while not ready.exists() and process.poll() is None:
        threading.Event().wait(0.02)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=120)[1]
    assert process.returncode != 0
    return said


def waiting(tmp_path: Path, command: str) -> Path:
    """Writes an executable that hangs in `command`. It creates the file `begun`, and `ended` when a signal ends it. Returns the path of `begun`."""
    script = tmp_path / "freeplay"
    hang = f'trap "touch {tmp_path}/ended; exit 130" INT TERM; touch {tmp_path}/begun; while :; do sleep 0.1; done'
    script.write_text(f'#!/bin/sh\n[ "$1" = {command} ] || exec {_command.executable()} "$@"\n{hang}\n')
    script.chmod(0o700)
    return tmp_path / "begun"


def test_ctrl_c_ends_the_command(tmp_path: Path) -> None:
    said = interrupted("import freeplay; freeplay.compare('paper', " + repr(str(WORN)) + ")", waiting(tmp_path, "compare"), tmp_path)
    assert "KeyboardInterrupt" in said and (tmp_path / "ended").exists()
