"""Friction laws. MuJoCo's dry friction is a set-valued constraint that holds a joint with at most `frictionloss`. Hooks change this limit during the run."""

from __future__ import annotations

import numpy as np

from arms import Arm, Rng
from laws import Law, Parameters, Same, Seat, joint_of, number, rms, sign, spread
from machine import Live
from plan import Plan
from strength import Look


def _floor(look: Look, seat: Seat) -> float:
    return float(look.floor[joint_of(seat)])


def _draw_coulomb(rng: Rng, look: Look, seat: Seat) -> Parameters:
    nominal = look.sheet.joints[joint_of(seat)].coulomb
    size = _floor(look, seat)
    # Less friction than on the data sheet is rarer, and the joint must have enough of it.
    less = rng.random() < 0.15 and nominal > 14 * size
    return {"coulomb": -size if less else size}


def _coulomb(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint = joint_of(seat)
    plan.arm = plan.arm.with_joint(joint, coulomb=max(plan.arm.joints[joint].coulomb + number(parameters, "coulomb"), 0.0))


def _draw_viscous(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"viscous": _floor(look, seat) / rms(look.v[:, joint_of(seat)])}


def _viscous(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint = joint_of(seat)
    plan.arm = plan.arm.with_joint(joint, viscous=plan.arm.joints[joint].viscous + number(parameters, "viscous"))


def _draw_stribeck(rng: Rng, look: Look, seat: Seat) -> Parameters:
    v = look.v[:, joint_of(seat)]
    velocity = float(np.quantile(np.abs(v), rng.uniform(0.15, 0.4))) + 0.01
    return {"extra": _floor(look, seat) / rms(np.exp(-((v / velocity) ** 2))), "velocity": velocity}


def _stribeck(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, extra, velocity = joint_of(seat), number(parameters, "extra"), number(parameters, "velocity")

    def hook(live: Live) -> None:
        live.extra[joint] += extra * np.exp(-((live.v[joint] / velocity) ** 2))

    plan.hooks.append(hook)


def _moves_slowly(look: Look, seat: Seat, parameters: Parameters) -> bool:
    v = np.abs(look.v[:, joint_of(seat)])
    slow = (v < 2 * number(parameters, "velocity")) & (v > 0.02 * number(parameters, "velocity"))
    return bool(slow.mean() > 0.05 and (v > 3 * number(parameters, "velocity")).mean() > 0.05)


def _draw_asymmetric(rng: Rng, look: Look, seat: Seat) -> Parameters:
    floor, less = _floor(look, seat), rng.uniform(0.1, 0.45)
    return {"positive": 1.3 * floor, "negative": 1.3 * less * floor} if rng.random() < 0.5 else {
        "positive": 1.3 * less * floor,
        "negative": 1.3 * floor,
    }


def _asymmetric(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, up, down = joint_of(seat), number(parameters, "positive"), number(parameters, "negative")

    def hook(live: Live) -> None:
        # A joint at rest keeps its holding torque.
        live.extra[joint] += 0.5 * (up + down)
        live.added[joint] -= 0.5 * (up - down)

    plan.hooks.append(hook)


def _as_offset(arm: Arm, seat: Seat, _parameters: Parameters) -> list[Same]:
    name = arm.joints[joint_of(seat)].name
    return [Same(("coulomb_friction", "torque_offset"), name, "while the joint moves the two are one class")]


def _draw_load(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"coefficient": _floor(look, seat) / rms(look.model[:, joint_of(seat)])}


def _load(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, coefficient = joint_of(seat), number(parameters, "coefficient")

    def hook(live: Live) -> None:
        live.extra[joint] += coefficient * abs(live.load[joint])

    plan.hooks.append(hook)


def _load_varies(look: Look, seat: Seat, parameters: Parameters) -> bool:
    load = np.abs(look.model[:, joint_of(seat)])
    return bool(load.std() > 0.35 * load.mean() and number(parameters, "coefficient") < 0.4)


def _draw_presliding(rng: Rng, look: Look, seat: Seat) -> Parameters:
    joint = joint_of(seat)
    friction = look.sheet.joints[joint].coulomb
    # Presliding distance after a reversal, rad: the trace is about F √(share of the motion in presliding).
    way = float(np.abs(look.v[:, joint]).sum()) * 4e-3
    turns = max(int((np.diff(np.sign(look.v[:, joint])) != 0).sum()), 1)
    share = min((2.0 * _floor(look, seat) / friction) ** 2, 0.5) if friction > 0 else 0.5
    return {"stiffness": friction / max(share * way / turns, 1e-5) * spread(rng, 0.8, 1.25)}


def _presliding(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.bristle[joint_of(seat)] = number(parameters, "stiffness")


def _reverses(look: Look, seat: Seat, parameters: Parameters) -> bool:
    v = look.v[:, joint_of(seat)]
    fast = np.sign(v[np.abs(v) > 0.05 * np.abs(v).max()])
    # Softer bristles are indistinguishable from a spring.
    slack = look.sheet.joints[joint_of(seat)].coulomb / number(parameters, "stiffness")
    return bool((np.diff(fast) != 0).sum() >= 6 and slack < 0.1)


def _draw_position(rng: Rng, look: Look, seat: Seat) -> Parameters:
    joint = joint_of(seat)
    periods = float(rng.integers(3, 13))
    return {"amplitude": 1.4 * _floor(look, seat), "periods": periods, "phase": float(rng.uniform(-np.pi, np.pi)) + 0 * joint}


def _position(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, amplitude = joint_of(seat), number(parameters, "amplitude")
    periods, phase = number(parameters, "periods"), number(parameters, "phase")

    def hook(live: Live) -> None:
        live.extra[joint] += amplitude * np.sin(periods * live.q[joint] + phase)

    plan.hooks.append(hook)


def turns_enough(look: Look, seat: Seat, parameters: Parameters) -> bool:
    """True if the joint passes at least one and a quarter periods."""
    way = float(np.ptp(look.q[:, joint_of(seat)]))
    return way * number(parameters, "periods") > 1.25 * 2 * np.pi


def _friction_stays(look: Look, seat: Seat, parameters: Parameters) -> bool:
    nominal = look.sheet.joints[joint_of(seat)].coulomb
    return turns_enough(look, seat, parameters) and number(parameters, "amplitude") < 0.9 * nominal


def _draw_drift(rng: Rng, look: Look, seat: Seat) -> Parameters:
    joint = look.sheet.joints[joint_of(seat)]
    friction = joint.coulomb + joint.viscous * rms(look.v[:, joint_of(seat)])
    time = float(look.t[-1]) * rng.uniform(0.2, 0.6)
    decay = np.exp(-look.t / time)
    return {"amount": _floor(look, seat) / max(friction * rms(decay - decay.mean()), 1e-9), "time_constant": time}


def _drift(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, amount, time = joint_of(seat), number(parameters, "amount"), number(parameters, "time_constant")

    def hook(live: Live) -> None:
        live.share[joint] = 1 + amount * np.exp(-max(live.t, 0.0) / time)

    plan.hooks.append(hook)


def _is_moderate(_look: Look, _seat: Seat, parameters: Parameters) -> bool:
    return number(parameters, "amount") < 3.0


def _draw_drag(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"coefficient": _floor(look, seat) / rms(look.v[:, joint_of(seat)] ** 2)}


def _drag(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, coefficient = joint_of(seat), number(parameters, "coefficient")

    def hook(live: Live) -> None:
        v = live.v[joint]
        live.added[joint] -= coefficient * v * abs(v)

    plan.hooks.append(hook)


def _draw_shaft(rng: Rng, look: Look, seat: Seat) -> Parameters:
    joint = joint_of(seat)
    other = joint - 1 if joint > 0 and (joint + 1 == look.sheet.dof or rng.random() < 0.5) else joint + 1
    way = sign(rng)
    v, a = look.v[:, joint] + way * look.v[:, other], look.a[:, joint] + way * look.a[:, other]
    shares, floor = rng.dirichlet([1.0, 1.0, 1.0]), _floor(look, seat)
    return {
        "with": look.sheet.joints[other].name,
        "inertia": float(shares[0] * floor / rms(a)),
        "viscous": float(shares[1] * floor / rms(v)),
        "coulomb": float(shares[2] * floor),
        "sign": way,
    }


def _shaft(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    from plan import Shaft

    other = [joint.name for joint in plan.arm.joints].index(str(parameters["with"]))
    values = (number(parameters, name) for name in ("sign", "inertia", "viscous", "coulomb"))
    plan.body.shafts.append(Shaft(joint_of(seat), other, *values))


def _as_seen_from_the_other(arm: Arm, seat: Seat, parameters: Parameters) -> list[Same]:
    return [Same(("joint_coupling",), str(parameters["with"]), "the shaft turns with both joints")]


def _several(arm: Arm) -> list[Seat]:
    return list(range(arm.dof)) if arm.dof > 1 else []


LAWS = (
    Law("coulomb_friction", _draw_coulomb, _coulomb, grows=("coulomb",)),
    Law("viscous_friction", _draw_viscous, _viscous, grows=("viscous",)),
    Law("stribeck_friction", _draw_stribeck, _stribeck, grows=("extra",), suits=_moves_slowly),
    Law("asymmetric_friction", _draw_asymmetric, _asymmetric, grows=("positive", "negative"), same=_as_offset),
    Law("load_dependent_friction", _draw_load, _load, grows=("coefficient",), suits=_load_varies),
    Law("presliding_friction", _draw_presliding, _presliding, shrinks=("stiffness",), suits=_reverses),
    Law("position_dependent_friction", _draw_position, _position, grows=("amplitude",), suits=_friction_stays),
    Law("friction_drift", _draw_drift, _drift, grows=("amount",), suits=_is_moderate),
    Law("quadratic_drag", _draw_drag, _drag, grows=("coefficient",)),
    Law("joint_coupling", _draw_shaft, _shaft, _several, grows=("inertia", "viscous", "coulomb"), same=_as_seen_from_the_other),
)
"""The kinds of friction."""
