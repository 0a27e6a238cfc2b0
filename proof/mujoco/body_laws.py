"""Effects that are built into the machine or act on it: inertias, springs, gaps, flexible links, gravity and pushes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from arms import Arm, Rng, Vector
from friction_laws import turns_enough
from laws import Law, Parameters, Same, Seat, joint_of, number, rms, sign, spread, whole
from machine import Live
from plan import Plan
from strength import Look
from tolerances import longer

GEAR = 3e3
"""Stiffness of a gear's teeth for every N·m that the joint can give, 1/rad."""


def _floor(look: Look, seat: Seat) -> float:
    return float(look.floor[joint_of(seat)])


def _tool_angle(look: Look, seat: Seat) -> float:
    """Joint angle that moves the tool by the floor, rad; 0.001 without a tracker."""
    if look.tool_floor is None:
        return 1e-3
    return float(look.tool_floor / max(look.lever[joint_of(seat)], 0.02))


def _draw_rotor(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"inertia": _floor(look, seat) / rms(look.a[:, joint_of(seat)])}


def _rotor(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint = joint_of(seat)
    plan.arm = plan.arm.with_joint(joint, rotor=plan.arm.joints[joint].rotor + number(parameters, "inertia"))


def _upright(arm: Arm, seat: Seat) -> bool:
    return seat == 0 and abs(arm.joints[0].axis[2]) > 0.99


def _as_link(arm: Arm, seat: Seat, _parameters: Parameters) -> list[Same]:
    why = "a link on an upright axis is felt as inertia about it alone"
    return [Same(("link_mass",), arm.joints[0].name, why)] if _upright(arm, seat) else []


def _draw_payload(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    com = look.sheet.tool * rng.uniform(0.5, 1.0) + rng.uniform(-0.03, 0.03, 3)
    total = sum(joint.link.mass for joint in look.sheet.joints)
    return {"mass": 0.004 * total, "com": com.tolist()}


def _payload(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    plan.body.loads.append((number(parameters, "mass"), np.array(parameters["com"])))


def _is_carried(look: Look, _seat: Seat, parameters: Parameters) -> bool:
    """True if the mass is less than half of that of all links after the first."""
    return number(parameters, "mass") < 0.5 * sum(joint.link.mass for joint in look.sheet.joints[1:])


def _draw_link(rng: Rng, _look: Look, _seat: Seat) -> Parameters:
    return {"scale": 1 + 0.03 * (1.0 if rng.random() < 0.6 else -1.0)}


def _link(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, scale = joint_of(seat), number(parameters, "scale")
    link = plan.arm.joints[joint].link
    plan.arm = plan.arm.with_joint(joint, link=replace(link, mass=link.mass * scale, inertia=link.inertia * scale))


def _link_is_left(_look: Look, _seat: Seat, parameters: Parameters) -> bool:
    return 0.4 < number(parameters, "scale") < 2.5


def _as_payload(arm: Arm, seat: Seat, _parameters: Parameters) -> list[Same]:
    if _upright(arm, seat):
        return [Same(("rotor_inertia",), arm.joints[0].name, "a link on an upright axis is felt as inertia about it alone")]
    why = "a payload at the link's centre of mass is a heavier link"
    return [Same(("payload",), None, why)] if joint_of(seat) + 1 == arm.dof else []


def _draw_tilt(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    angle = rng.uniform(-np.pi, np.pi)
    flat = look.sheet.dof == 2  # Two axes along y do not respond to roll.
    roll = 0.0 if flat else 0.004 * np.cos(angle)
    return {"roll": float(roll), "pitch": 0.004 * (sign(rng) if flat else float(np.sin(angle)))}


def _tilt(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    roll, pitch = number(parameters, "roll"), number(parameters, "pitch")
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    plan.arm = replace(plan.arm, gravity=(about_y @ about_x).T @ plan.arm.gravity)


def _draw_spring(rng: Rng, look: Look, seat: Seat) -> Parameters:
    q = look.q[:, joint_of(seat)]
    rest = float(q.mean() + rng.uniform(-0.5, 0.5))
    return {"stiffness": _floor(look, seat) / rms(q - rest), "rest": rest}


def _spring(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.spring[joint_of(seat)] = (number(parameters, "stiffness"), number(parameters, "rest"))


def _turns(look: Look, seat: Seat, _parameters: Parameters) -> bool:
    return bool(np.ptp(look.q[:, joint_of(seat)]) > 0.5)


def _draw_gap(rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"gap": 2.2 * _tool_angle(look, seat) * spread(rng, 0.9, 1.1)}


def _gap(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.gap[joint_of(seat)] = number(parameters, "gap")


def _changes_flank(look: Look, seat: Seat, parameters: Parameters) -> bool:
    """True if the transmitted torque changes its sign often enough and keeps each sign for some time."""
    joint = joint_of(seat)
    rotor = look.sheet.joints[joint].rotor
    load = look.model[:, joint] - rotor * look.a[:, joint]
    up = float((load > 0).mean())
    turns = int((np.diff(np.sign(load)) != 0).sum())
    return 0.12 < up < 0.88 and 4 <= turns <= 5 * look.t[-1] and number(parameters, "gap") < 0.03


def _draw_elastic(rng: Rng, look: Look, seat: Seat) -> Parameters:
    load = look.model[:, joint_of(seat)]
    stiffness = rms(load) / _tool_angle(look, seat)
    return {"stiffness": stiffness, "damping": stiffness * spread(rng, 1e-3, 3e-3)}


def _elastic(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.elastic[joint_of(seat)] = (number(parameters, "stiffness"), number(parameters, "damping"))


def _bends_to_and_fro(look: Look, seat: Seat, _parameters: Parameters) -> bool:
    load = look.model[:, joint_of(seat)]
    return bool(load.std() > 0.35 * rms(load))


def _draw_clearance(_rng: Rng, look: Look, _seat: Seat) -> Parameters:
    return {"clearance": 1.2 * (look.tool_floor or 1e-4)}


def _clearance(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.clearance[joint_of(seat)] = number(parameters, "clearance")


def _force_turns(look: Look, seat: Seat, _parameters: Parameters) -> bool:
    """True if the weight that the joint carries rotates in the plane across its axis, in the frame of the bearing."""
    joint = joint_of(seat)
    before = look.q[:, 1:joint].sum(axis=1) if joint > 1 else look.q[:, joint]
    level = abs(look.sheet.joints[joint].axis[2]) < 0.5
    return bool(level and joint > 0 and np.ptp(before) > 0.8)


def _draw_bend(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    # Force at the far end of the link, from the torque at its joint.
    length = float(np.linalg.norm(look.sheet.way(joint_of(seat))))
    force = rms(look.model[:, joint_of(seat)]) / max(length + float(look.lever[joint_of(seat)]), 0.05)
    return {"stiffness": 2.0 * force / (look.tool_floor or 1e-4)}


def _bend(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.body.bend[joint_of(seat)] = number(parameters, "stiffness")


def _long(arm: Arm) -> list[Seat]:
    return [k for k in range(arm.dof) if np.linalg.norm(arm.way(k)) > 0.05]


def _long_between(arm: Arm) -> list[Seat]:
    return [k for k in range(arm.dof - 1) if np.linalg.norm(arm.way(k)) > 0.15]


def _loaded(arm: Arm) -> list[Seat]:
    return [k for k in range(1, arm.dof) if abs(arm.joints[k].axis[2]) < 0.5]


def _draw_length(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    return {"offset": sign(rng) * (look.tool_floor or 1e-4)}


def _length(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, offset = joint_of(seat), number(parameters, "offset")
    if joint + 1 < plan.arm.dof:
        plan.arm = plan.arm.with_joint(joint + 1, xyz=longer(plan.arm.joints[joint + 1].xyz, offset))
    else:
        plan.arm = replace(plan.arm, tool=longer(plan.arm.tool, offset))


def _along(one: Vector, other: Vector) -> bool:
    """True if two vectors have the same or opposite directions."""
    return bool(np.linalg.norm(np.cross(one, other)) < 1e-6 * np.linalg.norm(one) * np.linalg.norm(other))


def _as_long(arm: Arm, seat: Seat, _parameters: Parameters) -> list[Same]:
    """Other links in the same direction, with only joints about that direction between them: their lengths are indistinguishable."""
    why, found, joint = "a joint that turns about the way does not part what is before it from what is behind", [], joint_of(seat)
    # At zero all frames of an arm have the same orientation, so that vectors are comparable without rotation.
    for step in (-1, 1):
        other = joint + step
        while 0 <= other < arm.dof:
            way = arm.way(joint)
            if not _along(arm.joints[max(other, other - step)].axis, way):
                break
            if _along(arm.way(other), way):
                found.append(Same(("link_length",), arm.joints[other].name, why))
            other += step
    return found


def _draw_ripple(rng: Rng, look: Look, seat: Seat) -> Parameters:
    phase = float(rng.uniform(-np.pi, np.pi))
    return {"amplitude": 1.4 * _floor(look, seat), "periods": float(rng.integers(4, 40)), "phase": phase}


def _ripple(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, amplitude = joint_of(seat), number(parameters, "amplitude")
    periods, phase = number(parameters, "periods"), number(parameters, "phase")

    def hook(live: Live) -> None:
        live.added[joint] -= amplitude * np.sin(periods * live.q[joint] + phase)

    plan.hooks.append(hook)


def _ripples_slowly(look: Look, seat: Seat, parameters: Parameters) -> bool:
    """True if the joint passes several teeth, none faster than a servo can follow."""
    fastest = float(np.quantile(np.abs(look.v[:, joint_of(seat)]), 0.95))
    return turns_enough(look, seat, parameters) and fastest * number(parameters, "periods") < 2 * np.pi * 12


def _moment(rng: Rng, look: Look) -> tuple[float, float]:
    """Random begin and end of a push, s."""
    length = spread(rng, 0.08, 0.8)
    start = float(rng.uniform(0.5, look.t[-1] - length - 0.5))
    return start, start + length


def _during(look: Look, start: float, end: float) -> float:
    """Square root of the duration of a push as a share of the motion."""
    return float(np.sqrt((end - start) / look.t[-1]))


def _draw_force(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    start, end = _moment(rng, look)
    way = rng.standard_normal(3)
    arm = np.maximum(look.lever, 0.05)
    size = float((look.floor / arm).min()) / _during(look, start, end)
    return {"force": (size * way / np.linalg.norm(way)).tolist(), "start": start, "end": end}


def _force(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    force: Vector = np.array(parameters["force"])
    start, end = number(parameters, "start"), number(parameters, "end")

    def hook(live: Live) -> None:
        if start <= live.t < end:
            body = live.last_link
            arm = live.data.site_xpos[live.tool] - live.data.xipos[body]
            live.data.xfrc_applied[body, :3], live.data.xfrc_applied[body, 3:] = force, np.cross(arm, force)

    plan.hooks.append(hook)


def _draw_push(rng: Rng, look: Look, seat: Seat) -> Parameters:
    start, end = _moment(rng, look)
    return {"torque": sign(rng) * _floor(look, seat) / _during(look, start, end), "start": start, "end": end}


def _push(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    joint, torque = joint_of(seat), number(parameters, "torque")
    start, end = number(parameters, "start"), number(parameters, "end")

    def hook(live: Live) -> None:
        if start <= live.t < end:
            live.added[joint] += torque

    plan.hooks.append(hook)


LAWS = (
    Law("rotor_inertia", _draw_rotor, _rotor, grows=("inertia",), same=_as_link),
    Law("payload", _draw_payload, _payload, whole, grows=("mass",), suits=_is_carried),
    Law("link_mass", _draw_link, _link, about_one=("scale",), suits=_link_is_left, same=_as_payload),
    Law("base_tilt", _draw_tilt, _tilt, whole, grows=("roll", "pitch")),
    Law("joint_spring", _draw_spring, _spring, grows=("stiffness",), suits=_turns),
    Law("backlash", _draw_gap, _gap, _loaded, grows=("gap",), suits=_changes_flank, tool_only=True),
    Law("joint_elasticity", _draw_elastic, _elastic, _loaded, shrinks=("stiffness", "damping"), weak=("damping",), suits=_bends_to_and_fro, tool_only=True),
    Law("joint_clearance", _draw_clearance, _clearance, _loaded, grows=("clearance",), suits=_force_turns, tool_only=True),
    Law("link_flexure", _draw_bend, _bend, _long_between, shrinks=("stiffness",), suits=_bends_to_and_fro, tool_only=True),
    Law("link_length", _draw_length, _length, _long, grows=("offset",), same=_as_long),
    Law("torque_ripple", _draw_ripple, _ripple, grows=("amplitude",), suits=_ripples_slowly),
    Law("external_force", _draw_force, _force, whole, grows=("force",)),
    Law("external_torque", _draw_push, _push, grows=("torque",)),
)
"""The kinds of what is built in or acts."""
