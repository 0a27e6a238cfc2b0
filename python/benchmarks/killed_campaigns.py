"""Runs one blind test in one process, repeats it with each engine while it kills tasks at random, and compares the receipts.

    python python/benchmarks/killed_campaigns.py CASES SHARDS FOLDER 0.1 hyperqueue dask
    python python/benchmarks/killed_campaigns.py CASES SHARDS FOLDER 0 local hyperqueue dask local hyperqueue dask

FREEPLAY_EXECUTABLE names the executable. `python/examples/pendulum_cases.py` generates the cases. The number after FOLDER is the share of the tasks that
the benchmark kills. It draws the tasks at random, and kills each once at a random moment of its first attempt (SIGKILL to the task's process). If a
task ends before its moment, the benchmark draws another one that has not begun. FOLDER keeps the receipt of the one process for later calls. Each
engine has one row: killed tasks; wall and processor time of the campaign with all its processes; the part of the processor time outside of finished
tasks and the merge, for the engine and lost attempts; the share of the workers' time in which tasks ran; and the comparison of the receipts, byte by
byte.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
GENERATOR = ROOT / "examples" / "pendulum_cases.py"
SEED, WORKERS = 2026, 2


class Killer(threading.Thread):
    """Kills `kills` of the `count` tasks of the campaign in `folder`, each once, after a random part of `span`, s, of its life.

    It decides on each task when the task begins, so that all tasks have the same probability (Knuth 1981, The Art of Computer Programming 2,
    algorithm S).
    """

    def __init__(self, folder: Path, kills: int, count: int, span: float, dice: random.Random) -> None:
        super().__init__(daemon=True)
        self.folder, self.kills, self.count, self.span, self.dice = str(folder), kills, count, span, dice
        self.killed, self.stop = 0, threading.Event()

    def run(self) -> None:
        seen: set[int] = set()
        due: dict[int, tuple[int, float]] = {}
        while not self.stop.wait(0.01):
            now, alive = time.monotonic(), self._at_work()
            for task, process in alive:
                if task not in seen:
                    wanted, unseen = self.kills - self.killed - len(due), self.count - len(seen)
                    seen.add(task)
                    if self.dice.random() * unseen < wanted:
                        due[task] = (process, now + self.dice.uniform(0.0, self.span))
            for task, (process, when) in list(due.items()):
                if (task, process) not in alive:
                    del due[task]
                elif now >= when:
                    del due[task]
                    try:
                        os.kill(process, signal.SIGKILL)
                        self.killed += 1
                    except ProcessLookupError:
                        pass

    def _at_work(self) -> list[tuple[int, int]]:
        """The running tasks of the campaign, and their processes."""
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
    """Wall and processor time, s, of the campaign in its own process, including child processes."""
    words = [sys.executable, "-m", "freeplay", "campaign", "blind", "--cases", str(cases), "--seed", str(SEED), "--generator", str(GENERATOR)]
    words += ["--shards", str(shards), "--engine", engine, "--workers", str(workers), "--out", str(out), "--quiet"]
    begun = time.monotonic()
    process = subprocess.Popen(words, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{engine}: the campaign ended with status {status}")
    return time.monotonic() - begun, usage.ru_utime + usage.ru_stime


def tasks_of(out: Path) -> list[dict[str, Any]]:
    """The files `task.json` of the finished tasks."""
    return [json.loads(path.read_text()) for path in out.glob("tasks/*/task.json")]


def busy(out: Path, workers: int) -> float:
    """Share of the workers' time in which tasks ran, from the begin of the first task to the end of the last one."""
    told = tasks_of(out)
    begin, end = min(each["begun"] for each in told), max(each["begun"] + each["seconds"] for each in told)
    return sum(each["seconds"] for each in told) / (workers * (end - begin))


def merging(out: Path) -> float:
    """Processor time, s, of another merge of a campaign, including the start of Python."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    script = "import sys, freeplay; freeplay.Campaign(sys.argv[1]).merge()"
    subprocess.run([sys.executable, "-c", script, str(out)], env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def undisturbed(out: Path, cases: int) -> bytes:
    """The receipt of one process, from an earlier call or from a new run."""
    if not (out / "receipt.json").exists():
        wall, used = spread(out, cases, 1, "local", 1)
        whole = (out / "receipt.json").read_bytes()
        print(f"| one process | 1 | 0 | {wall:.0f} | {used:.1f} | {used - tasks_of(out)[0]['cpu_seconds'] - merging(out):.1f} | | {len(whole):,} bytes |", flush=True)
    return (out / "receipt.json").read_bytes()


def main(cases: str, shards: str, folder: str, share: str, *engines: str) -> None:
    place, count = Path(folder).absolute(), int(shards)
    print("| engine | tasks | killed | wall [s] | processor [s] | engine [s] | workers busy | receipt |\n" + "| --- " * 8 + "|", flush=True)
    whole = undisturbed(place / "one", int(cases))
    seconds = tasks_of(place / "one")[0]["seconds"]
    for number, engine in enumerate(engines):
        dice = random.Random(SEED + number)
        out = next(path for path in (place / f"{engine}-{n}" for n in itertools.count()) if not path.exists())
        kills = round(float(share) * count)
        killer = Killer(out, kills, count, 0.5 * seconds / count, dice)
        killer.start()
        wall, used = spread(out, int(cases), count, engine, WORKERS)
        killer.stop.set()
        killer.join()
        same = "the same to the byte" if (out / "receipt.json").read_bytes() == whole else "DIFFERENT"
        lost = used - sum(each["cpu_seconds"] for each in tasks_of(out)) - merging(out)
        print(f"| {engine} | {count} | {killer.killed} | {wall:.0f} | {used:.1f} | {lost:.1f} | {busy(out, WORKERS):.1%} | {same} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
