"""Sensor effects: measured values that differ from the true ones."""

from __future__ import annotations

import numpy as np

from arms import Arm, Rng
from laws import Law, Parameters, Same, Seat, joint_of, number, rms, sign, whole
from plan import Plan
from strength import Look


def _floor(look: Look, seat: Seat) -> float:
    return float(look.floor[joint_of(seat)])


def _draw_offset(rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"offset": sign(rng) * _floor(look, seat)}


def _offset(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.senses.offset[joint_of(seat)] += number(parameters, "offset")


def _as_asymmetric(arm: Arm, seat: Seat, _parameters: Parameters) -> list[Same]:
    return [Same(("asymmetric_friction",), arm.joints[joint_of(seat)].name, "while the joint moves the two are one class")]


def _draw_gain(rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"gain": 1 + sign(rng) * _floor(look, seat) / rms(look.torque[:, joint_of(seat)])}


def _gain(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.senses.gain[joint_of(seat)] *= number(parameters, "gain")


def _is_a_gain(_look: Look, _seat: Seat, parameters: Parameters) -> bool:
    return 0.5 < number(parameters, "gain") < 2.0


def _draw_limit(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    return {"limit": float(np.quantile(np.abs(look.model[:, joint_of(seat)]), 0.95))}


def _limit(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.senses.limit[joint_of(seat)] = number(parameters, "limit")


def _clips_a_little(look: Look, seat: Seat, parameters: Parameters) -> bool:
    """True if the torque of the motion itself is clipped at times, and not only a peak of the servo."""
    over = np.abs(look.model[:, joint_of(seat)]) > number(parameters, "limit")
    return 0.01 < float(over.mean()) < 0.4


def _draw_zero(rng: Rng, look: Look, seat: Seat) -> Parameters:
    joint = joint_of(seat)
    by_tool = (look.tool_floor or np.inf) / max(look.lever[joint], 0.02)
    return {"offset": sign(rng) * min(float(by_tool), 3e-3)}


def _zero(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    offset = number(parameters, "offset")
    plan.senses.reading[joint_of(seat)] = lambda q, _t: q + offset


def _draw_eccentric(rng: Rng, look: Look, seat: Seat) -> Parameters:
    by_tool = (look.tool_floor or np.inf) / max(look.lever[joint_of(seat)], 0.02)
    return {"amplitude": min(1.4 * float(by_tool), 3e-3), "phase": float(rng.uniform(-np.pi, np.pi))}


def _eccentric(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    amplitude, phase = number(parameters, "amplitude"), number(parameters, "phase")
    plan.senses.reading[joint_of(seat)] = lambda q, _t: q + amplitude * np.sin(q + phase)


def _turns_far(look: Look, seat: Seat, parameters: Parameters) -> bool:
    """True if the joint turns far enough that the first harmonic is distinguishable from an offset."""
    return bool(np.ptp(look.q[:, joint_of(seat)]) > 1.4 and number(parameters, "amplitude") < 0.05)


def _draw_delay(rng: Rng, look: Look, _seat: Seat) -> Parameters:
    tool = look.tool_floor is not None and rng.random() < 0.35
    slope = np.gradient(look.torque, look.t, axis=0)
    by_torque = min(float(floor) / rms(slope[:, k]) for k, floor in enumerate(look.floor))
    speed = rms(look.v @ np.maximum(look.lever, 1e-3))
    return {"delay": (look.tool_floor or 0.0) / speed if tool else by_torque, "channel": "tool" if tool else "torque"}


def _delay(plan: Plan, _seat: Seat, parameters: Parameters) -> None:
    if parameters["channel"] == "tool":
        plan.senses.tool_delay += number(parameters, "delay")
    else:
        plan.senses.torque_delay += number(parameters, "delay")


def _is_short(_look: Look, _seat: Seat, parameters: Parameters) -> bool:
    return number(parameters, "delay") < 0.05


def _draw_cutoff(_rng: Rng, look: Look, seat: Seat) -> Parameters:
    slope = np.gradient(look.torque[:, joint_of(seat)], look.t)
    return {"cutoff": rms(slope) / _floor(look, seat) / (2 * np.pi)}


def _cutoff(plan: Plan, seat: Seat, parameters: Parameters) -> None:
    plan.senses.cutoff[joint_of(seat)] = number(parameters, "cutoff")


def _is_a_filter(_look: Look, _seat: Seat, parameters: Parameters) -> bool:
    return 1.0 < number(parameters, "cutoff") < 60.0


LAWS = (
    Law("torque_offset", _draw_offset, _offset, grows=("offset",), same=_as_asymmetric, in_sensors=True),
    Law("torque_gain", _draw_gain, _gain, about_one=("gain",), suits=_is_a_gain, in_sensors=True),
    Law("actuator_saturation", _draw_limit, _limit, shrinks=("limit",), suits=_clips_a_little, in_sensors=True),
    Law("encoder_offset", _draw_zero, _zero, grows=("offset",)),
    Law("encoder_eccentricity", _draw_eccentric, _eccentric, grows=("amplitude",), suits=_turns_far),
    Law("time_delay", _draw_delay, _delay, whole, grows=("delay",), suits=_is_short, in_sensors=True),
    Law("sensor_lowpass", _draw_cutoff, _cutoff, shrinks=("cutoff",), suits=_is_a_filter, in_sensors=True),
)
"""The kinds of faults of sensors."""
