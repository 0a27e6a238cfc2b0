"""Set-up faults: recordings with other conventions than the data sheet. The machine itself has no effects.

Each fault changes the content of the files (units, signs, order, zeros, clocks); the faults of gravity change the mounting of the machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import files
import sensors
from arms import Arm, Rng, Vector
from cases import Bench, Made, NotMade
from rigid import Rigid
from sensors import Recording

ATTEMPTS = 40
"""Benches and places that are tried until the recording shows a fault."""
SHOWS = 0.5
"""Least growth of the part of a torque that gravity does not explain, as a share of that torque's deviation."""
SHOWS_AT_TOOL = 0.03
"""Least movement of the tool that the model does not explain, m."""
Columns = dict[str, Vector]
Change = Callable[[Columns], None]


@dataclass(frozen=True)
class Fault:
    """A fault, and its change of the columns of a recording."""

    kind: str
    joints: tuple[int, ...]
    """The joints that it is about; none for the whole recording."""
    value: float | list[float] | None
    detail: str
    change: Change


def _positions(columns: Columns, joint: int, change: Callable[[Vector], Vector]) -> None:
    for prefix in ("q", "q_ref", "q_link"):
        name = f"{prefix}{joint + 1}"
        if name in columns:
            columns[name] = change(columns[name])


def _factor(prefix: str, factors: dict[int, float]) -> Change:
    def change(columns: Columns) -> None:
        for joint, factor in factors.items():
            columns[f"{prefix}{joint + 1}"] = columns[f"{prefix}{joint + 1}"] * factor

    return change


def _time_unit(_rng: Rng, _arm: Arm, _columns: Columns) -> Fault:
    def change(columns: Columns) -> None:
        columns["t"] = columns["t"] * 1e3

    return Fault("time_unit", (), 1e-3, "ms", change)


