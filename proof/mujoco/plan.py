"""Description of a machine: the true arm, its built-in effects, the actions during the run, and its sensors.

An effect sets its fields; `machine` builds and runs the result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from arms import Arm, Vector

if TYPE_CHECKING:
    from machine import Live

Hook = Callable[["Live"], None]
"""Acts on the machine once a servo cycle."""
Reading = Callable[[float, float], float]
"""What an encoder reads, rad, for the motor's position and the time."""


@dataclass(frozen=True)
class Shaft:
    """A shaft with the speed `v_joint + sign v_other`."""

    joint: int
    other: int
    sign: float
    inertia: float
    viscous: float
    coulomb: float


@dataclass
class Body:
    """Built-in effects. Fields by joint have no entry for a joint without effect."""

    gap: dict[int, float] = field(default_factory=dict)
    """Full gap between motor and link, rad."""
    elastic: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Spring, N·m/rad, and damper, N·m·s/rad, between motor and link."""
    clearance: dict[int, float] = field(default_factory=dict)
    """Radius within which the journal is free in the plane across the axis, m."""
    bend: dict[int, float] = field(default_factory=dict)
    """Force over deflection at the far end of the link, N/m."""
    bristle: dict[int, float] = field(default_factory=dict)
    """Stiffness of the dry friction before it slides, N·m/rad."""
    spring: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Spring between a link and the one before, N·m/rad, and its position of rest, rad."""
    loads: list[tuple[float, Vector]] = field(default_factory=list)
    """Masses fixed to the last link, kg, and their places, m."""
    shafts: list[Shaft] = field(default_factory=list)
    pendulum: tuple[float, float, float] | None = None
    """Mass, kg, length, m, and damping, N·m·s/rad, of a pendulum on the last link."""
    rope: tuple[float, float, Vector] | None = None
    """Stiffness, N/m, free length, m, and place in the base frame of a rope to the tool."""
    bump: tuple[int, float, float] | None = None
    """Joint, its position, rad, and stiffness, N·m/rad, of an elastic stop."""
    mount: tuple[float, float] | None = None
    """Natural frequency, Hz, and damping ratio of the base that rocks."""

    @property
    def is_fast(self) -> bool:
        """True if the machine has stiff elements, which need short steps."""
        return bool(self.gap or self.elastic or self.clearance or self.bend or self.bristle or self.pendulum)


@dataclass
class Senses:
    """Effects of the sensors, except noise. Arrays have one element for each joint."""

    gain: Vector
    """True over measured torque."""
    offset: Vector
    limit: Vector
    cutoff: Vector
    """First-order low-pass of a torque reading, Hz; infinite for none."""
    torque_delay: float = 0.0
    tool_delay: float = 0.0
    reading: dict[int, Reading] = field(default_factory=dict)

    @staticmethod
    def plain(dof: int) -> Senses:
        """Sensors without effects."""
        never = np.full(dof, np.inf)
        return Senses(np.ones(dof), np.zeros(dof), never.copy(), never.copy())


@dataclass
class Plan:
    """A machine."""

    arm: Arm
    """With true masses, lengths and frictions."""
    body: Body
    senses: Senses
    hooks: list[Hook] = field(default_factory=list)

    @staticmethod
    def plain(arm: Arm) -> Plan:
        """`arm` without effects."""
        return Plan(arm, Body(), Senses.plain(arm.dof))
