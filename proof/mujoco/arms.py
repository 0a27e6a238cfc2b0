"""Random arms: data sheets of serial arms, from two axes in a vertical plane to seven axes.

A link is a rod along the vector to the next joint, so that every inertia is physical. All numbers are SI, angles in rad.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

GRAVITY = 9.81
"""Gravity of the data sheets, m/s²."""

Vector = np.ndarray
Rng = np.random.Generator


@dataclass(frozen=True)
class Link:
    """A rigid body, in the frame of the joint that moves it."""

    mass: float
    com: Vector
    inertia: Vector
    """About the centre of mass, 3 × 3, kg·m²."""


@dataclass(frozen=True)
class Joint:
    """A revolute joint, its motor and its link. Torques and inertias are those at the output of the gear."""

    name: str
    axis: Vector
    xyz: Vector
    """Place of the joint in the frame of the link before, m."""
    lower: float
    upper: float
    velocity: float
    acceleration: float
    effort: float
    viscous: float
    coulomb: float
    rotor: float
    link: Link
    home: float = 0.0
    """Middle of its motions."""


@dataclass(frozen=True)
class Arm:
    """The data sheet of a serial arm."""

    name: str
    joints: tuple[Joint, ...]
    tool: Vector
    gravity: Vector = field(default_factory=lambda: np.array([0.0, 0.0, -GRAVITY]))

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def way(self, joint: int) -> Vector:
        """The vector from `joint` to the next joint, or to the tool, in the frame of its link."""
        return self.joints[joint + 1].xyz if joint + 1 < self.dof else self.tool

    def with_joint(self, joint: int, **changes: Any) -> Arm:
        """A copy of the arm with changed fields of one joint."""
        joints = list(self.joints)
        joints[joint] = replace(joints[joint], **changes)
        return replace(self, joints=tuple(joints))


@dataclass(frozen=True)
class Pattern:
    """Common properties of the arms in a family. Lengths and masses are those of the largest arm of size 1."""

    axes: str
    """Axis of each joint: `x`, `y` or `z`."""
    ways: tuple[tuple[float, float, float], ...]
    """From the base to joint 1, from each joint to the next, from the last to the tool, m."""
    masses: tuple[float, ...]
    home: tuple[float, ...]


PATTERNS = {
    "planar": Pattern("yy", ((0, 0, 0.8), (0.5, 0, 0), (0.4, 0, 0)), (7.0, 3.5), (0.4, -0.7)),
    "boom": Pattern(
        "zyy", ((0, 0, 0.3), (0, 0.05, 0.25), (0.55, 0, 0), (0.45, 0, 0)), (9.0, 8.0, 4.0), (0.0, 0.2, -0.6)
    ),
    "bench": Pattern(
        "zyyyzy",
        ((0, 0, 0.1), (0, 0.13, 0), (0, -0.12, 0.42), (0, 0, 0.38), (0, 0.09, 0), (0, 0, 0.095), (0, 0.08, 0.06)),
        (3.7, 8.4, 2.3, 1.2, 1.2, 0.4),
        (0.0, 0.6, 0.9, 0.3, 0.2, 0.0),
    ),
    "cell": Pattern(
        "zyyxyx",
        ((0, 0, 0.3), (0.12, 0, 0.2), (0, 0, 0.6), (0.2, 0, 0.1), (0.4, 0, 0), (0.1, 0, 0), (0.12, 0, 0.05)),
        (40.0, 30.0, 18.0, 8.0, 3.0, 1.0),
        (0.0, 0.1, 0.1, 0.2, 0.5, 0.0),
    ),
    "seven": Pattern(
        "zyzyzyz",
        ((0, 0, 0.33), (0, 0, 0.02), (0, 0, 0.3), (0.08, 0, 0.1), (-0.08, 0, 0.3), (0, 0, 0.08), (0.08, 0, 0.02), (0.03, 0, 0.2)),
        (4.0, 3.5, 3.0, 2.5, 2.5, 1.6, 0.8),
        (0.0, 0.5, 0.2, -1.3, 0.2, 1.6, 0.3),
    ),
}
"""The families by name."""

_AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}


def rod(mass: float, way: Vector, rng: Rng) -> Link:
    """A rod with a random centre of mass near the middle of `way`."""
    length = max(float(np.linalg.norm(way)), 0.08)
    radius = length * rng.uniform(0.1, 0.22)
    along = way / length if np.linalg.norm(way) > 1e-9 else _AXES["z"]
    share = rng.uniform(0.3, 0.55)
    com = share * way + rng.uniform(-0.15, 0.15, 3) * radius
    across = mass * (3 * radius**2 + length**2) / 12
    inertia = across * np.eye(3) + (mass * radius**2 / 2 - across) * np.outer(along, along)
    skew = rng.uniform(-0.1, 0.1) * mass * radius**2
    other = np.roll(along, 1)
    inertia = inertia + skew * (np.outer(along, other) + np.outer(other, along)) / 2
    return Link(mass, com, inertia)


def draw(family: str, rng: Rng) -> Arm:
    """Draws an arm of `family`: random size, masses and frictions, and drives that can hold and move it."""
    pattern = PATTERNS[family]
    size = rng.uniform(0.7, 1.2)
    heavy = size**2 * np.exp(rng.uniform(np.log(0.5), np.log(2.0)))
    ways = [np.array(way) * size * rng.uniform(0.9, 1.1) for way in pattern.ways]
    joints = []
    for number, axis in enumerate(pattern.axes):
        link = rod(pattern.masses[number] * heavy * rng.uniform(0.7, 1.3), ways[number + 1], rng)
        joints.append(
            Joint(
                name=f"axis_{number + 1}",
                axis=_AXES[axis],
                xyz=ways[number],
                lower=-2.9,
                upper=2.9,
                velocity=rng.uniform(1.6, 3.2),
                acceleration=rng.uniform(8.0, 18.0),
                effort=0.0,
                viscous=0.0,
                coulomb=0.0,
                rotor=0.0,
                link=link,
                home=pattern.home[number] + rng.uniform(-0.2, 0.2),
            )
        )
    arm = Arm(f"{family}_{rng.integers(1000):03}", tuple(joints), ways[-1])
    return _with_drives(arm, rng)


def _with_drives(arm: Arm, rng: Rng) -> Arm:
    """`arm` with rotors, torque limits and frictions that match its links."""
    from rigid import Rigid  # The rigid model is made from an arm without drives first.

    rigid = Rigid(arm)
    home = np.array([joint.home for joint in arm.joints])
    poses = home + rng.uniform(-0.8, 0.8, (40, arm.dof))
    held = np.abs([rigid.torque(pose, 0 * pose, 0 * pose) for pose in poses]).max(axis=0)
    felt = np.array([np.diag(rigid.inertia(pose)) for pose in poses]).mean(axis=0)
    dry = np.exp(rng.uniform(np.log(0.015), np.log(0.07)))
    for number, joint in enumerate(arm.joints):
        # The rotors of a wrist are small, but not as small as its links.
        rotor = (felt[number] + 0.06 * felt.max()) * np.exp(rng.uniform(np.log(0.15), np.log(1.0)))
        effort = 1.5 * held[number] + 1.3 * (felt[number] + rotor) * joint.acceleration
        arm = arm.with_joint(
            number,
            rotor=_rounded(rotor),
            effort=_rounded(effort),
            coulomb=_rounded(effort * dry * rng.uniform(0.7, 1.4)),
            viscous=_rounded(effort * dry * rng.uniform(0.3, 1.5) / joint.velocity),
        )
    return arm


def _rounded(value: float) -> float:
    """`value` with three digits, as on a data sheet."""
    return float(f"{value:.3g}")


def ur5(rng: Rng) -> Arm:
    """A small arm of six axes with the published lengths and masses of the UR5, and no friction on its data sheet."""
    ways = [(0, 0, 0.0892), (0, 0.1358, 0), (0, -0.1197, 0.425), (0, 0, 0.3923), (0, 0.093, 0), (0, 0, 0.0947), (0, 0.0823, 0)]
    masses = (3.7, 8.393, 2.275, 1.219, 1.219, 0.1879)
    efforts = (150.0, 150.0, 150.0, 28.0, 28.0, 28.0)
    homes = (0.0, 0.6, 0.9, 0.3, 0.2, 0.0)
    vectors = [np.array(way, dtype=float) for way in ways]
    joints = []
    for number, axis in enumerate("zyyyzy"):
        link = rod(masses[number], vectors[number + 1], rng)
        joints.append(
            Joint(
                name=("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")[number],
                axis=_AXES[axis],
                xyz=vectors[number],
                lower=-6.2,
                upper=6.2,
                velocity=3.1,
                acceleration=12.0,
                effort=efforts[number],
                viscous=0.0,
                coulomb=0.0,
                rotor=0.4 if number < 3 else 0.08,
                link=link,
                home=homes[number],
            )
        )
    return Arm("ur5_like", tuple(joints), vectors[-1])
