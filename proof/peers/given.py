"""Identification with a given structure: MuJoCo's least squares over inverse dynamics, with the concealed law in the model.

The result is the fit of a known law. The method names no effect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from methods import Result
from mujoco import minimize
from signals import Case, Matrix, Signals

from arms import Arm
from rigid import Rigid

Law = Callable[[Case, Signals, int, Matrix], Matrix]
"""Torques of all joints for the law's numbers, without the data sheet's friction."""


def _on(case: Case, joint: int, column: Matrix) -> Matrix:
    """The torques of all joints, with `column` at one joint and zeros elsewhere."""
    return column[:, None] * np.eye(case.sheet.dof)[joint]


def _column(of: Callable[[Matrix, Matrix, Matrix, Matrix, Matrix], Matrix]) -> Law:
    """Torque of a law that acts on its own joint, from its parameters, q, v, a and the sign of v."""

    def law(case: Case, signals: Signals, joint: int, x: Matrix) -> Matrix:
        return signals.rigid + _on(case, joint, of(x, signals.q[:, joint], signals.v[:, joint], signals.a[:, joint], signals.turn[:, joint]))

    return law


def _changed(change: Callable[[Arm, int, Matrix], Arm]) -> Law:
    """The arm with a law that changes its links."""

    def law(case: Case, signals: Signals, joint: int, x: Matrix) -> Matrix:
        return Rigid(change(case.sheet, joint, x)).torques(signals.q, signals.v, signals.a)

    return law


def _heavier(arm: Arm, joint: int, x: Matrix) -> Arm:
    link, scale = arm.joints[joint].link, max(float(x[0]), 0.05)
    return arm.with_joint(joint, link=replace(link, mass=link.mass * scale, inertia=link.inertia * scale))


def _loaded(arm: Arm, _joint: int, x: Matrix) -> Arm:
    """The last link with an additional point mass."""
    link, mass, place = arm.joints[-1].link, max(float(x[0]), 1e-6), x[1:4]
    total = link.mass + mass
    com = (link.mass * link.com + mass * place) / total
    inertia = link.inertia + _point(link.mass, link.com - com) + _point(mass, place - com)
    return arm.with_joint(arm.dof - 1, link=replace(link, mass=total, com=com, inertia=inertia))


def _point(mass: float, at: Matrix) -> Matrix:
    return mass * (at @ at * np.eye(3) - np.outer(at, at))


def _tilted(arm: Arm, _joint: int, x: Matrix) -> Arm:
    return replace(arm, gravity=np.array([9.81 * np.sin(x[1]), -9.81 * np.sin(x[0]), -9.81 * np.cos(x[0]) * np.cos(x[1])]))


def _sliding(x: Matrix, _q: Matrix, _v: Matrix, _a: Matrix, s: Matrix) -> Matrix:
    return 0.5 * (x[0] + x[1]) * s + 0.5 * (x[0] - x[1])


LAWS: dict[str, tuple[Law, list[float]]] = {
    "coulomb_friction": (_column(lambda x, _q, _v, _a, s: x[0] * s), [0.0]),
    "viscous_friction": (_column(lambda x, _q, v, _a, _s: x[0] * v), [0.0]),
    "stribeck_friction": (_column(lambda x, _q, v, _a, s: x[0] * np.exp(-((v / (abs(x[1]) + 1e-3)) ** 2)) * s), [0.0, 0.1]),
    "asymmetric_friction": (_column(_sliding), [0.0, 0.0]),
    "quadratic_drag": (_column(lambda x, _q, v, _a, _s: x[0] * v * np.abs(v)), [0.0]),
    "torque_offset": (_column(lambda x, q, _v, _a, _s: x[0] + 0 * q), [0.0]),
    "rotor_inertia": (_column(lambda x, _q, _v, a, _s: x[0] * a), [0.0]),
    "joint_spring": (_column(lambda x, q, _v, _a, _s: x[0] * q + x[1]), [0.0, 0.0]),
    "link_mass": (_changed(_heavier), [1.0]),
    "payload": (_changed(_loaded), [0.01, 0.0, 0.0, 0.0]),
    "base_tilt": (_changed(_tilted), [0.0, 0.0]),
}
"""The laws that a torque model can be given, with where the search starts."""


def identify(case: Case, truth: dict[str, Any]) -> Result | None:
    """Fits the parameters of the concealed law, the friction, and a factor of each joint's rigid torque. `None` if no torque model contains the law."""
    if len(truth["effects"]) != 1 or truth["effects"][0]["kind"] not in LAWS:
        return None
    effect = truth["effects"][0]
    law, start = LAWS[effect["kind"]]
    names, n = [joint.name for joint in case.sheet.joints], case.sheet.dof
    joint = 0 if effect["joint"] is None else names.index(effect["joint"])

    def torques(signals: Signals, x: Matrix) -> Matrix:
        own, dry = x[: len(start)], x[len(start) :]
        friction = (case.nominal(signals) - signals.rigid) * (1 + dry[:n])
        return law(case, signals, joint, own) + friction + signals.rigid * dry[n:]

    size = np.sqrt((case.train.tau**2).mean(axis=0)) + 1e-9
    # The tolerances of the data sheet are the prior: 5 % of friction, 2 % of rigid torque.
    prior = np.concatenate([np.full(n, 0.05), np.full(n, 0.02)])

    def wrong(x: Matrix) -> Matrix:
        left = np.where(case.train.moving, case.train.tau - torques(case.train, x.ravel()), 0.0) / size
        return np.concatenate([left.ravel(), x.ravel()[len(start) :] / prior])[:, None]

    first = np.concatenate([np.array(start), np.zeros(2 * n)])
    found, _ = minimize.least_squares(first, lambda x: np.hstack([wrong(column) for column in np.atleast_2d(x.T)]), verbose=minimize.Verbosity.SILENT)
    return Result(frozenset(), lambda signals: torques(signals, np.asarray(found).ravel()))
