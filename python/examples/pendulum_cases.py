#!/usr/bin/env python3
"""A generator for `freeplay blind` in one file: short recordings of a driven pendulum with concealed friction, offset or elastic stop.

    freeplay blind --cases 40 --seed 1 --generator python/examples/pendulum_cases.py

A case takes a fiftieth of the processor time of the built-in machines, so that a campaign with thousands of cases takes minutes. proof/mujoco/README.md
contains the contract of a generator. Requires Python 3.10 and no packages.
"""

from __future__ import annotations

import json
import math
import random
import sys
from pathlib import Path
from typing import Any

MODEL = """name = "pendulum"

[[joint]]
name = "pivot"
type = "revolute"
axis = [0.0, 1.0, 0.0]
limits = { lower = -3.0, upper = 3.0, velocity = 6.0, acceleration = 60.0, effort = 60.0 }
damping = 0.6
friction = 1.5
rotor_inertia = 0.2
mass = 5.0
com = [0.3, 0.0, 0.0]
inertia = { ixx = 0.01, iyy = 0.06, izz = 0.06, ixy = 0.0, ixz = 0.0, iyz = 0.0 }

[tool]
xyz = [0.6, 0.0, 0.0]
"""
MASS, COM, INERTIA = 5.0, 0.3, 0.06 + 0.2  # kg, m, kg·m²; the last includes the rotor
DAMPING, FRICTION, GRAVITY = 0.6, 1.5, 9.81  # N·m·s/rad, N·m, m/s²
RATE, DURATION, NOISE = 100.0, 8.0, 0.05  # Hz, s, N·m
# The parameter of each kind, and its values from weak to strong, SI.
KINDS = {
    "coulomb_friction": ("coulomb", [0.5, 1.0, 2.5]),
    "viscous_friction": ("viscous", [0.4, 0.8, 2.0]),
    "torque_offset": ("offset", [0.3, 0.7, 2.0]),
}
# Physics outside the catalogue: an elastic stop that begins at this angle, rad, with a stiffness from weak to strong, N·m/rad.
STOP, STOP_STIFFNESS = 0.25, [4.0, 8.0, 20.0]
SEVERITIES = ["slight", "clear", "strong"]
Values = list[float]


def motion(dice: random.Random) -> list[tuple[float, float, float, float]]:
    """Time, position, velocity and acceleration of a motion that is a sum of three sines."""
    sines = [(dice.uniform(0.15, 0.5), 2.0 * math.pi * dice.uniform(0.2, 0.9), dice.uniform(0.0, 2.0 * math.pi)) for _ in range(3)]
    rows = []
    for sample in range(int(DURATION * RATE)):
        t = sample / RATE
        q = sum(a * math.sin(w * t + p) for a, w, p in sines)
        qd = sum(a * w * math.cos(w * t + p) for a, w, p in sines)
        rows.append((t, q, qd, -sum(a * w * w * math.sin(w * t + p) for a, w, p in sines)))
    return rows


def torque(q: float, qd: float, qdd: float, concealed: dict[str, float]) -> float:
    """The torque of the motor, N·m. The arm lies along x at q = 0 and rotates about y, so that its weight exerts a torque with cos q."""
    inertia = (INERTIA + MASS * COM**2) * qdd
    weight = MASS * COM * GRAVITY * math.cos(q)
    coulomb = FRICTION + concealed.get("coulomb_friction", 0.0)
    friction = (DAMPING + concealed.get("viscous_friction", 0.0)) * qd + coulomb * math.copysign(1.0, qd)
    stop = concealed.get("elastic_stop", 0.0) * max(q - STOP, 0.0)
    return inertia - weight + friction + stop + concealed.get("torque_offset", 0.0)


def recording(dice: random.Random, concealed: dict[str, float]) -> str:
    """Text of a recording as CSV."""
    lines = ["t,q1,tau1"]
    lines += [f"{t:.4f},{q:.8f},{torque(q, qd, qdd, concealed) + dice.gauss(0.0, NOISE):.5f}" for t, q, qd, qdd in motion(dice)]
    return "\n".join(lines) + "\n"


def draw(index: int, order: dict[str, Any]) -> tuple[dict[str, float], str]:
    """The concealed effects of the case `index`, and their severity. The order is: single effects, controls, outside the catalogue, pairs."""
    dice = random.Random(f"{order['seed']} {index}")
    severity = dice.randrange(3)
    for sort, count in {"single": 1, "negative": 0, "unknown": None, "double": 2}.items():
        if index < order["quota"][sort]:
            kinds = sorted(dice.sample(sorted(KINDS), count)) if count is not None else []
            strengths = {kind: KINDS[kind][1][severity] for kind in kinds}
            return strengths if count is not None else {"elastic_stop": STOP_STIFFNESS[severity]}, SEVERITIES[severity]
        index -= order["quota"][sort]
    raise ValueError("a case beyond the quota")


def make(index: int, name: str, order: dict[str, Any]) -> dict[str, Any]:
    """Writes the files of a case, and returns its true effects."""
    concealed, severity = draw(index, order)
    dice = random.Random(f"{order['seed']} {index} motion")
    folder = Path(order["folder"]) / name
    folder.mkdir()
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    for file in ("recording.csv", "second.csv"):
        (folder / file).write_text(recording(dice, concealed), encoding="utf-8")
    effects = [
        {
            "kind": kind, "joint": "pivot", "parameters": {KINDS[kind][0]: value} if kind in KINDS else {}, "catalogued": kind in KINDS,
            "severity": severity, "signal_to_floor": value / NOISE, "channel": "tau1",
        }
        for kind, value in concealed.items()
    ]  # fmt: skip
    return {"effects": effects, "machine": "pendulum", "joints": 1, "noise": "low", "duration": DURATION}


def main() -> int:
    try:
        order = json.load(sys.stdin)
        for case in order["cases"]:
            index, name = case["index"], case["name"]
            print(json.dumps([index, None]), flush=True)
            print(json.dumps([index, {"Made": {"name": name, "truth": make(index, name, order)}}]), flush=True)
    except (ValueError, KeyError, OSError) as error:
        print(f"pendulum_cases: {error}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
