"""Diagnoses open cases with a program and counts the right answers by kind: `python proof/peers/measure.py --program freeplay DIR`.

This count is for development. The official count is that of `freeplay blind --generator mujoco`, which seals its cases.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import scores
from scores import Json


def diagnose(program: str, case: Path, patience: float) -> Json:
    """The answer of `program` for the case, and its duration, s."""
    recordings = [str(path) for path in (case / "recording.csv", case / "second.csv") if path.is_file()]
    command = [program, "diagnose", "--model", str(case / "model.toml"), "--recording", *recordings, "--format", "json"]
    start = time.monotonic()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=patience, check=False)
        answer = json.loads(done.stdout) if done.returncode in (0, 1) else {"verdict": "failed", "why": done.stderr[-400:]}
    except (subprocess.TimeoutExpired, json.JSONDecodeError) as error:
        answer = {"verdict": "failed", "why": repr(error)[:400]}
    answer["seconds"] = time.monotonic() - start
    return answer


def table(truths: dict[str, Json], answers: dict[str, Json]) -> str:
    """Table of the outcomes by kind, and of the wrong answers."""
    rows: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    wrong: list[str] = []
    covered: list[bool] = []
    for name, truth in truths.items():
        judged = scores.judge(truth, answers[name])
        rows[(scores.sort_of(truth), judged.group)][judged.outcome] += 1
        covered += judged.covered
        if judged.outcome != "right":
            wrong.append(f"{name} {judged.outcome}: {_concealed(truth)} | {judged.said}")
    lines = [f"{sort:9} {group:55} " + ", ".join(f"{count} {what}" for what, count in row.most_common()) for (sort, group), row in sorted(rows.items())]
    total: dict[str, Counter[str]] = defaultdict(Counter)
    for (sort, _), row in rows.items():
        total[sort] += row
    lines += [f"{sort:9} all {row.total()}: " + ", ".join(f"{count} {what}" for what, count in row.most_common()) for sort, row in sorted(total.items())]
    lines += [f"intervals that hold: {sum(covered)} of {len(covered)}"] if covered else []
    return "\n".join([*lines, "", *wrong])


def _concealed(truth: Json) -> str:
    setup = [f"{it['kind']} {it['detail']} {it['joints'] or ''}" for it in truth.get("setup", [])]
    effects = [f"{it['kind']} of {it['joint']} ({it['signal_to_floor']})" for it in truth["effects"]]
    return f"{truth['machine']} " + (" + ".join(setup + effects) or "nothing")


def push_table(truths: dict[str, Json], answers: dict[str, Json]) -> str:
    """Table of the found pushes, and of false pushes in recordings without any."""
    counts = [scores.pushes(truth, answers[name]) for name, truth in truths.items()]
    found, all_of_them = (sum(row[k] for row in counts) for k in (0, 1))
    false = sum(1 for _, there, more in counts if not there and more)
    return f"pushes found: {found} of {all_of_them}; recordings without a push in which one is named: {false} of {sum(1 for c in counts if not c[1])}"


def main() -> None:
    """Diagnoses the cases of a folder that have no answer yet, and prints the tables."""
    parser = argparse.ArgumentParser(description="Has a program diagnose open cases and counts what is right.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--program", default="freeplay")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--patience", type=float, default=600.0, help="time limit for each case, s")
    parser.add_argument("--answers", type=Path, help="file for the answers (FOLDER/answers.json)")
    asked = parser.parse_args()
    truths = {path.parent.name: json.loads(path.read_text()) for path in sorted(asked.folder.glob("*/truth.json"))}
    kept = asked.answers or asked.folder / "answers.json"
    answers: dict[str, Json] = json.loads(kept.read_text()) if kept.is_file() else {}
    left = [name for name in truths if name not in answers]
    with ThreadPoolExecutor(asked.jobs) as pool:
        for name, answer in zip(left, pool.map(lambda name: diagnose(asked.program, asked.folder / name, asked.patience), left), strict=True):
            answers[name] = answer
            kept.write_text(json.dumps(answers))
    print(table(truths, answers))
    if any(effect["kind"].startswith("external_") for truth in truths.values() for effect in truth["effects"]):
        print(push_table(truths, answers))


if __name__ == "__main__":
    main()
