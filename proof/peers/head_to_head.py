"""Compares Freeplay with other methods on the same sealed cases.

`python proof/peers/head_to_head.py DIR` reads the folder of `freeplay blind --generator mujoco --out DIR`.

Every method fits to `recording.csv`. `second.csv`, or without it the end of the recording, is held out. The rule for right names is that of
Freeplay. Held-out error: root mean square of measured minus predicted torque in the channels that show the concealed effect, relative to the data sheet.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import given
import methods
import numpy as np
import scores
import signals
from methods import Result
from scores import Json

FAMILIES = {
    "friction": (
        "coulomb",
        "viscous",
        "stribeck",
        "asymmetric",
        "load_dependent",
        "presliding",
        "position_dependent",
        "friction_drift",
        "quadratic",
        "joint_coupling",
    ),
    "inertia, load, spring": ("rotor_inertia", "payload", "link_mass", "base_tilt", "joint_spring", "torque_ripple"),
    "torque sensors": ("torque_offset", "torque_gain", "actuator_saturation", "sensor_lowpass", "time_delay"),
    "gaps, compliance, geometry": ("backlash", "joint_elasticity", "joint_clearance", "link_flexure", "link_length", "encoder"),
    "pushes": ("external",),
}
"""Families of single effects by the beginnings of their kinds."""
METHODS: dict[str, Callable[[signals.Case], Result]] = {
    "least squares": methods.least_squares,
    "PySINDy": methods.sindy,
    "gplearn": methods.symbolic,
}
"""The methods that name by themselves."""
GIVEN = "MuJoCo, structure given"
OURS = "Freeplay"


def family_of(truth: Json) -> str:
    """Family of a case."""
    sort = scores.sort_of(truth)
    if sort != "single":
        return {"negative": "nothing concealed", "double": "two effects", "outside": "outside the catalogue"}[sort]
    kind = truth["effects"][0]["kind"]
    return next(name for name, kinds in FAMILIES.items() if kind.startswith(kinds))


def channels_of(truth: Json) -> list[int]:
    """Joints (from 0) whose torques show the concealed effects. None if only the tool shows them."""
    return [int(effect["channel"][3:]) - 1 for effect in truth["effects"] if effect["channel"].startswith("tau")]


def compare(folder: Path, truth: Json, answer: Json) -> dict[str, Json]:
    """Results of each method on a case: `outcome`, `ratio` of held-out errors (None if no torque shows the effect), `seconds`."""
    case = signals.case_of(folder)
    before = signals.error(case, case.test, case.nominal(case.test))
    rows: dict[str, Json] = {OURS: {"outcome": scores.judge(truth, answer).outcome, "ratio": _ours(truth, answer), "seconds": answer.get("cpu_seconds")}}
    for name, method in METHODS.items():
        start = time.process_time()
        result = method(case)
        effects: list[Json] = [{"kind": kind, "joint": joint, "parameters": {}} for kind, joint in sorted(result.named, key=str)]
        said: Json = {"verdict": "named" if effects else "nothing_missing", "effects": effects}
        after = signals.error(case, case.test, result.predict(case.test))
        rows[name] = {"outcome": scores.judge(truth, said).outcome, "ratio": _ratio(truth, after / before), "seconds": time.process_time() - start}
    known = given.identify(case, truth)
    if known is not None:
        rows[GIVEN] = {"outcome": None, "ratio": _ratio(truth, signals.error(case, case.test, known.predict(case.test)) / before), "seconds": None}
    return rows


def _ratio(truth: Json, by_joint: np.ndarray) -> float | None:
    """Mean ratio over the channels that show the effect, or, without an effect, over all channels with motion."""
    some = by_joint[channels_of(truth)] if truth["effects"] else by_joint
    some = some[np.isfinite(some)]
    return float(np.exp(np.mean(np.log(some)))) if len(some) else None


def _ours(truth: Json, answer: Json) -> float | None:
    """Ratio of Freeplay's tuned model, from the errors in its answer."""
    wanted = [f"tau{channel + 1}" for channel in channels_of(truth)] if truth["effects"] else [name for name in answer["fit"] if name.startswith("tau")]
    found = [answer["fit"][name] for name in wanted if name in answer["fit"]]
    ratios = [errors["after_tuned"] / errors["before"] for errors in found if errors["before"] > 0]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else None


def answer_of(record: Json) -> Json:
    """A receipt's answer, with the field names of `diagnose --format json`."""
    answer = dict(record["answer"])
    answer["alternatives"] = answer.get("rivals", [])
    return answer


def table(truths: dict[str, Json], results: dict[str, dict[str, Json]]) -> str:
    """Table of the right names and the median ratios of held-out errors, by family and method."""
    groups: dict[str, list[str]] = defaultdict(list)
    for name, truth in truths.items():
        groups[family_of(truth)].append(name)
    columns = [OURS, *METHODS, GIVEN]
    order = [*FAMILIES, "two effects", "outside the catalogue", "nothing concealed"]
    lines = ["| family | cases | " + " | ".join(columns) + " |", "| --- " * (len(columns) + 2) + "|"]
    for family in [name for name in order if name in groups]:
        cells = [_cell(method, [results[name] for name in groups[family] if name in results]) for method in columns]
        lines.append(f"| {family} | {len(groups[family])} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(method: str, rows: list[dict[str, Json]]) -> str:
    mine = [row[method] for row in rows if method in row]
    ratios = [row["ratio"] for row in mine if row["ratio"] is not None]
    error = f"{np.median(ratios):.2f}" if ratios else "–"
    if method == GIVEN:
        return f"{error} ({len(ratios)})" if ratios else "–"
    right = sum(row["outcome"] == "right" for row in mine)
    return f"{right} of {len(mine)}; {error}"


def main() -> None:
    """Compares the methods and prints the table. `--results` stores the results of each method on each case."""
    parser = argparse.ArgumentParser(description="Gives sealed cases to what others would use.")
    parser.add_argument("folder", type=Path, help="folder of freeplay blind --out")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, help="JSON file for the results of each method on each case")
    asked = parser.parse_args()
    records = json.loads((asked.folder / "receipt.json").read_text())["cases"]
    truths = {name: record["truth"] for name, record in records.items()}
    with ProcessPoolExecutor(asked.jobs) as pool:
        running = {name: pool.submit(compare, asked.folder / "sealed" / name, record["truth"], answer_of(record)) for name, record in records.items()}
        results = {}
        for name, future in running.items():
            results[name] = future.result()
            if asked.results:
                asked.results.write_text(json.dumps(results, indent=1) + "\n")
    print(table(truths, results))


if __name__ == "__main__":
    main()
