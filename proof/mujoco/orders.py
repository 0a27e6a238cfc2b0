"""Performs orders: sealed cases for `freeplay blind`, and open cases for development.

`proof/mujoco/README.md` contains the contract of a generator.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TextIO

import draw
import families
import files
import servos
import setup_faults
from cases import CATALOGUE, Ask, Made, NotMade, make
from draw import Quota

SCHEMA = "freeplay.generator/1"
"""The schema of an order."""
Outcome = dict[str, object]
"""`{"Made": {…}}` or `{"NotMade": {…}}`."""


def sealed(folder: str, name: str, task: Callable[[], Made], words: str) -> Outcome:
    """Generates a case in `folder/name`. Only the returned value contains the true effects."""
    try:
        made = task()
    except NotMade as error:
        return {"NotMade": {"asked": words, "why": str(error)}}
    files.write(Path(folder) / name, made.model, made.recordings)
    return {"Made": {"name": name, "truth": made.truth}}


def answer(order: TextIO, out: TextIO) -> int:
    """Performs the order from the stream `order`, and writes the outcome of each case to `out`."""
    try:
        asked = json.load(order)
        quota, seed, folder = Quota(**asked["quota"]), int(asked["seed"]), str(asked["folder"])
        wanted = [(int(case["index"]), str(case["name"])) for case in asked["cases"]]
        known = asked["schema"] == SCHEMA
        of_servos = asked.get("family") == "servos"
    except (ValueError, KeyError, TypeError) as error:
        known, why = False, repr(error)
    else:
        why = f"schema {asked['schema']!r}"
    if not known:
        print(f"standard input contains no order with the schema {SCHEMA}: {why}", file=sys.stderr)
        return 3
    drawn = of_servos_drawn(quota, seed) if of_servos else [(partial(make, ask), ask.words()) for ask in draw.draw(quota, seed)]
    tasks: dict[int, Callable[[], Outcome]] = {index: partial(sealed, folder, name, *drawn[index]) for index, name in wanted}

    def tell(index: int, outcome: Outcome | None) -> None:
        out.write(json.dumps([index, outcome]) + "\n")
        out.flush()

    for index in tasks:
        tell(index, None)
    for index, outcome in spread(tasks, int(asked.get("jobs", 1))):
        tell(index, outcome)
    return 0


def of_servos_drawn(quota: Quota, seed: int) -> list[tuple[Callable[[], Made], str]]:
    """The servo machines of a set: a function that generates each, and its concealed effects in words."""
    return [(partial(servos.make, *ask), f"servos, {ask[0]}, {ask[1]}") for ask in servos.drawn(asdict(quota), seed)]


def spread(tasks: dict[int, Callable[[], Outcome]], jobs: int) -> Iterator[tuple[int, Outcome]]:
    """Runs the tasks in `jobs` processes, and yields each result when its task ends."""
    if jobs <= 1:
        for index, task in tasks.items():
            yield index, task()
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(task): index for index, task in tasks.items()}
        for done in as_completed(running):
            yield running[done], done.result()


def opened(folder: str, name: str, task: Callable[[], Made], asked: str) -> Outcome:
    """Generates a case in `folder/name`, with its true effects."""
    try:
        made = task()
    except NotMade as error:
        return {"NotMade": {"asked": asked, "why": str(error)}}
    place = Path(folder) / name
    files.write(place, made.model, made.recordings)
    (place / "arm.urdf").write_text(files.urdf(made.sheet))
    (place / "truth.json").write_text(json.dumps(made.truth, indent=1) + "\n")
    return {"Made": {"name": name, "truth": made.truth}}


def quota_of(asked: argparse.Namespace) -> Quota:
    """The quota in the command line."""
    counts = {name: getattr(asked, name) for name in ("single", "negative", "unknown", "double")}
    some = {name: count for name, count in counts.items() if count is not None}
    if asked.kind and not some:
        return Quota(single=asked.cases)
    return Quota(**some) if some else Quota.small(asked.cases)


def asks_of(asked: argparse.Namespace) -> list[Ask]:
    """The cases with effects of the catalogue, for the command line."""
    return draw.draw(quota_of(asked), asked.seed, tuple(asked.kind) if asked.kind else CATALOGUE)


def tasks_of(asked: argparse.Namespace) -> list[tuple[Callable[[], Made], str]]:
    """A function for each case of the command line, which generates the case, and the requested effects in words."""
    if asked.family == "servos":
        return of_servos_drawn(quota_of(asked), asked.seed)
    if asked.family == "catalogue":
        return [(partial(make, ask), ask.words()) for ask in asks_of(asked)]
    numbers = range(asked.seed * 100_000, asked.seed * 100_000 + asked.cases)
    if asked.family == "setup":
        kinds = [kind for kind in setup_faults.KINDS if not asked.kind or kind in asked.kind]
        noise = families.LEVELS
        faults = [(kinds[k % len(kinds)], noise[k // len(kinds) % len(noise)], seed) for k, seed in enumerate(numbers)]
        return [(partial(setup_faults.make, *fault), fault[0]) for fault in faults]
    family = {"friction": families.friction, "pushes": families.pushes}[asked.family]
    return [(partial(family, seed), asked.family) for seed in numbers]


def open_cases(asked: argparse.Namespace) -> int:
    """Generates open cases in the folder `asked.out`."""
    tasks: dict[int, Callable[[], Outcome]] = {}
    for number, (task, words) in enumerate(tasks_of(asked)):
        tasks[number] = partial(opened, asked.out, f"{number + 1:04}", task, words)
    for number, outcome in spread(tasks, asked.jobs):
        print(f"{number + 1:04} {json.dumps(outcome)[:160]}", flush=True)
    return 0
