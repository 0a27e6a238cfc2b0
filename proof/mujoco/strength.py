"""Strength of an effect: its trace in the recording, relative to noise and tolerances.

The machine runs the same motion with and without the effect. Each run gives the residual of the data sheet against sensors without noise. The trace of
the effect is the difference of the two residuals; the floor is the residual without the effect.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arms import Arm, Vector
from machine import Trace
from plan import Senses
from rigid import Rigid
from sensors import Chain, positions, tools, torques

GRID = 4e-3
"""Time between points, s."""
HALF = 2e-3
"""Half the distance of central differences, s."""
STANDS = 3e-3
"""A joint slower than this share of its largest speed stands."""
SMOOTH = 7
"""Points that a mean is taken over."""


@dataclass(frozen=True)
class Residual:
    """Residuals of the data sheet against the sensors, row by row. Torques are NaN while the joint stands."""

    torque: Vector
    tool: Vector | None


@dataclass(frozen=True)
class Look:
    """The machine without effects: its motion and its floor."""

    sheet: Arm
    t: Vector
    q: Vector
    v: Vector
    a: Vector
    model: Vector
    """Torque of the rigid arm, N·m."""
    torque: Vector
    """Measured torque, N·m."""
    floor: Vector
    """Of torques, N·m."""
    tool_floor: float | None
    lever: Vector
    """Movement of the tool for each joint, m per rad, root mean square."""
    felt: Vector
    """Inertia that each joint feels, kg·m²."""
    moving: Vector
    """Share of the time that each joint moves."""


def residual(sheet: Arm, chain: Chain, senses: Senses, trace: Trace) -> tuple[Residual, tuple[Vector, ...]]:
    """The residual of `sheet`, with t, q, v, a, and the predicted and measured torques."""
    t = np.arange(0.02, trace.t[-1] - 0.02, GRID)
    before, q, after = (positions(trace, senses, chain.zero, t + shift) for shift in (-HALF, 0.0, HALF))
    v, a = (after - before) / (2 * HALF), (after - 2 * q + before) / HALF**2
    rigid = Rigid(sheet)
    model, measured = rigid.torques(q, v, a), torques(trace, senses, chain.torque_delay, t)
    friction = np.array([joint.viscous for joint in sheet.joints]) * v
    friction += np.array([joint.coulomb for joint in sheet.joints]) * np.sign(v)
    speed = np.array([joint.velocity for joint in sheet.joints])
    difference = np.where(np.abs(v) > STANDS * speed, measured - model - friction, np.nan)
    tool = None
    if chain.tool_noise is not None:
        tool = tools(trace, senses, chain.tool_delay, t) - np.array([rigid.tool(row) for row in q])
    return Residual(_smooth(difference), tool), (t, q, v, a, model, measured)


def look(sheet: Arm, chain: Chain, senses: Senses, trace: Trace) -> tuple[Look, Residual]:
    """Motion and floor of the machine without effects, from its trace, and its residual."""
    plain, (t, q, v, a, model, measured) = residual(sheet, chain, senses, trace)
    rigid, some = Rigid(sheet), slice(None, None, 100)
    levers = np.array([rigid.lever(row) for row in q[some]])
    tool_floor = None
    if plain.tool is not None and chain.tool_noise is not None:
        tool_floor = float(np.hypot(_rms(plain.tool) * np.sqrt(3), np.sqrt(3) * chain.tool_noise))
    seen = Look(
        sheet,
        t,
        q,
        v,
        a,
        model,
        measured,
        np.hypot(_column_rms(plain.torque), chain.torque_noise),
        tool_floor,
        np.sqrt((levers**2).sum(axis=1).mean(axis=0)),
        np.mean([rigid.felt(row) for row in q[some]], axis=0),
        np.isfinite(plain.torque).mean(axis=0),
    )
    return seen, plain


def ratio(seen: Look, without: Residual, effect: Residual, tool_only: bool) -> tuple[float, str]:
    """The largest ratio of signal to floor over all channels, and its channel."""
    found = [(0.0, "none")]
    if effect.tool is not None and without.tool is not None and seen.tool_floor is not None:
        found.append((_rms(effect.tool - without.tool) * np.sqrt(3) / seen.tool_floor, "tool"))
    if not tool_only:
        trace = _column_rms(effect.torque - without.torque)
        found += [(float(size / floor), f"tau{k + 1}") for k, (size, floor) in enumerate(zip(trace, seen.floor, strict=True))]
    return max(found)


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _column_rms(values: Vector) -> Vector:
    known = np.isfinite(values)
    return np.sqrt(np.where(known, values, 0.0).__pow__(2).sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def _smooth(values: Vector) -> Vector:
    """Moving average. NaN stays NaN."""
    known = np.isfinite(values)
    kernel = np.ones(SMOOTH)
    out = np.full_like(values, np.nan)
    for column in range(values.shape[1]):
        total = np.convolve(np.where(known[:, column], values[:, column], 0.0), kernel, mode="same")
        count = np.convolve(known[:, column], kernel, mode="same")
        out[:, column] = np.where(known[:, column], total / np.maximum(count, 1), np.nan)
    return out
