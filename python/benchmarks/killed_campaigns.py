"""Runs one blind proof undisturbed in one process and then spread by each engine while tasks are killed at random, and compares the receipts.

    python python/benchmarks/killed_campaigns.py CASES SHARDS FOLDER 0.1 hyperqueue dask
    python python/benchmarks/killed_campaigns.py CASES SHARDS FOLDER 0 local hyperqueue dask local hyperqueue dask

FREEPLAY_EXECUTABLE names the executable. The cases are those of `python/examples/pendulum_cases.py`. The share of the tasks that is named, drawn by
chance, is killed once at a random moment of its first try (SIGKILL to the task's process). A row an engine: tasks killed, wall and processor time, share of
the workers' time in which tasks ran, and whether the receipt is that of the one process to the byte.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GENERATOR = ROOT / "examples" / "pendulum_cases.py"
SEED, WORKERS = 2026, 2


class Killer(threading.Thread):
    """Kills the chosen tasks of the campaign in `folder`, each once, after a random part of `span`, s, of its life."""

    def __init__(self, folder: Path, chosen: set[int], span: float, dice: random.Random) -> None:
        super().__init__(daemon=True)
        self.folder, self.span, self.dice = str(folder), span, dice
        self.left, self.killed, self.stop = dict.fromkeys(chosen, 0.0), 0, threading.Event()

    def run(self) -> None:
        due: dict[int, tuple[int, float]] = {}
        while not self.stop.wait(0.01):
            for task, process in self._at_work():
                if task in self.left and task not in due:
                    due[task] = (process, time.monotonic() + self.dice.uniform(0.0, self.span))
            for task, (process, when) in list(due.items()):
                if time.monotonic() >= when and task in self.left:
                    del self.left[task]
                    try:
                        os.kill(process, signal.SIGKILL)
                        self.killed += 1
                    except ProcessLookupError:
                        pass

    def _at_work(self) -> list[tuple[int, int]]:
        """Tasks of the campaign that run, and their processes."""
        found = []
        for entry in os.scandir("/proc"):
            if entry.name.isdigit():
                try:
                    words = Path(entry.path, "cmdline").read_bytes().split(b"\0")
                except OSError:
                    continue
                if len(words) > 5 and words[3].endswith(b"_campaign_task.py") and words[4].decode() == self.folder:
                    found.append((int(words[5]), int(entry.name)))
        return found


def spread(out: Path, cases: int, shards: int, engine: str, workers: int) -> tuple[float, float]:
    """Wall and processor time, s, of the campaign in a process of its own, whose children count."""
    words = [sys.executable, "-m", "freeplay", "campaign", "blind", "--cases", str(cases), "--seed", str(SEED), "--generator", str(GENERATOR)]
    words += ["--shards", str(shards), "--engine", engine, "--workers", str(workers), "--out", str(out), "--quiet"]
    begun = time.monotonic()
    process = subprocess.Popen(words, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{engine}: the campaign ended with status {status}")
    return time.monotonic() - begun, usage.ru_utime + usage.ru_stime


def busy(out: Path, workers: int) -> float:
    """Share of the workers' time, from the first task's begin to the last one's end, in which tasks were at work."""
    told = [json.loads(path.read_text()) for path in out.glob("tasks/*/task.json")]
    begin, end = min(each["begun"] for each in told), max(each["begun"] + each["seconds"] for each in told)
    return sum(each["seconds"] for each in told) / (workers * (end - begin))


def main(cases: str, shards: str, folder: str, share: str, *engines: str) -> None:
    place, count = Path(folder).absolute(), int(shards)
    print("| engine | tasks | killed | wall [s] | processor [s] | workers busy | receipt |\n" + "| --- " * 7 + "|", flush=True)
    wall, processor = spread(place / "one", int(cases), 1, "local", 1)
    whole = (place / "one/receipt.json").read_bytes()
    print(f"| one process | 1 | 0 | {wall:.0f} | {processor:.1f} | | {len(whole):,} bytes |", flush=True)
    for number, engine in enumerate(engines):
        dice, out = random.Random(SEED + number), place / f"{engine}-{number}"
        killer = Killer(out, set(dice.sample(range(count), round(float(share) * count))), 0.5 * wall / count, dice)
        killer.start()
        seconds, used = spread(out, int(cases), count, engine, WORKERS)
        killer.stop.set()
        killer.join()
        same = "the same to the byte" if (out / "receipt.json").read_bytes() == whole else "DIFFERENT"
        print(f"| {engine} | {count} | {killer.killed} | {seconds:.0f} | {used:.1f} | {busy(out, WORKERS):.1%} | {same} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
