"""Draws the errors of a data sheet, within the assumed tolerances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from arms import Arm, Rng, Vector

INERTIA = 0.02
"""Mass and inertia of a link, as a fraction."""
FRICTION = 0.05
"""Friction of a joint, as a fraction."""
ZERO = 1e-4
"""Zero of an encoder, rad."""
LENGTH = 1e-4
"""Length between two joints, m."""
DELAY = 6e-4
"""Delay of torques, and of the tool, against the encoders, s."""


@dataclass(frozen=True)
class Drawn:
    """A true arm and the errors of its sensors."""

    arm: Arm
    zero: Vector
    delays: tuple[float, float]


def draw(sheet: Arm, rng: Rng) -> Drawn:
    """Draws the true arm of `sheet`: every number is within nine tenths of its tolerance."""

    def within(tolerance: float) -> float:
        return float(rng.uniform(-0.9, 0.9) * tolerance)

    joints = []
    for joint in sheet.joints:
        mass, inertia = 1 + within(INERTIA), 1 + within(INERTIA)
        link = replace(joint.link, mass=joint.link.mass * mass, inertia=joint.link.inertia * inertia)
        joints.append(
            replace(
                joint,
                link=link,
                xyz=longer(joint.xyz, within(LENGTH)),
                viscous=joint.viscous * (1 + within(FRICTION)),
                coulomb=joint.coulomb * (1 + within(FRICTION)),
            )
        )
    arm = replace(sheet, joints=tuple(joints), tool=longer(sheet.tool, within(LENGTH)))
    zero = np.array([within(ZERO) for _ in joints])
    return Drawn(arm, zero, (within(DELAY), within(DELAY)))


def longer(way: Vector, amount: float) -> Vector:
    """The vector `way`, longer by `amount`. A zero vector stays unchanged."""
    length = float(np.linalg.norm(way))
    return way if length < 1e-6 else way * (1 + amount / length)
