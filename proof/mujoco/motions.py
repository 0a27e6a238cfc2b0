"""What the arm is told to do: sums of sines, points with dwells, slow sweeps; scaled to the limits of each joint.

A motion is a table of position, velocity and acceleration, one row a servo cycle, which begins and ends at rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arms import Arm, Joint, Rng, Vector
from rigid import Rigid

CYCLE = 1e-3
"""Time between two rows, s."""
LEAD_IN = 0.6
"""The arm stands this long before the recording begins, s."""
SPAN = 1.0
"""Largest distance of a joint from its home, rad."""


@dataclass(frozen=True)
class Motion:
    """Rows from `-LEAD_IN` on, one a cycle."""

    family: str
    q: Vector
    v: Vector
    a: Vector


@dataclass(frozen=True)
class Room:
    """What one joint may do."""

    home: float
    reach: float
    speed: float
    acceleration: float


def draw(arm: Arm, family: str, duration: float, still: set[int], rng: Rng) -> Motion:
    """A motion of `family`; the joints in `still` stay where they are. It asks for no torque beyond nine tenths of the limits."""
    haste = rng.uniform(0.5, 0.95)
    columns = [
        np.zeros(round(duration / CYCLE)) if number in still else _FAMILIES[family](_room(joint, haste, rng), duration, rng)
        for number, joint in enumerate(arm.joints)
    ]
    starts = np.array([joint.home for joint in arm.joints])
    return _slow_enough(arm, family, starts + np.array(columns).T)


def rest(arm: Arm, shape: Motion, share: float, joint: int, rng: Rng) -> Motion:
    """`shape` with one joint that stands for `share` of the time: its motion is run through in the rest of it."""
    rows = len(shape.q)
    moving = max(int(rows * (1.0 - share)), 2)
    pause = rng.uniform(0.3, 0.7)
    before = int(moving * pause)
    clock = np.concatenate([np.arange(before), np.full(rows - moving, before), np.arange(before, moving)])
    # It slows down to rest and speeds up again without a jump.
    clock = np.convolve(np.pad(clock, 200, mode="edge"), np.hanning(401) / np.hanning(401).sum(), mode="valid")
    q = shape.q.copy()
    q[:, joint] = np.interp(clock / moving * rows, np.arange(rows), shape.q[:, joint])
    return _derived(shape.family, q)


def _room(joint: Joint, haste: float, rng: Rng) -> Room:
    return Room(joint.home, SPAN * rng.uniform(0.5, 1.0), haste * joint.velocity, 0.8 * haste * joint.acceleration)


def _window(count: int) -> Vector:
    """Rises from nothing to one within a second, and falls again at the end."""
    edge = min(1000, count // 4)
    ramp = np.linspace(0.0, 1.0, edge)
    smooth = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    return np.concatenate([smooth, np.ones(count - 2 * edge), smooth[::-1]])


def _sines(room: Room, duration: float, rng: Rng) -> Vector:
    """Five sines of whole cycles."""
    t = np.arange(round(duration / CYCLE)) * CYCLE
    harmonics = rng.choice(np.arange(2, 14), 5, replace=False)
    weights, phases = rng.uniform(0.3, 1.0, 5) / np.sqrt(harmonics), rng.uniform(0, 2 * np.pi, 5)
    wave = sum(w * np.sin(2 * np.pi * h * t / duration + p) for w, h, p in zip(weights, harmonics, phases, strict=True))
    return _scaled(wave * _window(len(t)), room)


def _points(room: Room, duration: float, rng: Rng) -> Vector:
    """From point to point by polynomials of the fifth order, with dwells between them."""
    count = round(duration / CYCLE)
    wave, here, row = np.zeros(count), 0.0, 400
    while row < count - 3000:
        there = rng.uniform(-room.reach, room.reach)
        time = max(1.9 * abs(there - here) / room.speed, np.sqrt(5.8 * abs(there - here) / room.acceleration), 0.2)
        rows = min(int(time * rng.uniform(1.0, 1.6) / CYCLE), count - row - 1)
        s = np.linspace(0.0, 1.0, rows)
        wave[row : row + rows] = here + (there - here) * s**3 * (10 - 15 * s + 6 * s**2)
        wave[row + rows :] = there
        here, row = there, row + rows + int(rng.uniform(0.1, 0.9) / CYCLE)
    return wave


def _sweeps(room: Room, duration: float, rng: Rng) -> Vector:
    """To and fro at constant speeds, each leg at its own."""
    count = round(duration / CYCLE)
    wave, here, row, side = np.zeros(count), 0.0, 200, rng.choice([-1.0, 1.0])
    while row < count - 1500:
        there = side * room.reach * rng.uniform(0.4, 1.0)
        speed = room.speed * np.exp(rng.uniform(np.log(0.08), np.log(0.8)))
        rows = min(int(max(abs(there - here) / speed, 0.3) / CYCLE), count - row - 1)
        wave[row : row + rows] = np.linspace(here, there, rows)
        wave[row + rows :] = there
        here, row, side = there, row + rows, -side
    kernel = np.hanning(241)
    return np.convolve(np.pad(wave, 120, mode="edge"), kernel / kernel.sum(), mode="valid")


_FAMILIES = {"sines": _sines, "points": _points, "sweeps": _sweeps}
FAMILIES = tuple(_FAMILIES)
"""Names of the families."""


def _scaled(wave: Vector, room: Room) -> Vector:
    """`wave` as large as the room allows."""
    speed = np.abs(np.gradient(wave, CYCLE)).max()
    acceleration = np.abs(np.gradient(np.gradient(wave, CYCLE), CYCLE)).max()
    return wave * min(room.reach / np.abs(wave).max(), room.speed / speed, room.acceleration / acceleration)


def _slow_enough(arm: Arm, family: str, q: Vector) -> Motion:
    """The motion `q`, made smaller about its start until no joint needs more than nine tenths of its torque."""
    rigid, limits = Rigid(arm), np.array([0.9 * joint.effort for joint in arm.joints])
    start = q[0].copy()
    for _ in range(8):
        motion = _derived(family, q)
        some = slice(None, None, 20)
        needed = np.abs(rigid.torques(motion.q[some], motion.v[some], motion.a[some])).max(axis=0)
        if (needed <= limits).all():
            return motion
        q = start + 0.8 * (q - start)
    return motion


def _derived(family: str, q: Vector) -> Motion:
    """With the lead-in at rest, and with derivatives."""
    q = np.concatenate([np.repeat(q[:1], round(LEAD_IN / CYCLE), axis=0), q])
    kernel = np.hanning(31)[:, None] / np.hanning(31).sum()
    padded = np.pad(q, ((15, 15), (0, 0)), mode="edge")
    q = sum(kernel[k] * padded[k : k + len(q)] for k in range(31))
    v = np.gradient(q, CYCLE, axis=0)
    return Motion(family, q, v, np.gradient(v, CYCLE, axis=0))
