"""Base of the laws: possible places, random sizes, and changes of a plan.

Parameters have the names and units of the catalogue (`docs/effects.md`), so that a truth is comparable with an answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from arms import Arm, Rng
from plan import Plan
from strength import Look

Seat = int | None
"""A joint from 0, or the whole arm."""
Parameters = dict[str, object]


def every(arm: Arm) -> list[Seat]:
    """Every joint."""
    return list(range(arm.dof))


def whole(_arm: Arm) -> list[Seat]:
    """The arm as a whole."""
    return [None]


def always(_look: Look, _seat: Seat, _parameters: Parameters) -> bool:
    """Always true: every motion shows the effect."""
    return True


@dataclass(frozen=True)
class Same:
    """Another effect that explains the recording equally well."""

    kinds: tuple[str, ...]
    joint: str | None
    why: str


def nothing_else(_arm: Arm, _seat: Seat, _parameters: Parameters) -> list[Same]:
    """No equivalent effects."""
    return []


@dataclass(frozen=True)
class Law:
    """A kind of effect."""

    kind: str
    draw: Callable[[Rng, Look, Seat], Parameters]
    """Parameters at which the effect is about as large as the floor."""
    build: Callable[[Plan, Seat, Parameters], None]
    seats: Callable[[Arm], list[Seat]] = every
    grows: tuple[str, ...] = ()
    """Parameters that grow with the strength."""
    shrinks: tuple[str, ...] = ()
    """Parameters that shrink with it."""
    about_one: tuple[str, ...] = ()
    """Factors: their distance from one grows with it."""
    weak: tuple[str, ...] = ()
    """Parameters that leave next to no trace of their own."""
    suits: Callable[[Look, Seat, Parameters], bool] = always
    """Whether the motion can show what is particular about it."""
    same: Callable[[Arm, Seat, Parameters], list[Same]] = nothing_else
    in_sensors: bool = False
    """Whether the machine itself moves as without it."""
    tool_only: bool = False
    """Whether it is judged by the tool alone."""
    catalogued: bool = True

    def scaled(self, parameters: Parameters, factor: float) -> Parameters:
        """A copy of the effect, about `factor` times as strong."""
        scaled = dict(parameters)
        for name in self.grows:
            scaled[name] = (np.asarray(scaled[name], dtype=float) * factor).tolist()
        for name in self.shrinks:
            scaled[name] = float(scaled[name]) / factor  # type: ignore[arg-type]
        for name in self.about_one:
            scaled[name] = 1 + (float(scaled[name]) - 1) * factor  # type: ignore[arg-type]
        return scaled


def number(parameters: Parameters, name: str) -> float:
    """The value of a numeric parameter."""
    return float(parameters[name])  # type: ignore[arg-type]


def rms(values: np.ndarray) -> float:
    """Root mean square, with a tiny lower bound above zero."""
    return float(np.sqrt(np.mean(np.square(values)))) + 1e-9


def sign(rng: Rng) -> float:
    """A random sign, plus or minus one."""
    return float(rng.choice([-1.0, 1.0]))


def spread(rng: Rng, low: float, high: float) -> float:
    """A random number between `low` and `high`, log-uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def joint_of(seat: Seat) -> int:
    """The joint of an effect with one joint."""
    if seat is None:
        raise ValueError("this effect sits on a joint")
    return seat
