"""Input of every method in the comparison: the data sheet, and filtered signals of the training part and of the held-out part."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "mujoco"))

from arms import Arm, Joint, Link  # noqa: E402
from rigid import Rigid  # noqa: E402

CUTOFF = 12.0
"""Of the low-pass on both sides of the equation, Hz."""
RATE = 50.0
"""Rows a second after it."""
EDGE = 0.3
"""Left out at either end, s."""
STANDS = 5e-3
"""A joint slower than this share of its largest speed stands: such rows are left out."""
STEADY = 0.05
"""Rows whose sign of speed is further from one behind the low-pass are left out."""
TEST_SHARE = 1 / 3
"""Held out of a single recording: its end."""

Matrix = np.ndarray


@dataclass(frozen=True)
class Signals:
    """Rows of one part of the data, with one column for each joint."""

    t: Matrix
    q: Matrix
    v: Matrix
    a: Matrix
    tau: Matrix
    rigid: Matrix
    """Torque of the data sheet's rigid arm, N·m."""
    turn: Matrix
    """Sign of the speed behind the same low-pass."""
    moving: Matrix
    """Where each joint moves and has moved in the same direction as far as the low-pass looks."""

    def rows(self, some: slice) -> Signals:
        """The signals in a part of the rows."""
        return Signals(*(getattr(self, name)[some] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Case:
    """Input of the methods for one case."""

    sheet: Arm
    train: Signals
    test: Signals

    def nominal(self, signals: Signals) -> Matrix:
        """Predicted torque of the data sheet with its friction, N·m."""
        viscous = np.array([joint.viscous for joint in self.sheet.joints])
        coulomb = np.array([joint.coulomb for joint in self.sheet.joints])
        return signals.rigid + viscous * signals.v + coulomb * signals.turn


def sheet_of(path: Path) -> Arm:
    """Reads the arm of a `model.toml`."""
    file = tomllib.loads(path.read_text())
    joints = []
    for table in file["joint"]:
        i = table["inertia"]
        inertia = np.array([[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]])
        joints.append(
            Joint(
                name=table["name"],
                axis=np.array(table["axis"], dtype=float),
                xyz=np.array(table["origin"]["xyz"]),
                viscous=table["damping"],
                coulomb=table["friction"],
                rotor=table["rotor_inertia"],
                link=Link(table["mass"], np.array(table["com"]), inertia),
                **table["limits"],
            )
        )
    return Arm(file["name"], tuple(joints), np.array(file["tool"]["xyz"]), np.array(file["gravity"]))


def signals_of(path: Path, sheet: Arm) -> Signals:
    """Reads a recording, filters it and reduces its rate."""
    names = path.open().readline().strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    rate = 1.0 / np.median(np.diff(table[:, 0]))
    t = np.arange(table[0, 0], table[-1, 0], 1.0 / rate)
    column = {name: np.interp(t, table[:, 0], table[:, k]) for k, name in enumerate(names)}
    low = butter(4, CUTOFF / (0.5 * rate))

    def block(prefix: str) -> Matrix:
        return filtfilt(*low, np.array([column[f"{prefix}{k + 1}"] for k in range(sheet.dof)]).T, axis=0)

    q, tau = block("q"), block("tau")
    v = np.gradient(q, t, axis=0)
    a = np.gradient(v, t, axis=0)
    speed = np.array([joint.velocity for joint in sheet.joints])
    turn = filtfilt(*low, np.sign(v) * (np.abs(v) > STANDS * speed), axis=0)
    some = slice(int(EDGE * rate), len(t) - int(EDGE * rate), max(int(rate / RATE), 1))
    q, v, a, tau, turn = (values[some] for values in (q, v, a, tau, turn))
    return Signals(t[some], q, v, a, tau, Rigid(sheet).torques(q, v, a), turn, np.abs(np.abs(turn) - 1.0) < STEADY)


def case_of(folder: Path) -> Case:
    """Reads the case in `folder`. `second.csv`, or the end of the only recording, is held out."""
    sheet = sheet_of(folder / "model.toml")
    train = signals_of(folder / "recording.csv", sheet)
    if (folder / "second.csv").is_file():
        return Case(sheet, train, signals_of(folder / "second.csv", sheet))
    cut = int(len(train.t) * (1 - TEST_SHARE))
    return Case(sheet, train.rows(slice(cut)), train.rows(slice(cut, None)))


def error(case: Case, signals: Signals, predicted: Matrix) -> Matrix:
    """Root mean square of measured minus predicted torque, by joint, in rows with motion. NaN without motion."""
    wrong = np.where(signals.moving, signals.tau - predicted, 0.0)
    count = signals.moving.sum(axis=0)
    return np.sqrt((wrong**2).sum(axis=0) / np.where(count > 0, count, np.nan))