def _angle_unit(_rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    def change(columns: Columns) -> None:
        for joint in range(arm.dof):
            _positions(columns, joint, np.rad2deg)

    return Fault("angle_unit", (), float(np.pi / 180), "degrees", change)


def _order(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    first, second = sorted(int(joint) for joint in rng.choice(arm.dof, 2, replace=False))

    def change(columns: Columns) -> None:
        for prefix in ("q", "tau", "q_ref", "q_link"):
            a, b = f"{prefix}{first + 1}", f"{prefix}{second + 1}"
            if a in columns:
                columns[a], columns[b] = columns[b], columns[a]

    return Fault("joint_order", (first, second), None, "", change)


def _direction(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    joint, alone = int(rng.integers(arm.dof)), bool(rng.random() < 0.4)

    def change(columns: Columns) -> None:
        _positions(columns, joint, np.negative)
        if not alone:
            columns[f"tau{joint + 1}"] = -columns[f"tau{joint + 1}"]

    return Fault("joint_direction", (joint,), -1.0, "alone" if alone else "with torque", change)


def _zero(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    joint = int(rng.integers(arm.dof))
    zero = float(rng.choice([np.pi / 2, -np.pi / 2, np.pi])) if rng.random() < 0.7 else float(rng.uniform(0.5, 2.6))
    return Fault("joint_zero", (joint,), zero, "", lambda columns: _positions(columns, joint, lambda q: q + zero))


def _coordinates(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    joint, sign = int(rng.integers(1, arm.dof)), float(rng.choice([-1.0, 1.0]))

    def change(columns: Columns) -> None:
        for prefix in ("q", "q_ref", "q_link"):
            if f"{prefix}{joint + 1}" in columns:
                columns[f"{prefix}{joint + 1}"] = columns[f"{prefix}{joint + 1}"] + sign * columns[f"{prefix}{joint}"]

    return Fault("joint_coordinates", (joint,), sign, "", change)


def _torque_sign(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    every = rng.random() < 0.4
    joints = tuple(range(arm.dof)) if every else (int(rng.integers(arm.dof)),)
    return Fault("torque_sign", () if every else joints, -1.0, "", _factor("tau", dict.fromkeys(joints, -1.0)))


def _torque_unit(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    way = rng.choice(["N*mm", "ampere", "motor side", "one"])
    if way == "one":
        joint, factor = int(rng.integers(arm.dof)), float(np.exp(rng.uniform(np.log(3), np.log(200))))
        return Fault("torque_unit", (joint,), 1 / factor, str(way), _factor("tau", {joint: factor}))
    each = {
        "N*mm": np.full(arm.dof, 1e3),
        "ampere": 1 / np.exp(rng.uniform(np.log(3), np.log(15), arm.dof)),
        "motor side": 1 / rng.choice([50.0, 80.0, 100.0, 120.0, 160.0], arm.dof),
    }[str(way)]
    return Fault("torque_unit", (), (1 / each).tolist(), str(way), _factor("tau", dict(enumerate(each.tolist()))))


def _gravity_taken(_rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    def change(columns: Columns) -> None:
        q = Recording(columns).block("q", arm.dof)
        if q is not None:
            held = _held(arm, q)
            for joint in range(arm.dof):
                columns[f"tau{joint + 1}"] = columns[f"tau{joint + 1}"] - held[:, joint]

    return Fault("gravity_compensated", (), None, "", change)


def _clock(rng: Rng, arm: Arm, columns: Columns) -> Fault:
    late = float(rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(np.log(0.05), np.log(0.4))))
    group = "tool" if "x" in columns and rng.random() < 0.5 else "tau"
    names = ["x", "y", "z"] if group == "tool" else [f"tau{joint + 1}" for joint in range(arm.dof)]

    def change(columns: Columns) -> None:
        for name in names:
            columns[name] = np.interp(columns["t"] - late, columns["t"], columns[name])

    return Fault("clock_offset", (), late, group, change)


def _frozen(rng: Rng, arm: Arm, _columns: Columns) -> Fault:
    joint, prefix = int(rng.integers(arm.dof)), str(rng.choice(["tau", "q"]))
    name = f"{prefix}{joint + 1}"

    def change(columns: Columns) -> None:
        columns[name] = np.full_like(columns[name], 0.0 if prefix == "tau" else columns[name][0])

    return Fault("frozen_channel", (joint,), None, prefix, change)


def _mounted(rng: Rng, _arm: Arm, _columns: Columns) -> Fault:
    walls = [[0, 0, 1.0], [1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]
    down = np.array(walls[int(rng.integers(len(walls)))]) if rng.random() < 0.7 else rng.standard_normal(3)
    return Fault("gravity_direction", (), (9.81 * down / np.linalg.norm(down)).tolist(), "", lambda _columns: None)


_DRAWS = {
    "time_unit": _time_unit,
    "angle_unit": _angle_unit,
    "joint_order": _order,
    "joint_direction": _direction,
    "joint_zero": _zero,
    "joint_coordinates": _coordinates,
    "torque_sign": _torque_sign,
    "torque_unit": _torque_unit,
    "gravity_direction": _mounted,
    "gravity_compensated": _gravity_taken,
    "clock_offset": _clock,
    "frozen_channel": _frozen,
}
KINDS = tuple(_DRAWS)
"""The kinds of set-up faults."""


def make(kind: str, noise: str, seed: int) -> Made:
    """Generates a machine without effects, with a fault of `kind` that the recording shows. Every third data sheet names no friction.

    Raises NotMade if none of the drawn benches shows it.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, attempt])
        bench = Bench.draw(noise, rng)
        fault = _DRAWS[kind](rng, bench.sheet, {"x": np.zeros(1)} if bench.chain.tool_noise is not None else {})
        if kind == "gravity_direction":
            gravity = np.array(fault.value)
            if np.dot(gravity, bench.sheet.gravity) > 0.7 * 9.81**2:
                continue
            bench.sheet = replace(bench.sheet, gravity=gravity)
            bench.drawn = replace(bench.drawn, arm=replace(bench.drawn.arm, gravity=gravity))
        made = _recorded(bench, fault, rng)
        if made is not None:
            return made
    raise NotMade(f"none of the drawn recordings shows {kind}")


def _recorded(bench: Bench, fault: Fault, rng: Rng) -> Made | None:
    """The recordings with the fault. `None` if the first one does not show the fault."""
    plan = bench.plan([])
    recordings: dict[str, Recording] = {}
    sheet = replace(bench.sheet, gravity=np.array([0.0, 0.0, -9.81]))
    for name, motion in zip(("recording.csv", "second.csv"), bench.motions, strict=False):
        recording = sensors.record(bench.chain, plan.senses, bench.run(plan, motion), motion, rng)
        faulty = Recording(dict(recording.columns))
        fault.change(faulty.columns)
        if not recordings and not _shows(fault, bench.sheet, sheet, recording, faulty):
            return None
        recordings[name] = faulty
    if rng.random() < 1 / 3:
        sheet = replace(sheet, joints=tuple(replace(joint, viscous=0.0, coulomb=0.0) for joint in sheet.joints))
    names = [bench.sheet.joints[joint].name for joint in fault.joints]
    said = {"kind": fault.kind, "joints": names, "value": fault.value, "detail": fault.detail}
    truth: dict[str, object] = {
        "schema": "freeplay.truth/1",
        "machine": bench.family,
        "joints": bench.sheet.dof,
        "noise": bench.noise,
        "duration": bench.duration,
        "friction": any(joint.coulomb for joint in sheet.joints),
        "setup": [said],
        "effects": [],
    }
    return Made(sheet, files.toml(sheet), recordings, truth)


def _held(arm: Arm, q: Vector) -> Vector:
    """Torque that holds `arm` at the positions `q`, row by row."""
    rigid, rest = Rigid(arm), np.zeros(arm.dof)
    return np.array([rigid.torque(row, rest, rest) for row in q])


def _shows(fault: Fault, mounted: Arm, sheet: Arm, clean: Recording, faulty: Recording) -> bool:
    """True if the fault clearly increases the errors of torques or tool position against the data sheet."""
    if fault.kind == "time_unit":
        return True
    some, n = slice(None, None, 40), sheet.dof
    blocks = [recording.block(prefix, n) for recording in (clean, faulty) for prefix in ("q", "tau")]
    if any(block is None for block in blocks):
        return False
    q, tau, other_q, other_tau = (block[some] for block in blocks if block is not None)
    size, moves = tau.std(axis=0), q.std(axis=0) > 0.05
    if fault.kind in ("frozen_channel", "clock_offset", "angle_unit"):
        return all(moves[joint] for joint in fault.joints) and bool(moves.any())
    before = (tau - _held(mounted, q)).std(axis=0)
    after = (other_tau - _held(sheet, other_q)).std(axis=0)
    touched = [joint for joint in range(n) if not fault.joints or joint in fault.joints or fault.kind.startswith("joint_")]
    if any(after[joint] > before[joint] + SHOWS * size[joint] for joint in touched):
        return True
    rigid = Rigid(sheet)
    moved = np.array([rigid.tool(a) - rigid.tool(b) for a, b in zip(q, other_q, strict=True)])
    return "x" in clean.columns and bool((moved.std(axis=0) > SHOWS_AT_TOOL).any())
