"""Measures the processor time of each engine, with tasks that only sleep: a constant, a cost for each task, and a cost for each second.

    python python/benchmarks/engine_cost.py local hyperqueue dask

Prints one row for each engine, with two workers. `local` only starts the tasks and waits for them: its row is the cost of the tasks' processes.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from freeplay import _campaign_engines

WORKERS, MANY, LONG = 2, 200, 60.0


@dataclass(frozen=True)
class Asleep(_campaign_engines.Work):
    """Tasks that sleep."""

    #: Duration of a task, s.
    seconds: float = 0.0

    def command(self, task: int) -> list[str]:
        return ["sleep", str(self.seconds)]


def used(engine: str, tasks: int, seconds: float) -> float:
    """Processor time, s, of a process that imports `engine` and runs `tasks` tasks of `seconds` each."""
    command = [sys.executable, __file__, "--one", engine, str(tasks), str(seconds)]
    return float(json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout))


def one(engine: str, tasks: str, seconds: str) -> None:
    """Prints the processor time of one call of `engine`."""
    with tempfile.TemporaryDirectory() as folder:
        _campaign_engines.start(engine, Asleep(Path(folder), range(int(tasks)), WORKERS, 1, None, float(seconds)))
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(sum(each.ru_utime + each.ru_stime for each in both))


def main(*engines: str) -> None:
    print("| engine | constant [s] | a task [ms] | a second of two workers [ms] |\n| --- | --- | --- | --- |", flush=True)
    for engine in engines:
        least = used(engine, WORKERS, 0.0)
        task = (used(engine, MANY, 0.0) - least) / (MANY - WORKERS)
        second = (used(engine, WORKERS, LONG) - least) / LONG
        print(f"| {engine} | {least:.2f} | {1e3 * task:.1f} | {1e3 * second:.2f} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(*sys.argv[2:])
    else:
        main(*sys.argv[1:])
