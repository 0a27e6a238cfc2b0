"""Measures the cost of merging a large campaign, with generated receipts whose hashes and scores are valid.

    python python/benchmarks/merge_at_scale.py FREEPLAY RECEIPT FOLDER 10000 100000 1000000

FREEPLAY is the executable. RECEIPT is a `receipt.json` of `freeplay blind`; the benchmark repeats its cases with new names, salts and recordings. FOLDER
is an empty folder on a disk with enough space. For each number of cases the benchmark writes shards of 1,000 cases in the format of `freeplay
campaign`, merges them, and prints a row: processor time and memory of the merge, sizes and numbers of files.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

SHARD = 1000
Text = dict[str, tuple[str, str]]


def canonical(value: Any) -> str:
    """The text over which a receipt computes its hashes."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{canonical(key)}:{canonical(value[key])}" for key in sorted(value)) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(canonical, value)) + "]"
    if isinstance(value, float):
        return "f" + struct.pack(">d", value).hex()
    return json.dumps(value, ensure_ascii=False)


def digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def short(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


class Shards:
    """Generates shards of a set with `cases` cases, which repeat those of `receipt`."""

    def __init__(self, receipt: dict[str, Any], cases: int, program: str, scratch: Path) -> None:
        self.part = receipt["parts"][0]
        self.cases, self.count = cases, max(1, cases // SHARD)
        names = list(receipt["cases"])
        self.files = [self.part["sealed"][name] for name in names]
        records = [receipt["cases"][name] for name in names]
        # The common parts of the cases, as text of the file and as text for the hash.
        self.texts: list[Text] = [{field: (short(each[field]), canonical(each[field])) for field in ("truth", "answer", "outcome")} for each in records]
        self.isolation: dict[str, int] = {}
        self.score = self._score(records, program, scratch)

    def _score(self, records: list[dict[str, Any]], program: str, scratch: Path) -> Any:
        """The score of one shard. All shards have the same answers, so it is the score of each. `freeplay blind --score` computes it."""
        folder = scratch / "scored"
        rows = self._rows(1)
        text = self._receipt(rows, None, "null", revealed=False)
        folder.mkdir()
        (folder / "receipt.json").write_text(text, encoding="utf-8")
        truths = {name: {**records[which]["truth"], "salt": salt} for name, (salt, which, _, _) in rows.items()}
        (folder / "truth.json").write_text(json.dumps({"cases": truths}), encoding="utf-8")
        words = [program, "blind", "--score", str(folder), str(folder / "truth.json"), "--force", "--quiet", "--format", "json"]
        return json.loads(subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout)

    def _rows(self, shard: int) -> dict[str, tuple[str, int, dict[str, Any], str]]:
        """For each case of a shard, by its name: salt, number of the repeated case of the receipt, files, commitment."""
        key, rows = self._key(shard), {}
        indices = {digest(f"name\n[{json.dumps(key)},{index}]")[:16]: index for index in range(shard - 1, self.cases, self.count)}
        # In the order of the names, so that sums over a shard have the same rounding errors.
        for place, name in enumerate(sorted(indices)):
            which, index = place % len(self.texts), indices[name]
            salt = digest(f"salt {index}")[:32]
            files = {
                file: {"sha256": digest(f"{file} {index}"), "bytes": held["bytes"] + index % 997} for file, held in self.files[which].items()
            }
            rows[name] = (salt, which, files, digest(f"truth\n[{json.dumps(salt)},{self.texts[which]['truth'][1]}]"))
        return rows

    def _key(self, shard: int) -> str:
        return digest(f"key {shard}")[:32]

    def text(self, shard: int) -> str:
        """Text of the receipt of a shard, counted from 1."""
        quota = {"single": self.cases, "negative": 0, "unknown": 0, "double": 0}
        draw = {**self.part["draw"], "names": self._key(shard), "quota": quota, "shard": [shard, self.count]}
        draw.pop("matrix", None)
        return self._receipt(self._rows(shard), draw, short(self.score), revealed=True)

    def _receipt(self, rows: dict[str, Any], draw: Any, score: str, revealed: bool) -> str:
        empty = ("null", "null")
        part = {
            **self.part, "draw": draw, "sealed": {name: row[2] for name, row in rows.items()},
            "commitments": {name: row[3] for name, row in rows.items()}, "not_made": [],
            "isolation": {words: len(rows) for words in self.part["isolation"]},
        }  # fmt: skip
        answers = ",".join(f"{json.dumps(name)}:{self.texts[row[1]]['answer'][1]}" for name, row in rows.items())
        part["answers"] = digest(f"answers\n{{{answers}}}")
        reveals = ",".join(f"{json.dumps(name)}:[{json.dumps(row[0])},{self.texts[row[1]]['truth'][1]}]" for name, row in rows.items())
        brought = {
            "freeze": canonical([part["program"], part["machine"]]),
            "seed": canonical(draw),
            "seal": canonical([part["sealed"], part["commitments"], part["not_made"], part["seconds"][0]]),
            "answer": canonical([part["answers"], part["isolation"], part["seconds"][1]]),
            "reveal": f"{{{reveals}}}",
        }
        wanted = ["freeze", *(["seed"] if draw else []), "seal", "answer", *(["reveal"] if revealed else [])]
        before, part["stages"] = "", []
        for name in wanted:
            at, it = self.part["stages"][0]["at"], digest(f"{name}\n{brought[name]}")
            before = digest(f"chain\n{canonical([before, name, at, it])}")
            part["stages"].append({"name": name, "at": at, "brought": it, "chain": before})

        def record(row: Any, form: int) -> str:
            texts = self.texts[row[1]]
            fields = {field: (texts[field] if revealed or field == "answer" else empty)[form] for field in ("truth", "answer", "outcome")}
            fields["salt"] = json.dumps(row[0] if revealed else "")
            return "{" + ",".join(f'"{field}":{fields[field]}' for field in sorted(fields)) + "}"

        def whole(form: int) -> str:
            cases = ",".join(f"{json.dumps(name)}:{record(row, form)}" for name, row in rows.items())
            parts = short([part]) if form == 0 else canonical([part])
            told = score if form == 0 else canonical(json.loads(score))
            return f'"cases":{{{cases}}},"parts":{parts},"schema":"{SCHEMA}","score":{told}'

        return f'{{{whole(0)},"sha256":"{digest(f"receipt{chr(10)}{{{whole(1)}}}")}"}}\n'


SCHEMA = "freeplay.receipt/2"


def campaign(folder: Path, shards: Shards, program: str) -> None:
    """Writes a folder in the format of `freeplay campaign` before the merge."""
    for shard in range(1, shards.count + 1):
        result = folder / "tasks" / f"{shard - 1:06d}" / "result"
        result.mkdir(parents=True)
        (result / "receipt.json").write_text(shards.text(shard), encoding="utf-8")
    lines = [json.dumps([{"at": {"shard": shard + 1}, "arguments": []}]) + "\n" for shard in range(shards.count)]
    (folder / "tasks.jsonl").write_text("".join(lines), encoding="utf-8")
    plan = {"schema": "freeplay.campaign-plan/2", "command": "blind", "version": "0", "executable": program, "seed": 1, "tasks": shards.count}
    (folder / "campaign.json").write_text(json.dumps(plan), encoding="utf-8")


def size(folder: Path) -> tuple[int, int]:
    """Total size, bytes, and number of the files in `folder`."""
    files = [Path(base) / name for base, _, names in os.walk(folder) for name in names]
    return sum(file.stat().st_size for file in files), len(files)


MERGE = """
import resource, sys, time, freeplay
begun = time.monotonic()
freeplay.Campaign(sys.argv[1]).merge()
own, child = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
print(time.monotonic() - begun, own.ru_utime + own.ru_stime, own.ru_maxrss, child.ru_utime + child.ru_stime, child.ru_maxrss)
"""


def main(program: str, receipt: str, folder: str, *counts: str) -> None:
    known = json.loads(Path(receipt).read_text(encoding="utf-8"))
    package = str(Path(__file__).resolve().parent.parent)
    environment = {**os.environ, "FREEPLAY_EXECUTABLE": str(Path(program).absolute()), "PYTHONPATH": package}
    print("| cases | shards | files | receipts of the shards [MB] | receipts merged [MB] | wall [s] | processor, command [s] | processor, Python [s] | memory, command [MB] | memory, Python [MB] |")
    print("| --- " * 10 + "|", flush=True)
    for count in map(int, counts):
        place = Path(folder) / str(count)
        place.mkdir(parents=True)
        shards = Shards(known, count, environment["FREEPLAY_EXECUTABLE"], place)
        shutil.rmtree(place / "scored")
        campaign(place / "campaign", shards, program)
        before, files = size(place / "campaign")
        time.sleep(0.1)
        told = subprocess.run([sys.executable, "-c", MERGE, str(place / "campaign")], env=environment, check=True, stdout=subprocess.PIPE, text=True)
        wall, own, own_memory, child, child_memory = map(float, told.stdout.split())
        after, _ = size(place / "campaign")
        print(
            f"| {count:,} | {shards.count:,} | {files:,} | {before / 1e6:.0f} | {(after - before) / 1e6:.0f} | {wall:.0f} | {child:.1f} | {own:.1f} "
            f"| {child_memory / 1e3:.0f} | {own_memory / 1e3:.0f} |",
            flush=True,
        )
        shutil.rmtree(place)


if __name__ == "__main__":
    main(*sys.argv[1:])
