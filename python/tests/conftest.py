"""Common fixtures of the tests: a machine with a worn bearing, simulated and diagnosed once."""

from __future__ import annotations

import os
from collections.abc import Iterator

import matplotlib as mpl
import pytest

import freeplay

mpl.use("Agg")

#: Joint 5 has 0.6 mm of play, which the model lacks.
WORN = {
    "path": {"kind": "lissajous", "period": 6.0},
    "patience": 60.0,
    "clearance": {"joint_5": {"clearance": 0.6e-3}},
    "sensors": {"torque": {"noise": 0.05}, "tool": {"noise": 1e-5}},
}


def pytest_configure() -> None:
    # Child processes of the tests import this package.
    os.environ.setdefault("PYTHONPATH", os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


@pytest.fixture(scope="session")
def machine() -> Iterator[freeplay.Run]:
    """One simulated lap of the machine."""
    yield freeplay.run(WORN, controllers=["computed-torque"])


@pytest.fixture(scope="session")
def recording(machine: freeplay.Run) -> freeplay.Recording:
    return machine.recording()


@pytest.fixture(scope="session")
def told() -> list[str]:
    """The progress lines of the diagnosis."""
    return []


@pytest.fixture(scope="session")
def found(recording: freeplay.Recording, told: list[str]) -> freeplay.Diagnosis:
    """The diagnosis of the recording with the rigid model."""
    return freeplay.diagnose("paper", recording, progress=told.append)
