"""Counts right answers for recordings of commanded and measured positions alone: `python proof/peers/servos.py RECEIPT_OR_FOLDER...`

Reads receipts of `freeplay blind --generator mujoco-servos`, and folders of open cases with answers from `measure.py`. A machine conceals several
effects at once. A case is right if the answer names all of them and no other, partly right if it names only concealed effects, and wrong if it names
a false effect. The script also counts the findings one by one.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from pathlib import Path

import scores
from scores import Json


def cases(path: Path) -> dict[str, tuple[Json, Json]]:
    """True effects and answer of each case, from a receipt or a folder of open cases."""
    if path.is_dir():
        answers = json.loads((path / "answers.json").read_text())
        return {name: (json.loads((path / name / "truth.json").read_text()), answer) for name, answer in answers.items()}
    records = json.loads(path.read_text())["cases"]
    return {name: (record["truth"], {**record["answer"], "alternatives": record["answer"].get("rivals", [])}) for name, record in records.items()}


def main() -> None:
    """Prints the counts."""
    parser = argparse.ArgumentParser(description="Counts what is right on cases of commanded and measured positions.")
    parser.add_argument("paths", type=Path, nargs="+")
    asked = parser.parse_args()
    outcomes: dict[str, Counter[str]] = defaultdict(Counter)
    findings: dict[str, Counter[str]] = defaultdict(Counter)
    intervals: dict[str, Counter[bool]] = defaultdict(Counter)
    for path in asked.paths:
        for name, (truth, answer) in cases(path).items():
            outcome = scores.judge(truth, answer).outcome
            group = truth["sort"] + (f" {scores.group_of(truth)}" if truth["sort"] == "one" else "")
            outcomes[group][outcome] += 1
            there, said = set(scores.places(truth["effects"])), set(scores.places(answer.get("effects", [])))
            for kind, _ in there & said:
                findings[kind]["right"] += 1
            for kind, _ in there - said:
                findings[kind]["missed"] += 1
            for kind, _ in said - there:
                findings[kind]["not there"] += 1
            _intervals(truth, answer, intervals)
            if outcome not in ("right", "partly") or said - there:
                off = ", ".join(f"{kind} of {joint}" for kind, joint in sorted(said - there, key=str))
                print(f"{name} {group} {truth['machine']} {outcome}: not there {off or 'nothing'} | {answer.get('why', '')}")
    print()
    for group, row in sorted(outcomes.items()):
        print(f"{group:40} " + ", ".join(f"{count} {what}" for what, count in row.most_common()))
    for kind, row in sorted(findings.items()):
        print(f"{kind:40} {row['right']} right, {row['missed']} missed, {row['not there']} not there")
    right, wrong = (sum(row[what] for row in findings.values()) for what in ("right", "not there"))
    print(f"findings that are there: {right} of {right + wrong}")
    faulty = sum((row for group, row in outcomes.items() if group not in ("own", "behind")), Counter())
    detected = faulty.total() - faulty["missed"]
    print(f"machines that lack something: {faulty['right']} right and {faulty['partly']} partly right of {detected} detected, {faulty['missed']} missed")
    print(f"false alarms: {outcomes['own'].total() - outcomes['own']['right']} of {outcomes['own'].total()}")
    for name, row in sorted(intervals.items()):
        print(f"{name:40} {row[True]} of {row.total()} intervals hold")


def _intervals(truth: Json, answer: Json, into: dict[str, Counter[bool]]) -> None:
    for concealed in truth["effects"]:
        for effect in answer.get("effects", []):
            if (effect["kind"], effect["joint"]) == (concealed["kind"], concealed["joint"]):
                for name, estimate in effect["parameters"].items():
                    true, ends = concealed["parameters"].get(name), estimate.get("ci95")
                    if isinstance(true, float) and ends and name not in concealed.get("weak", []):
                        into[f"{effect['kind']}.{name}"][ends[0] <= true <= ends[1]] += 1


if __name__ == "__main__":
    main()
