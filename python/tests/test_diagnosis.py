"""Comparisons and diagnoses equal those of the command, and convert to frames, charts and pages."""

from __future__ import annotations

import subprocess
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import freeplay
from freeplay import _command
from freeplay.diagnosis import Diagnosis


def command(*words: object) -> str:
    """Runs the command directly and returns its standard output."""
    done = subprocess.run([_command.executable(), *map(str, words)], capture_output=True, text=True, check=True)
    return done.stdout


def test_an_arm_tells_its_joints(tmp_path: Path) -> None:
    arm = freeplay.Arm.read("paper")
    assert arm.joint_names == [f"joint_{k}" for k in range(1, 7)]
    assert arm.joints.loc["joint_2", "kind"] == "revolute" and arm.joints.loc["joint_2", "effort"] == 4000.0
    assert arm.effects.empty and "6 joints" in repr(arm)
    (tmp_path / "broken.urdf").write_text("<robot name='r'><link name='a'></robot>")
    with pytest.raises(freeplay.BadInput, match="broken.urdf"):
        freeplay.Arm.read(tmp_path / "broken.urdf")


def test_a_comparison_is_that_of_the_command_to_the_byte(recording: freeplay.Recording) -> None:
    compared = freeplay.compare("paper", recording)
    assert compared.text == command("compare", "--model", "paper", "--recording", recording.path, "--format", "json")
    worst = compared.channels["nrmse_std"].idxmax()
    residuals = compared.residuals
    error = residuals[f"{worst}_measured"] - residuals[f"{worst}_model"]
    rmse = compared.channels.loc[worst, "rmse"]
    assert float(np.sqrt((error**2).mean())) == pytest.approx(rmse, rel=1e-9)
    assert compared.report().stat().st_size > 10_000


def test_a_diagnosis_is_that_of_the_command_to_the_byte(
    recording: freeplay.Recording, found: Diagnosis, told: list[str], tmp_path: Path
) -> None:
    words = ["diagnose", "--quiet", "--model", "paper", "--recording", recording.path, "--format", "json", "--out", tmp_path / "out"]
    assert found.text == command(*words)
    assert len(told) > 3, "progress arrives line by line"


def test_the_play_is_found_where_it_is(found: Diagnosis) -> None:
    assert found.verdict == "named" and found.setup.empty
    row = found.found.iloc[0]
    assert (row["what"], row["joint"], row["unit"]) == ("joint clearance", "joint_5", "m")
    low, high = row["interval"]
    assert low < row["value"] < high and row["value"] == pytest.approx(0.6e-3, rel=0.05)
    assert 0.0 < row["share"] <= 1.0
    assert set(found.alternatives.columns) >= {"what", "joint", "why_not", "indistinguishable"}
    errors = found.errors
    assert errors.loc["z", "with_findings"] < 0.1 * errors.loc["z", "as_given"]


def test_its_model_is_of_use_at_once(recording: freeplay.Recording, found: Diagnosis, tmp_path: Path) -> None:
    before = freeplay.compare("paper", recording).channels.loc["z", "rmse"]
    after = freeplay.compare(found.model, recording).channels.loc["z", "rmse"]
    assert after < 0.1 * before
    assert list(found.model.effects["kind"]) == ["joint_clearance"]
    assert freeplay.Arm.read(found.model.save(tmp_path / "model.toml")).joint_names == found.model.joint_names


def test_residuals_hold_both_models(found: Diagnosis) -> None:
    frame = found.residuals
    rms = {name: float(np.sqrt((frame[name] ** 2).mean())) for name in ("z_before", "z_after")}
    assert rms["z_after"] < 0.1 * rms["z_before"] and frame["t"].is_monotonic_increasing


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_pictures_are_drawn_in_both_themes(found: Diagnosis, theme: str) -> None:
    before = dict(mpl.rcParams)
    axes = [*found.plot_found(0, theme=theme), *found.plot_errors(theme=theme)]
    page = np.array(mpl.colors.to_rgb(axes[0].figure.get_facecolor()))
    assert (page.mean() > 0.5) == (theme == "light")
    assert all(ax.get_xlabel() for ax in axes) and dict(mpl.rcParams) == before
    with pytest.raises(IndexError):
        found.plot_found(9)
    with pytest.raises(ValueError, match="theme"):
        found.plot_errors(theme="sepia")


def test_a_notebook_shows_verdict_findings_and_errors(found: Diagnosis) -> None:
    page = found._repr_html_()
    for words in ("Found", "joint clearance", "joint_5", "as given", "95 %"):
        assert words in page


def test_fields_that_a_document_has_not_are_missing_and_no_error(found: Diagnosis, tmp_path: Path) -> None:
    text = '{"schema": "freeplay.diagnosis/1", "verdict": "nothing_missing", "effects": [], "fit": {"before": {"tau1": {"rmse": 1.0}}}}'
    bare = Diagnosis(text, tmp_path, "paper", [])
    assert bare.found.empty and bare.setup.empty and bare.alternatives.empty and bare.untestable.empty
    assert bare.errors.loc["tau1", "as_given"] == 1.0 and np.isnan(bare.errors.loc["tau1", "with_findings"])
    assert bare.model.joint_names == freeplay.Arm.read("paper").joint_names and "Nothing missing" in bare._repr_html_()
    share = '{"verdict": "named", "effects": [{"kind": "payload", "share": 0.7, "parameters": {"mass": {"value": 2.0, "unit": "kg"}}}]}'
    assert Diagnosis(share, tmp_path, "paper", []).found.loc[0, "share"] == 0.7


def test_setup_is_told(recording: freeplay.Recording) -> None:
    frame = recording.to_frame()[["t", *(f"q{k}" for k in range(1, 7)), *(f"tau{k}" for k in range(1, 7))]]
    frame[[f"tau{k}" for k in range(1, 7)]] *= 1e3  # as if in N·mm
    told = freeplay.Recording.from_frame(frame, joints=recording.joints).check("paper")
    assert len(told) and told["statement"].str.len().min() > 0 and set(told["certainty"]) <= {"sure", "likely"}
