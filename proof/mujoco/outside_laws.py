"""Physics outside the catalogue: a right answer names no effect."""

from __future__ import annotations

import mujoco
import numpy as np

from arms import Arm, Rng
from laws import Law, Parameters, Seat, joint_of, number, sign, spread, whole
from machine import Live
from plan import Plan
from strength import Look


def _floor(look: Look, seat: Seat) -> float:
    return float(look.floor[joint_of(seat)])


def _share(look: Look) -> float:
    """A mass with little effect on the arm, kg."""
    return 0.01 * sum(joint.link.mass for joint in look.sheet.joints)


def _draw_detent(rng: Rng, look: Look, seat: Seat) -> Parameters:
    q = look.q[:, joint_of(seat)]
    width = float(np.ptp(q)) * rng.uniform(0.04, 0.1)
    return {"amplitude": 2.5 * _floor(look, seat), "position": float(np.quantile(q, rng.uniform(0.3, 0.7))), "width": width}


def _detent(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, amplitude = joint_of(seat), number(parameters, "amplitude")
    position, width = number(parameters, "position"), number(parameters, "width")

    def hook(live: Live) -> None:
        x = (live.q[joint] - position) / width
        live.added[joint] -= amplitude * x * np.exp(0.5 - 0.5 * x * x)

    plan.hooks.append(hook)


def _draw_slosh(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    mass = _share(look)
    length = spread(rng, 0.05, 0.25)
    return {"mass": mass, "length": length, "damping": float(mass * length**2 * rng.uniform(0.3, 1.5))}


def _slosh(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    plan.body.pendulum = (number(parameters, "mass"), number(parameters, "length"), number(parameters, "damping"))


def _draw_rope(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    from rigid import Rigid

    rigid = Rigid(look.sheet)
    tools = np.array([rigid.tool(q) for q in look.q[::25]])
    place = tools.mean(axis=0) + np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(0.8, 1.5)])
    lengths = np.linalg.norm(tools - place, axis=1)
    free = float(np.quantile(lengths, rng.uniform(0.4, 0.6)))
    pull = np.sqrt(np.mean(np.maximum(lengths - free, 0.0) ** 2)) + 1e-6
    stiffness = float((look.floor / np.maximum(look.lever, 0.05)).min() / pull)
    return {"stiffness": stiffness, "length": free, "place": place.tolist()}


def _rope(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    plan.body.rope = (number(parameters, "stiffness"), number(parameters, "length"), np.array(parameters["place"]))


def _draw_bump(rng: Rng, look: Look, seat: Seat) -> Parameters:
    q = look.q[:, joint_of(seat)]
    at = float(np.quantile(q, rng.uniform(0.75, 0.9)))
    return {"at": at, "stiffness": _floor(look, seat) / float(np.sqrt(np.mean(np.maximum(q - at, 0.0) ** 2)) + 1e-6)}


def _bump(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.bump = (joint_of(seat), number(parameters, "at"), number(parameters, "stiffness"))


def _draw_mount(rng: Rng, _look: Look, _seat: Seat) -> Parameters:
    return {"frequency": float(rng.uniform(7.0, 11.0)), "damping": float(rng.uniform(0.02, 0.1))}


def _mount(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    plan.body.mount = (number(parameters, "frequency"), number(parameters, "damping"))


def _draw_drop(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    return {"mass": _share(look), "at": float(look.t[-1] * rng.uniform(0.35, 0.65))}


def _drop(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    plan.body.loads.append((number(parameters, "mass"), plan.arm.tool))
    name, at = f"load_{len(plan.body.loads) - 1}", number(parameters, "at")

    def hook(live: Live) -> None:
        body = live.model.body(name).id
        if live.t >= at and live.model.body_mass[body] > 1e-6:
            live.model.body_mass[body] = 1e-9
            live.model.body_inertia[body] = 1e-12
            mujoco.mj_setConst(live.model, mujoco.MjData(live.model))

    plan.hooks.append(hook)


def _draw_hum(rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"amplitude": 1.4 * _floor(look, seat), "frequency": spread(rng, 0.6, 7.0)}


def _hum(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, amplitude, frequency = joint_of(seat), number(parameters, "amplitude"), number(parameters, "frequency")

    def hook(live: Live) -> None:
        live.added[joint] -= amplitude * np.sin(2 * np.pi * frequency * live.t)

    plan.hooks.append(hook)


def _draw_slip(rng: Rng, look: Look, seat: Seat) -> Parameters:
    by_tool = (look.tool_floor or 1e-3) / max(look.lever[joint_of(seat)], 0.02)
    return {"jump": sign(rng) * 2.0 * float(by_tool), "at": float(look.t[-1] * rng.uniform(0.35, 0.65))}


def _slip(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    jump, at = number(parameters, "jump"), number(parameters, "at")
    # The gear slips during 0.05 s: after a sudden slip the servo would throw the arm.
    plan.senses.reading[joint_of(seat)] = lambda q, t: q + jump * float(np.clip((t - at) / 0.05, 0.0, 1.0))


def _several(arm: Arm) -> list[Seat]:
    return [None] if arm.dof > 1 else []


LAWS = (
    Law("magnetic_detent", _draw_detent, _detent, grows=("amplitude",), catalogued=False),
    Law("sloshing_load", _draw_slosh, _slosh, _several, grows=("mass", "damping"), catalogued=False),
    Law("slack_rope", _draw_rope, _rope, whole, grows=("stiffness",), catalogued=False),
    Law("bump_stop", _draw_bump, _bump, grows=("stiffness",), catalogued=False),
    Law("mount_resonance", _draw_mount, _mount, _several, shrinks=("frequency",), catalogued=False),
    Law("load_drop", _draw_drop, _drop, whole, grows=("mass",), catalogued=False),
    Law("periodic_disturbance", _draw_hum, _hum, grows=("amplitude",), catalogued=False),
    Law("encoder_slip", _draw_slip, _slip, grows=("jump",), tool_only=True, catalogued=False),
)
"""The kinds outside the catalogue."""
