"""Generates a case: data sheet, recordings and true effects, for the properties in an `Ask`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

import arms
import body_laws
import files
import friction_laws
import machine
import motions
import outside_laws
import sensor_laws
import sensors
import strength
import tolerances
from arms import Arm, Rng
from laws import Law, Parameters, Seat
from motions import Motion
from plan import Plan
from sensors import Recording
from strength import Look, Residual

LAWS = {law.kind: law for law in friction_laws.LAWS + body_laws.LAWS + sensor_laws.LAWS + outside_laws.LAWS}
"""Every kind by its name."""
CATALOGUE = tuple(kind for kind, law in LAWS.items() if law.catalogued)
"""The kinds that have a name."""
OUTSIDE = tuple(kind for kind, law in LAWS.items() if not law.catalogued)
"""The kinds that have none."""
EVENTS = ("external_force", "external_torque", "load_drop", "encoder_slip")
"""What happens once: the second recording is without it."""
SEVERITIES = {"slight": (1.6, 2.4), "clear": (3.5, 5.0), "strong": (8.0, 12.0)}
"""Signal to floor by name."""
ATTEMPTS = 8
"""Other arms, motions and places that are tried where an effect does not show."""
ROUNDS = 4
"""Sizes that are tried until the signal is as strong as asked for."""
PLACES = 2
"""Places that are tried on one arm."""
NEARER = 0.7
"""A trial that does not leave less than this share of the gap before it, in logarithms, is the last at its place."""
NEAR = 0.2
"""How near the ratio must come, as a fraction."""
SECOND = 0.85
"""Share of cases with a second recording."""


class NotMade(Exception):
    """None of the drawn arms shows the requested effects."""


@dataclass(frozen=True)
class Ask:
    """Requested properties of a case."""

    sort: str
    """`single`, `negative`, `unknown` or `double`."""
    kinds: tuple[str, ...]
    severities: tuple[str, ...]
    noise: str
    seed: int

    def words(self) -> str:
        """The concealed effects in words."""
        return " + ".join(self.kinds) or "nothing"


@dataclass(frozen=True)
class Effect:
    """An effect with its size."""

    law: Law
    seat: Seat
    parameters: Parameters
    severity: str
    ratio: float
    channel: str

    def truth(self, sheet: Arm) -> dict[str, object]:
        """The effect in the format of a truth file."""
        same = self.law.same(sheet, self.seat, self.parameters)
        return {
            "kind": self.law.kind,
            "joint": None if self.seat is None else sheet.joints[self.seat].name,
            "parameters": self.parameters,
            "weak": list(self.law.weak),
            "equivalents": [{"kinds": list(it.kinds), "joint": it.joint, "why": it.why} for it in same],
            "catalogued": self.law.catalogued,
            "severity": self.severity,
            "signal_to_floor": round(self.ratio, 3),
            "channel": self.channel,
        }


@dataclass
class Made:
    """A case."""

    sheet: Arm
    model: str
    """The arm file."""
    recordings: dict[str, Recording]
    truth: dict[str, object] = field(default_factory=dict)


@dataclass
class Bench:
    """An arm with its motion, servo and sensors, without effects."""

    family: str
    sheet: Arm
    drawn: tolerances.Drawn
    chain: sensors.Chain
    servo: machine.Servo
    motions: tuple[Motion, ...]
    duration: float
    noise: str

    @staticmethod
    def draw(noise: str, rng: Rng) -> Bench:
        """Draws everything except the level of noise."""
        family = str(rng.choice(list(arms.PATTERNS)))
        sheet = arms.draw(family, rng)
        drawn = tolerances.draw(sheet, rng)
        chain = sensors.draw(sheet, noise, drawn.zero, drawn.delays, rng)
        servo = machine.Servo(rng.uniform(22, 45), rng.uniform(0.5, 4), chain.encoder_step, bool(rng.random() < 0.8))
        duration = float(rng.uniform(11, 20))
        # In one case of six a joint stands still, as in many recordings of real machines.
        still = {int(rng.integers(sheet.dof))} if sheet.dof > 2 and rng.random() < 0.17 else set()
        both = tuple(motions.draw(sheet, str(rng.choice(motions.FAMILIES)), duration, still, rng) for _ in range(2))
        return Bench(family, sheet, drawn, chain, servo, both[: 2 if rng.random() < SECOND else 1], duration, noise)

    def plan(self, effects: list[Effect]) -> Plan:
        """The machine with `effects`."""
        plan = Plan.plain(self.drawn.arm)
        for effect in effects:
            effect.law.build(plan, effect.seat, effect.parameters)
        return plan

    def run(self, plan: Plan, motion: Motion) -> machine.Trace:
        """The trace of the machine in `motion`."""
        return machine.run(plan, self.sheet, self.servo, motion)


def make(ask: Ask) -> Made:
    """Generates the case for `ask`. The same `ask` gives the same numbers.

    Raises NotMade if no arm shows the effects with the requested strength.
    """
    why = "no sensors that show it were drawn"
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([ask.seed, attempt])
        bench = Bench.draw(ask.noise, rng)
        if bench.chain.tool_noise is None and any(LAWS[kind].tool_only for kind in ask.kinds):
            continue
        try:
            return _make_on(bench, ask, rng)
        except (NotMade, machine.MachineError) as error:
            why = str(error)
    raise NotMade(why)


def _make_on(bench: Bench, ask: Ask, rng: Rng) -> Made:
    plain = bench.run(bench.plan([]), bench.motions[0])
    look, without = strength.look(bench.sheet, bench.chain, bench.plan([]).senses, plain)
    effects: list[Effect] = []
    traces = [plain]
    for kind, severity in zip(ask.kinds, ask.severities, strict=True):
        taken = {effect.seat for effect in effects if effect.seat is not None}
        effect, trace = _concealed(bench, LAWS[kind], severity, look, without, plain, taken, rng)
        effects.append(effect)
        traces.append(trace)
    recordings = {}
    for name, motion in zip(("recording.csv", "second.csv"), bench.motions, strict=False):
        some = [effect for effect in effects if name == "recording.csv" or effect.law.kind not in EVENTS]
        plan = bench.plan(some)
        # With at most one effect, the trace of the first motion exists already.
        done = name == "recording.csv" and len(effects) < 2
        trace = traces[-1] if done else bench.run(plan, motion)
        recordings[name] = sensors.record(bench.chain, plan.senses, trace, motion, rng)
    truth = {
        "schema": "freeplay.truth/1",
        "seed": ask.seed,
        "machine": bench.family,
        "joints": bench.sheet.dof,
        "noise": ask.noise,
        "families": [motion.family for motion in bench.motions],
        "rate": bench.chain.rate,
        "duration": bench.duration,
        "effects": [effect.truth(bench.sheet) for effect in effects],
    }
    return Made(bench.sheet, files.toml(bench.sheet), recordings, truth)


def _concealed(
    bench: Bench, law: Law, severity: str, look: Look, without: Residual, plain: machine.Trace, taken: set[int], rng: Rng
) -> tuple[Effect, machine.Trace]:
    """An effect of `law` with the requested strength, at a place where the motion shows it, and the trace of the machine with it."""
    seats = [seat for seat in law.seats(bench.sheet) if seat is None or (seat not in taken and look.moving[seat] > 0.1)]
    rng.shuffle(seats)
    target = float(rng.uniform(*SEVERITIES[severity]))
    for seat in seats[:PLACES]:
        for effect, trace in _sizes(bench, law, seat, target, severity, look, without, plain, rng):
            if abs(effect.ratio / target - 1) < NEAR:
                return effect, trace
    raise NotMade(f"{law.kind} does not reach {target:.1f} times the floor on {bench.sheet.name}")


def _sizes(
    bench: Bench, law: Law, seat: Seat, target: float, severity: str, look: Look, without: Residual, plain: machine.Trace, rng: Rng
) -> Iterator[tuple[Effect, machine.Trace]]:
    """Yields the effect in several sizes with the traces of the machine. Each size approaches `target`."""
    parameters = law.scaled(law.draw(rng, look, seat), target if not law.in_sensors or law.grows else 1.0)
    tried: list[tuple[float, float]] = []
    size = 0.0
    for _ in range(ROUNDS):
        if not law.suits(look, seat, parameters):
            return
        plan = bench.plan([])
        law.build(plan, seat, parameters)
        trace = plain if law.in_sensors else bench.run(plan, bench.motions[0])
        effect, _ = strength.residual(bench.sheet, bench.chain, plan.senses, trace)
        ratio, channel = strength.ratio(look, without, effect, law.tool_only)
        yield Effect(law, seat, parameters, severity, ratio, channel), trace
        gap = float(np.log(max(ratio, 1e-3) / target))
        if tried and abs(gap) > NEARER * abs(tried[-1][1] - np.log(target)):
            return
        step = _step(tried, size, gap + float(np.log(target)), float(np.log(target)))
        size += step
        parameters = law.scaled(parameters, float(np.exp(step)))


def _step(tried: list[tuple[float, float]], size: float, reached: float, wanted: float) -> float:
    """Change of the size's logarithm, from the slope between the last two trials."""
    slope = 1.0
    if tried and abs(size - tried[-1][0]) > 1e-6:
        slope = float(np.clip((reached - tried[-1][1]) / (size - tried[-1][0]), 0.4, 20.0))
    tried.append((size, reached))
    return float(np.clip((wanted - reached) / slope, -1.6, 1.6))
