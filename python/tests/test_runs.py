"""Runs, Python controllers as classes and objects, and fault tests."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import freeplay
from freeplay import _toml

#: The patience is long, because a busy machine starts an interpreter slowly.
SHORT = {"mode": "driven", "duration": 0.3, "patience": 60.0, "path": {"kind": "lissajous", "period": 6.0}}


class Follower(freeplay.Controller):
    """Answers with the reference."""

    name = "follower"

    def start(self, task: dict[str, Any], run: Any) -> None:
        self.n = run.joints

    def answer(self, state: freeplay.State) -> freeplay.Answer:
        wanted = state.reference_next
        return freeplay.Answer(wanted.q[: self.n], wanted.qd[: self.n], wanted.qdd[: self.n])


def test_a_class_runs_as_a_built_in_controller_does() -> None:
    done = freeplay.run(SHORT, controllers=[Follower, "computed-torque"])
    assert done.controllers == ["follower", "computed-torque"] and not done.failures
    assert done.table["state_hash"].nunique() == 1, "both answer with the reference, so the runs are identical"
    assert len(done.frames["follower"]) == 300 and done.frame()["q1"].notna().all()
    assert ("follower", "round_trip") in done.latencies.index
    assert done.report().is_file() and "follower" in done._repr_html_()


def test_an_object_keeps_what_it_holds_and_two_of_a_name_are_told_apart() -> None:
    class Scaled(Follower):
        def __init__(self, factor: float) -> None:
            self.factor = factor

        def answer(self, state: freeplay.State) -> freeplay.Answer:
            answer = super().answer(state)
            answer.deviation = (self.factor, 0.0, 0.0)
            return answer

    done = freeplay.run(SHORT, controllers=[Scaled(0.001), Scaled(0.002)])
    assert done.controllers == ["follower", "follower-2"]
    assert [done.frame(name)["predicted_x"].iloc[-1] for name in done.controllers] == [0.001, 0.002]


def test_latencies_are_hdr_histograms() -> None:
    pytest.importorskip("hdrh.histogram")
    done = freeplay.run(SHORT, controllers=["computed-torque"])
    histogram = done.histogram("round_trip")
    told = done.latencies.loc[("computed-torque", "round_trip")]
    assert histogram.get_total_count() == told["count"] == 300
    assert histogram.get_value_at_percentile(50) * 1e-3 == pytest.approx(told["p50"], rel=0.01)
    with pytest.raises(KeyError):
        done.histogram("no_such_stage")


def test_a_script_runs_by_the_interpreter_of_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment of a notebook may not be activated, so that its folder is not on the PATH."""
    script = tmp_path / "mine"
    answer = "def answer(self, state):\n        return freeplay.Answer(state.reference_next.q[:6], state.reference_next.qd[:6], state.reference_next.qdd[:6])"
    lines = ["#!/usr/bin/env python3", "import sys, freeplay", f"assert sys.prefix == {sys.prefix!r}, sys.prefix", "class Mine(freeplay.Controller):"]
    script.write_text("\n".join([*lines, "    name = 'mine'", f"    {answer}", "freeplay.serve(Mine())", ""]))
    script.chmod(0o700)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    assert freeplay.run(SHORT, controllers=[script]).controllers == ["mine"]


def test_a_plant_that_ends_says_why(tmp_path: Path) -> None:
    script = tmp_path / "mine"
    script.write_text("#!/bin/sh\necho 'mine: no licence' >&2; exit 3\n")
    script.chmod(0o700)
    with pytest.raises(freeplay.FreeplayError, match="no licence"):
        freeplay.examine(script, kinds=["nan"], seeds=1, set=SHORT)


def test_a_controller_that_raises_says_why() -> None:
    class Broken(Follower):
        name = "broken"

        def answer(self, state: freeplay.State) -> freeplay.Answer:
            raise RuntimeError("the gripper is upside down")

    with pytest.raises(freeplay.FreeplayError, match="upside down"):
        freeplay.run(SHORT, controllers=[Broken])


def test_a_wrong_key_has_the_words_of_the_command() -> None:
    with pytest.raises(freeplay.BadUsage, match="unknown field `perid`"):
        freeplay.run({"path": {"perid": 3.0}})
    with pytest.raises(freeplay.BadUsage, match="no controller"):
        freeplay.run(SHORT, controllers=[42])  # type: ignore[list-item]


def test_a_scenario_file_and_changes_to_it(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('mode = "driven"\nduration = 5.0\n')
    done = freeplay.run(tmp_path / "s.toml", controllers="computed-torque", set={"duration": 0.1, "path.period": 6.0}, out=tmp_path / "out")
    assert len(done.frame()) == 100 and (tmp_path / "out/summary.json").is_file()


def test_the_exam_judges_a_class() -> None:
    exam = freeplay.examine(Follower, kinds=["nan"], seeds=1, set={**SHORT, "duration": 0.6})
    assert list(exam.verdicts.index) == ["nan"] and exam.report().is_file()
    assert exam.verdicts.loc["nan", "bad_applied"] == 0


def test_values_as_toml() -> None:
    table = {"a": {"b": [1.0, 2], "c": True}, "t": [{"tick": 3, "to": "x y"}], "path.period": 6.0, "odd key": "é\n"}
    assert dict(_toml.leaves(table)) == {
        "a.b": "[1.0, 2]",
        "a.c": "true",
        "t": '[{ tick = 3, to = "x y" }]',
        "path.period": "6.0",
        '"odd key"': '"é\\n"',
    }
    with pytest.raises(TypeError):
        _toml.value(object())
