"""Families of cases, each for one question: dry friction of an arm that rests at times, and pushes."""

from __future__ import annotations

import numpy as np

import arms
import files
import machine
import motions
import sensors
import strength
import tolerances
from arms import Rng
from cases import LAWS, Bench, Effect, Made, NotMade
from laws import Parameters, Seat, spread

LEVELS = tuple(sensors.LEVELS)


def friction(seed: int) -> Made:
    """A small arm of six axes with Coulomb friction of 1 to 10 N·m at one joint, which rests for up to half of the time. The data sheet names no friction."""
    rng = np.random.default_rng([seed, 5])
    joint, share = int(rng.integers(3)), float(rng.uniform(0.0, 0.5))
    coulomb, bandwidth = float(rng.uniform(1.0, 10.0)), spread(rng, 10.0, 50.0)
    noise = str(rng.choice(LEVELS))
    sheet = arms.ur5(rng)
    drawn = tolerances.draw(sheet, rng)
    chain = sensors.draw(sheet, noise, drawn.zero, drawn.delays, rng)
    servo = machine.Servo(bandwidth, 1.0, chain.encoder_step, False)
    duration = float(rng.uniform(12, 20))
    shapes = [motions.draw(sheet, "sines", duration, set(), rng) for _ in range(2)]
    both = tuple(motions.rest(sheet, shape, share, joint, rng) for shape in shapes)
    bench = Bench("ur5_like", sheet, drawn, chain, servo, both, duration, noise)
    effect = Effect(LAWS["coulomb_friction"], joint, {"coulomb": coulomb}, "strong", 10.0, f"tau{joint + 1}")
    recordings = _recordings(bench, [effect], rng)
    details = {"rest": share, "bandwidth": bandwidth}
    return Made(sheet, files.toml(sheet), recordings, _truth(bench, [effect], seed) | details)


def pushes(seed: int) -> Made:
    """One recording with one to six pushes on joints or on the tool. Every third one has no push."""
    for attempt in range(12):
        rng = np.random.default_rng([seed, 6, attempt])
        bench = Bench.draw(str(rng.choice(LEVELS)), rng)
        bench.motions = bench.motions[:1]
        try:
            count = 0 if seed % 3 == 0 else int(rng.integers(1, 7))
            effects = _pushes(bench, count, rng)
            recordings = _recordings(bench, effects, rng)
        except (machine.MachineError, NotMade):
            continue
        return Made(bench.sheet, files.toml(bench.sheet), recordings, _truth(bench, effects, seed))
    raise NotMade("none of the drawn arms permits the requested pushes")


def _pushes(bench: Bench, count: int, rng: Rng) -> list[Effect]:
    """`count` pushes of 2 to 10 floors that do not overlap."""
    plain = bench.run(bench.plan([]), bench.motions[0])
    look, _ = strength.look(bench.sheet, bench.chain, bench.plan([]).senses, plain)
    slots = rng.permutation(12)[:count]
    width = bench.duration / 12
    effects = []
    for slot in sorted(int(slot) for slot in slots):
        length = spread(rng, 0.05, 0.5)
        start = slot * width + rng.uniform(0.1, max(width - length - 0.1, 0.11))
        floors = float(rng.uniform(2, 10))
        joint = int(rng.integers(bench.sheet.dof))
        seat: Seat = None if rng.random() < 0.3 else joint
        parameters: Parameters = {"start": start, "end": start + length}
        if seat is None:
            way = rng.standard_normal(3)
            # Strength in floors, in the channel with the strongest response to the force.
            size = floors * float((look.floor / np.maximum(look.lever, 0.05)).min())
            parameters["force"] = (size * way / np.linalg.norm(way)).tolist()
        else:
            parameters["torque"] = float(rng.choice([-1.0, 1.0]) * floors * look.floor[joint])
        law = LAWS["external_force" if seat is None else "external_torque"]
        effects.append(Effect(law, seat, parameters, "clear", floors, "tool" if seat is None else f"tau{joint + 1}"))
    return effects


def _recordings(bench: Bench, effects: list[Effect], rng: Rng) -> dict[str, sensors.Recording]:
    plan = bench.plan(effects)
    return {
        name: sensors.record(bench.chain, plan.senses, bench.run(plan, motion), motion, rng)
        for name, motion in zip(("recording.csv", "second.csv"), bench.motions, strict=False)
    }


def _truth(bench: Bench, effects: list[Effect], seed: int) -> dict[str, object]:
    return {
        "schema": "freeplay.truth/1",
        "seed": seed,
        "machine": bench.family,
        "joints": bench.sheet.dof,
        "noise": bench.noise,
        "rate": bench.chain.rate,
        "duration": bench.duration,
        "effects": [effect.truth(bench.sheet) for effect in effects],
    }
