"""Torque columns for regressions, each with the effect of the catalogue that a nonzero coefficient means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from signals import Case, Matrix, Signals

from arms import Arm
from rigid import Rigid

Name = tuple[str, str | None]
"""Kind and joint."""
INERTIA, FRICTION = 0.02 / np.sqrt(3), 0.05 / np.sqrt(3)
"""Standard deviations of a data sheet's masses and frictions that are spread evenly over their tolerances, as a fraction."""
BEYOND = 2.0
"""A term is a finding where its trace is so many times what these do in its channel: two standard deviations."""


def friction(signals: Signals, joint: int) -> dict[str, Matrix]:
    """The standard friction and rotor terms of one joint, as columns of its torque."""
    v, a = signals.v[:, joint], signals.a[:, joint]
    return {"coulomb_friction": signals.turn[:, joint], "viscous_friction": v, "torque_offset": np.ones_like(v), "rotor_inertia": a}


def library(case: Case, signals: Signals, joint: int) -> dict[tuple[str, str], Matrix]:
    """Terms for sparse regression of one joint's torque, by the kind that each means and its text."""
    v, q, load = signals.v[:, joint], signals.q[:, joint], signals.rigid[:, joint]
    moved = signals.turn[:, joint]
    terms = {(kind, kind): column for kind, column in friction(signals, joint).items()}
    terms["quadratic_drag", "v|v|"] = v * np.abs(v)
    fast = case.sheet.joints[joint].velocity
    for share in (0.02, 0.06):
        terms["stribeck_friction", f"exp(-(v/{share} vmax)^2) sign v"] = moved * np.exp(-((v / (share * fast)) ** 2))
    terms["load_dependent_friction", "|load| sign v"] = np.abs(load) * moved
    terms["torque_gain", "load"] = load + _nominal_friction(case, signals, joint)
    terms["joint_spring", "q"] = q
    terms["unnamed", "sin q"], terms["unnamed", "cos q"] = np.sin(q), np.cos(q)
    terms["time_delay", "d load/dt"] = np.gradient(load + _nominal_friction(case, signals, joint), signals.t)
    terms["friction_drift", "t sign v"] = (signals.t - signals.t[0]) * moved
    for periods in (4, 8, 12, 16, 24, 32):
        for name, wave in (("sin", np.sin), ("cos", np.cos)):
            terms["torque_ripple", f"{name} {periods} q"] = wave(periods * q)
            if periods <= 12:
                terms["position_dependent_friction", f"{name} {periods} q sign v"] = wave(periods * q) * moved
    for other in (joint - 1, joint + 1):
        if 0 <= other < case.sheet.dof:
            terms["joint_coupling", f"v{other + 1}"] = signals.v[:, other]
            terms["joint_coupling", f"a{other + 1}"] = signals.a[:, other]
    return terms


def _nominal_friction(case: Case, signals: Signals, joint: int) -> Matrix:
    return (case.nominal(signals) - signals.rigid)[:, joint]


def inertial(sheet: Arm, signals: Signals, link: int) -> Matrix:
    """Derivatives of the torques of all joints by the ten inertial parameters of a link: rows × joints × 10."""
    base = Rigid(sheet)
    plain = base.torques(signals.q, signals.v, signals.a)
    here = sheet.joints[link].link
    length = float(np.linalg.norm(sheet.way(link))) + 0.05
    changes = [replace(here, mass=here.mass * 1.01)]
    changes += [replace(here, com=here.com + 0.01 * length * np.eye(3)[k]) for k in range(3)]
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        more = np.zeros((3, 3))
        more[i, j] = more[j, i] = 0.01 * np.trace(here.inertia) / 6
        # A small diagonal part keeps the inertia physical.
        changes.append(replace(here, inertia=here.inertia + more + (0.02 * np.trace(here.inertia) / 6) * np.eye(3) * (i != j)))
    columns = [Rigid(sheet.with_joint(link, link=change)).torques(signals.q, signals.v, signals.a) - plain for change in changes]
    return np.array(columns).transpose(1, 2, 0)


def tolerated(case: Case, joint: int, kind: str) -> float:
    """Effect of the data sheet's tolerances on the torque of `joint`, root mean square, N·m."""
    rigid = INERTIA * np.sqrt(np.mean(case.train.rigid[:, joint] ** 2))
    dry = FRICTION * np.sqrt(np.mean(_nominal_friction(case, case.train, joint) ** 2))
    return float(dry if "friction" in kind or kind == "quadratic_drag" else rigid)
