"""Commanded motions: sums of sines, points with dwells, slow sweeps. Each is scaled to the limits of the joints.

A motion is a table of position, velocity and acceleration with one row for each servo cycle. It begins and ends at rest.
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
    """A motion: one row for each cycle, from `-LEAD_IN` on."""

    family: str
    q: Vector
    v: Vector
    a: Vector


@dataclass(frozen=True)
class Room:
    """Motion limits of one joint."""

    home: float
    reach: float
    speed: float
    acceleration: float


def draw(arm: Arm, family: str, duration: float, still: set[int], rng: Rng) -> Motion:
    """Draws a motion of `family`, in which the joints in `still` stand. It needs no torque beyond nine tenths of the limits."""
    haste = rng.uniform(0.5, 0.95)
    columns = [
        np.zeros(round(duration / CYCLE)) if number in still else _FAMILIES[family](_room(joint, haste, rng), duration, rng)
        for number, joint in enumerate(arm.joints)
    ]
    starts = np.array([joint.home for joint in arm.joints])
    return _slow_enough(arm, family, starts + np.array(columns).T)


def rest(arm: Arm, shape: Motion, share: float, joint: int, rng: Rng) -> Motion:
    """`shape` with one joint at rest for `share` of the time. The joint performs its whole motion in the remaining time."""
    rows = len(shape.q)
    moving = max(int(rows * (1.0 - share)), 2)
    pause = rng.uniform(0.3, 0.7)
    before = int(moving * pause)
    clock = np.concatenate([np.arange(before), np.full(rows - moving, before), np.arange(before, moving)])
    # The joint decelerates to rest and accelerates again without a jump.
    clock = np.convolve(np.pad(clock, 200, mode="edge"), np.hanning(401) / np.hanning(401).sum(), mode="valid")
    q = shape.q.copy()
    q[:, joint] = np.interp(clock / moving * rows, np.arange(rows), shape.q[:, joint])
    return _derived(shape.family, q)


def _room(joint: Joint, haste: float, rng: Rng) -> Room:
    return Room(joint.home, SPAN * rng.uniform(0.5, 1.0), haste * joint.velocity, 0.8 * haste * joint.acceleration)


def _window(count: int) -> Vector:
    """A window that rises from zero to one within a second, and falls to zero at the end."""
    edge = min(1000, count // 4)
    ramp = np.linspace(0.0, 1.0, edge)
    smooth = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    return np.concatenate([smooth, np.ones(count - 2 * edge), smooth[::-1]])


def _sines(room: Room, duration: float, rng: Rng) -> Vector:
    """Sum of five sines with whole numbers of cycles."""
    t = np.arange(round(duration / CYCLE)) * CYCLE
    harmonics = rng.choice(np.arange(2, 14), 5, replace=False)
    weights, phases = rng.uniform(0.3, 1.0, 5) / np.sqrt(harmonics), rng.uniform(0, 2 * np.pi, 5)
    wave = sum(w * np.sin(2 * np.pi * h * t / duration + p) for w, h, p in zip(weights, harmonics, phases, strict=True))
    return _scaled(wave * _window(len(t)), room)


def _points(room: Room, duration: float, rng: Rng) -> Vector:
    """Fifth-order polynomials from point to point, with dwells between them."""
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
    """Sweeps in both directions, each at its own constant speed."""
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
    """`wave`, scaled to the limits of the joint."""
    speed = np.abs(np.gradient(wave, CYCLE)).max()
    acceleration = np.abs(np.gradient(np.gradient(wave, CYCLE), CYCLE)).max()
    return wave * min(room.reach / np.abs(wave).max(), room.speed / speed, room.acceleration / acceleration)


def _slow_enough(arm: Arm, family: str, q: Vector) -> Motion:
    """The motion `q`, reduced about its start until no joint needs more than nine tenths of its torque limit."""
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
    """Adds the lead-in at rest, and the derivatives."""
    q = np.concatenate([np.repeat(q[:1], round(LEAD_IN / CYCLE), axis=0), q])
    kernel = np.hanning(31)[:, None] / np.hanning(31).sum()
    padded = np.pad(q, ((15, 15), (0, 0)), mode="edge")
    q = sum(kernel[k] * padded[k : k + len(q)] for k in range(31))
    v = np.gradient(q, CYCLE, axis=0)
    return Motion(family, q, v, np.gradient(v, CYCLE, axis=0))
