#!/usr/bin/env python3
"""Generates the table of all sealed sets from sets.jsonl: `python docs/blind/table.py > docs/blind/sets.md`."""
import json
import pathlib

COLUMNS = {
    "false alarm on negative controls": "false alarms",
    "verdict `named`: effect and joint right": "named, right",
    "effect and joint right among detected": "of detected, right",
    "unknown physics not given a catalogue name": "unknown, not named",
    "two effects: both right": "two effects, both right",
    "parameter error, median": "parameter error, median",
    "95 % intervals that hold the truth": "intervals hold",
    "held-out error closed, median": "error closed, median",
    "better fit but wrong name": "fits better, wrong name",
}

# Names of figures in older lines.
RENAMED = {"unknown physics not given a name": "unknown physics not given a catalogue name"}

lines = [json.loads(line) for line in (pathlib.Path(__file__).parent / "sets.jsonl").read_text().splitlines()]
scored = {line["chain"]: {RENAMED.get(name, name): goal for name, goal in line["goals"].items()} for line in lines if "scored" in line}


def cell(goal):
    """Text of a figure in percent, with its 95 % interval and the number of its cases."""
    if goal is None or goal[0] is None:
        return "–"
    value, interval, count = goal
    width = f" ({interval[0]:.0f} to {interval[1]:.0f})" if interval else ""
    return f"{value:.1f}{width} of {count}"


print("# Every sealed set\n")
print("`python docs/blind/table.py > docs/blind/sets.md` writes this page from [`sets.jsonl`](sets.jsonl); [how to read it](README.md#every-sealed-set).")
print("Figures are in percent, with the 95 % interval and the number of cases behind each.\n")
print("| sealed | seed | part | cases | " + " | ".join(COLUMNS.values()) + " |")
print("| --- " * (4 + len(COLUMNS)) + "|")
for line in lines:
    if "sealed" not in line:
        continue
    draw, goals = line["draw"] or {}, scored.get(line["chain"])
    part, whole = draw.get("shard", [1, 1])
    cells = [line["sealed"][:16].replace("T", " "), str(draw.get("seed", "–")), f"{part}/{whole}", str(line["cases"])]
    cells += [cell(goals.get(name)) if goals else "not scored" for name in COLUMNS]
    print("| " + " | ".join(cells) + " |")
