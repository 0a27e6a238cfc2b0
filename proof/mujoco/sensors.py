"""Sensors of a machine: encoders, torques from the motor currents, a tracker on the tool."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arms import Arm, Rng, Vector
from machine import Trace
from motions import CYCLE, LEAD_IN, Motion
from plan import Senses

LEVELS = {"low": 0, "middle": 1, "high": 2}
"""Levels of noise."""
TORQUE = (6e-4, 1.8e-3, 5e-3)
"""Standard deviation of a torque reading as a share of half the joint's largest torque."""
TORQUE_STEP = (3e-5, 2e-4, 8e-4)
"""Step of a torque reading as the same share."""
ENCODER_STEP = (3e-7, 2e-6, 6e-6)
"""Step of an encoder, rad."""
TOOL = (1e-5, 4e-5, 1.2e-4)
"""Standard deviation of the tracker in each direction, m."""
JITTER = (0.0, 0.01, 0.05)
"""Standard deviation of the sampling instants as a share of the time between them."""


@dataclass(frozen=True)
class Chain:
    """The sensors of a machine. `zero` and the two delays are their errors within the tolerances."""

    rate: float
    jitter: float
    torque_noise: Vector
    torque_step: Vector
    encoder_step: Vector
    tool_noise: float | None
    """None: no tracker."""
    link_encoders: bool
    reference: bool
    zero: Vector
    torque_delay: float
    tool_delay: float


@dataclass
class Recording:
    """Columns by name, `t` first."""

    columns: dict[str, Vector]

    def block(self, prefix: str, dof: int) -> Vector | None:
        """The columns `prefix1`… as a matrix, one column for each joint."""
        names = [f"{prefix}{number + 1}" for number in range(dof)]
        if any(name not in self.columns for name in names):
            return None
        return np.array([self.columns[name] for name in names]).T


def draw(arm: Arm, noise: str, zero: Vector, delays: tuple[float, float], rng: Rng) -> Chain:
    """Draws sensors with the noise level `noise` for `arm`."""
    level, half = LEVELS[noise], np.array([0.5 * joint.effort for joint in arm.joints])
    spread = rng.uniform(0.7, 1.3)
    return Chain(
        rate=float(rng.choice([250.0, 250.0, 333.0, 500.0, 500.0, 1000.0])),
        jitter=JITTER[level],
        torque_noise=spread * TORQUE[level] * half,
        torque_step=TORQUE_STEP[level] * half,
        encoder_step=np.full(arm.dof, ENCODER_STEP[level]),
        tool_noise=spread * TOOL[level] if rng.random() < 0.8 else None,
        link_encoders=bool(rng.random() < 0.15),
        reference=bool(rng.random() < 0.8),
        zero=zero,
        torque_delay=delays[0],
        tool_delay=delays[1],
    )


def between(t: Vector, start: float, rows: Vector) -> Vector:
    """Interpolates rows, one for each cycle from `start` on, at the times `t`, by cubics through four rows."""
    at = np.clip((t - start) / CYCLE, 1.0, len(rows) - 3.001)
    row = at.astype(int)
    s = (at - row).reshape(-1, *[1] * (rows.ndim - 1))
    before, here, after, far = (rows[row + k] for k in (-1, 0, 1, 2))
    return here + 0.5 * s * (after - before + s * (2 * before - 5 * here + 4 * after - far + s * (3 * (here - after) + far - before)))


def torques(trace: Trace, senses: Senses, delay: float, t: Vector) -> Vector:
    """Torque readings without noise at the times `t`, one column for each joint."""
    out = np.zeros((len(t), trace.torque.shape[1]))
    for joint in range(out.shape[1]):
        rows = np.clip(trace.torque[:, joint], -senses.limit[joint], senses.limit[joint])
        # A row contains the torque in the middle of its cycle, or after a filter the torque at the end.
        start = trace.t + 0.5 * CYCLE
        if np.isfinite(senses.cutoff[joint]):
            rows, start = _lowpass(rows, senses.cutoff[joint]), trace.t + CYCLE
        out[:, joint] = np.interp(t - delay - senses.torque_delay, start, rows) / senses.gain[joint] + senses.offset[joint]
    return out


def _lowpass(rows: Vector, cutoff: float) -> Vector:
    share, state, out = 1 - np.exp(-2 * np.pi * cutoff * CYCLE), rows[0], np.empty_like(rows)
    for k, value in enumerate(rows):
        state += share * (value - state)
        out[k] = state
    return out


def positions(trace: Trace, senses: Senses, zero: Vector, t: Vector) -> Vector:
    """Readings of the motors' encoders without rounding at the times `t`."""
    q = between(t, trace.t[0], trace.motor)
    for joint, read in senses.reading.items():
        q[:, joint] = [read(value, time) for value, time in zip(q[:, joint], t, strict=True)]
    return q + zero


def tools(trace: Trace, senses: Senses, delay: float, t: Vector) -> Vector:
    """Readings of the tracker without noise at the times `t`."""
    return between(t - delay - senses.tool_delay, trace.t[0], trace.tool)


def record(chain: Chain, senses: Senses, trace: Trace, motion: Motion, rng: Rng) -> Recording:
    """Generates the recording of the sensors `chain`."""
    last = trace.t[-1] - 0.01
    stamps = np.arange(0.0, last, 1.0 / chain.rate) + rng.uniform(0, 1.0 / chain.rate)
    stamps = stamps[stamps < last]
    t = np.maximum(stamps + chain.jitter / chain.rate * np.clip(rng.standard_normal(len(stamps)), -3, 3), 0.0)
    n = trace.motor.shape[1]
    columns = {"t": t}

    def put(prefix: str, block: Vector) -> None:
        columns.update({f"{prefix}{joint + 1}": block[:, joint] for joint in range(n)})

    put("q", _stepped(positions(trace, senses, chain.zero, t), chain.encoder_step))
    clean = torques(trace, senses, chain.torque_delay, t)
    put("tau", _stepped(clean + chain.torque_noise * rng.standard_normal(clean.shape), chain.torque_step))
    if chain.reference:
        put("q_ref", between(t, -LEAD_IN, motion.q))
    if chain.link_encoders:
        put("q_link", _stepped(between(t, trace.t[0], trace.link) + chain.zero, chain.encoder_step))
    if chain.tool_noise is not None:
        tool = tools(trace, senses, chain.tool_delay, t)
        tool = tool + chain.tool_noise * rng.standard_normal(tool.shape)
        columns.update(x=tool[:, 0], y=tool[:, 1], z=tool[:, 2])
    return Recording(columns)


def _stepped(values: Vector, step: Vector) -> Vector:
    return np.round(values / step) * step
