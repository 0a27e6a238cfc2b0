"""Many cases, spread over cores and machines by somebody else's engine, and merged into one receipt."""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import os
import secrets
import shutil
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _campaign_engines, _command, _toml
from ._campaign_task import FAILED, PLAN, PRINTED, RESULT, TASK, TASKS, name_of
from ._command import PathLike, Progress, call, options, teller
from .errors import BadInput, BadUsage, FreeplayError, InternalFault

if TYPE_CHECKING:
    import pandas as pd

SCHEMA, PLAN_SCHEMA = "freeplay.campaign/1", "freeplay.campaign-plan/1"
# Commands that take no --out.
PRINT_ONLY = {"cells"}
# What differs from run to run of the same case: times, machines, salts, and names that are drawn.
VOLATILE = {
    "latency_us", "deadlines", "machine", "salt", "cpu_seconds", "seconds", "isolation", "files", "config_hash", "freeplay", "scenario",
}  # fmt: skip
# Between two looks at the folder, s.
LOOK = 0.5


def campaign(
    command: str,
    *arguments: object,
    out: PathLike,
    shards: int | None = None,
    sweep: Mapping[str, Iterable[object]] | None = None,
    engine: str = "local",
    workers: int | None = None,
    cluster: str | None = None,
    attempts: int = 4,
    keep: bool = False,
    progress: Progress = None,
    **chosen: object,
) -> Campaign:
    """Spreads a command over cores and machines, and merges what it leaves into one receipt.

    A campaign that was broken off, whose machine died or whose disk was full, goes on where it was when it is called again with the same
    arguments and the same `out`: engine, workers and attempts may be others.

    Parameters
    ----------
    command : str
        "blind", which is cut into shards, or "run", "faults", "swap", "cells", "reference-runs", … with a `sweep`.
    *arguments
        What stands behind the command: a scenario, a controller.
    out : path
        Folder for the results, which every worker sees under this path. Results appear in `tasks` as they come.
    shards : int, optional
        Into how many tasks "blind" is cut; four a worker without it. The receipt does not depend on it.
    sweep : dict, optional
        Keys of the scenario, and options with their dashes, with the values of each; a task for every combination:
        `{"path.period": [6, 12], "--seed": range(10)}`.
    engine : {"local", "hyperqueue", "dask", "slurm"}
        What carries out the tasks.
    workers : int, optional
        Tasks at a time; one a core of this machine without it.
    cluster : str, optional
        A cluster that is there: the server's folder (HyperQueue), the scheduler's address (Dask), the partition (Slurm). Without it one is
        started on this machine.
    attempts : int
        How often a task is tried that is killed or fails.
    keep : bool
        Whether the sealed recordings of "blind" are kept.
    progress : callable or bool, optional
        Gets a line as tasks are done; True prints them on standard error.
    **chosen
        Options of the command: `cases=2000, seed=7`.

    Returns
    -------
    Campaign

    Raises
    ------
    BadUsage
        An argument or an option is not understood, or `out` holds another campaign.
    FreeplayError
        Tasks failed in all their attempts, with the words of the first; what is done stays.

    Examples
    --------
    >>> proof = campaign("blind", cases=2000, seed=7, engine="hyperqueue", out="proof")  # doctest: +SKIP
    >>> swept = campaign("run", "s.toml", sweep={"clearance.joint_5": [2e-4, 4e-4]}, out="swept")  # doctest: +SKIP
    """
    if engine not in _campaign_engines.ENGINES:
        raise BadUsage(f"no engine is called {engine!r}: there are {', '.join(_campaign_engines.ENGINES)}")
    workers = workers or os.cpu_count() or 1
    folder = Path(out).absolute()
    known = _plan_in(folder)
    words = [command, *(str(each) for each in arguments), *options(**chosen)]
    if command == "blind" and _value(words, "--seed") is None:
        # All shards draw from one seed: that of the plan, so that a campaign that goes on goes on with it.
        words += ["--seed", str((known or {}).get("seed") or secrets.randbits(63))]
    count = shards or (known or {}).get("shards") or 4 * workers
    plan = _plan(words, sweep or {}, int(count), keep)
    _lay_out(folder, plan, known)
    work = _campaign_engines.Work(folder, range(len(plan["tasks"])), workers, attempts, cluster)
    _carry_out(folder, plan, engine, work, progress)
    found = Campaign(folder)
    found.merge()
    return found


def _plan(words: list[str], sweep: Mapping[str, Iterable[object]], shards: int, keep: bool) -> dict[str, Any]:
    """What is to be done, task by task."""
    command, is_proof = words[0], words[0] == "blind" and not sweep
    cut: list[tuple[dict[str, object], list[str]]]
    if is_proof:
        # Shards are spread, not what is in one; and a shard without a case would be refused.
        words = words if _value(words, "--jobs") else [*words, "--jobs", "1"]
        cases = 40 if not {"--full", "--matrix"} & set(words) else shards
        shards = min(shards, int(_value(words, "--cases") or cases))
        cut = [({"shard": shard + 1}, ["--shard", f"{shard + 1}/{shards}"]) for shard in range(shards)]
    elif sweep:
        cut = list(_combinations(sweep))
    else:
        raise BadUsage(f"{command} is not cut into shards: give a sweep, such as sweep={{'--seed': range(10)}}")
    folder = [] if command in PRINT_ONLY else ["--out", "{result}"]
    tasks = [{"at": at, "arguments": [*words, *more, *folder, "--format", "json"]} for at, more in cut]
    seed = _value(words, "--seed")
    return {
        "schema": PLAN_SCHEMA, "command": command, "version": _command.version(), "executable": str(_command.executable()),
        "seed": None if seed is None else int(seed), "shards": shards if is_proof else None, "surplus": ["sealed"] if is_proof and not keep else [],
        "tasks": tasks,
    }  # fmt: skip


def _value(words: Sequence[str], flag: str) -> str | None:
    """The value of an option on a command line."""
    for word, following in zip(words, [*words[1:], ""]):
        if word == flag:
            return following
        if word.startswith(f"{flag}="):
            return word.partition("=")[2]
    return None


def _combinations(sweep: Mapping[str, Iterable[object]]) -> Iterator[tuple[dict[str, object], list[str]]]:
    """Every combination of the values of `sweep`, with the words that ask for it."""
    names = list(sweep)
    for values in itertools.product(*(list(sweep[name]) for name in names)):
        words: list[str] = []
        for name, value in zip(names, values):
            words += [name, str(value)] if name.startswith("--") else ["--set", f"{name}={_toml.value(value)}"]
        yield dict(zip(names, values)), words


def _plan_in(folder: Path) -> dict[str, Any] | None:
    """The plan of the campaign in `folder`, if there is one."""
    path = folder / PLAN
    if not path.exists():
        return None
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BadInput(f"{path}: it is no plan of a campaign ({error}); remove the folder, or choose another") from None
    return plan if isinstance(plan, dict) else {}


def _lay_out(folder: Path, plan: dict[str, Any], known: dict[str, Any] | None) -> None:
    """Writes the plan into `folder`, or makes sure that the one there is the same."""
    asked = json.loads(json.dumps(plan, default=str))
    if known is not None:
        if {**known, "executable": None} != {**asked, "executable": None}:
            raise BadUsage(f"{folder} holds another campaign: choose another folder, or go on with the same arguments")
    elif folder.is_dir() and any(folder.iterdir()):
        raise BadUsage(f"{folder} is not empty: choose another folder")
    (folder / TASKS).mkdir(parents=True, exist_ok=True)
    whole = folder / f".{PLAN}-{os.getpid()}"
    whole.write_text(json.dumps(asked, indent=1) + "\n", encoding="utf-8")
    os.replace(whole, folder / PLAN)


def _carry_out(folder: Path, plan: dict[str, Any], engine: str, work: _campaign_engines.Work, progress: Progress) -> None:
    """Has the engine do what is not done; tasks that were killed or failed are handed over again."""
    count = len(plan["tasks"])
    with _Watcher(folder, count, teller(progress)):
        for attempt in range(work.attempts):
            missing = [task for task in range(count) if not (folder / TASKS / name_of(task)).is_dir()]
            if not missing:
                break
            if attempt and _is_hopeless(folder, missing, count):
                break
            asked = _campaign_engines.Work(work.folder, missing, min(work.workers, len(missing)), work.attempts, work.cluster)
            _campaign_engines.start(engine, asked)
    _sweep_out(folder)
    missing = [task for task in range(count) if not (folder / TASKS / name_of(task)).is_dir()]
    if missing:
        raise _failure(folder, missing, count)
    shutil.rmtree(folder / FAILED, ignore_errors=True)


def _is_hopeless(folder: Path, missing: list[int], count: int) -> bool:
    """Every task failed, and by itself: another attempt would say the same."""
    said = [folder / FAILED / f"{name_of(task)}.txt" for task in missing]
    return len(missing) == count and all(path.is_file() and "exit code -" not in path.read_text()[:16] for path in said)


def _sweep_out(folder: Path) -> None:
    """Removes what killed tasks left half done, the last of which may still be ending."""
    patience = time.monotonic() + 10.0
    while parts := list((folder / TASKS).glob(".*")):
        for part in parts:
            shutil.rmtree(part, ignore_errors=True)
        if time.monotonic() > patience:
            break
        time.sleep(0.05)


def _failure(folder: Path, missing: list[int], count: int) -> FreeplayError:
    done = count - len(missing)
    words = f"{len(missing)} of {count} tasks are not done; {done} are, in {folder / TASKS}. Call it again to go on."
    said = folder / FAILED / f"{name_of(missing[0])}.txt"
    if not said.is_file():
        return InternalFault(f"{words} The tasks were killed, or their workers are gone.")
    code, _, log = said.read_text(encoding="utf-8").partition("\n")
    lines = [line.removeprefix("freeplay: ") for line in log.splitlines() if line.startswith(("freeplay: ", "error: "))] or log.splitlines()[-3:]
    number = int(code.rsplit(" ", 1)[-1])
    kind = {2: BadUsage, 3: BadInput}.get(number, InternalFault)
    return kind(f"{words} The first of them: {' '.join(lines[-1:])} ({code})")


class _Watcher:
    """Tells how many tasks are done, whatever engine does them."""

    def __init__(self, folder: Path, count: int, tell: Any) -> None:
        self.folder, self.count, self.tell = folder, count, tell
        self.stop, self.begun = threading.Event(), time.monotonic()
        self.before = self.done()
        self.thread = threading.Thread(target=self._watch, daemon=True)

    def done(self) -> int:
        return sum(1 for entry in os.scandir(self.folder / TASKS) if not entry.name.startswith("."))

    def __enter__(self) -> _Watcher:
        if self.tell:
            self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop.set()
        if self.tell:
            self.thread.join()
            self._say(self.done())

    def _watch(self) -> None:
        told = -1
        while not self.stop.wait(LOOK):
            done = self.done()
            if done != told:
                self._say(done)
                told = done

    def _say(self, done: int) -> None:
        seconds = time.monotonic() - self.begun
        new = done - self.before
        rest = f", about {(self.count - done) * seconds / new:.0f} s to go" if 0 < new and done < self.count else ""
        self.tell(f"campaign  {done} of {self.count} tasks, {seconds:.0f} s{rest}")


class Campaign:
    """A campaign's results.

    Attributes
    ----------
    folder : Path
        Where they lie; `Campaign(folder)` opens those of an earlier one, finished or not.
    command : str
        What was spread.
    """

    def __init__(self, folder: PathLike) -> None:
        self.folder = Path(folder).absolute()
        plan = _plan_in(self.folder)
        if plan is None or plan.get("schema") != PLAN_SCHEMA:
            raise BadInput(f"{self.folder} holds no campaign: it has no {PLAN} of schema {PLAN_SCHEMA}")
        self._plan = plan
        self.command: str = plan["command"]

    @property
    def done(self) -> list[int]:
        """Numbers of the tasks whose results are there."""
        return [task for task in range(len(self._plan["tasks"])) if self.folder_of(task).is_dir()]

    def folder_of(self, task: int) -> Path:
        """The folder of a task: `result`, what the command left; `printed.json`, what it printed; `log.txt`; `task.json`."""
        return self.folder / TASKS / name_of(task)

    @property
    def receipt(self) -> Path:
        """`receipt.json`: what came of every case, without times and machines, so that it is the same however the cases were spread."""
        return self.folder / "receipt.json"

    @property
    def results(self) -> pd.DataFrame:
        """What came of the cases that are done.

        Returns
        -------
        DataFrame
            For "blind" the cases as `Proof.cases` has them; else a row for each entry that a task printed, with the swept values and the
            entry's numbers and words; seconds that the task took.
        """
        import pandas as pd

        if self.command == "blind":
            from .proof import Proof

            frames = [Proof(self.folder_of(task) / RESULT).cases for task in self.done]
            return pd.concat(frames).sort_index() if frames else pd.DataFrame()
        rows = []
        for task in self.done:
            seconds = self._json(task, TASK)["seconds"]
            for entry in _entries(self._json(task, PRINTED)):
                rows.append({"task": task, **self._plan["tasks"][task]["at"], **_flat(entry), "seconds": seconds})
        return pd.DataFrame(rows)

    @property
    def proof(self) -> Any:
        """The merged `Proof` of "blind"."""
        from .proof import Proof

        return Proof(self.folder / "merged")

    def merge(self) -> Path:
        """Merges the tasks that are done into one receipt, in time linear in the cases. Two merges at once leave the same.

        Returns
        -------
        Path
            The receipt.
        """
        document: dict[str, Any] = {"schema": SCHEMA, "command": self.command, "version": self._plan["version"]}
        if self.command == "blind":
            document |= self._merged_proof()
        else:
            tasks = self._plan["tasks"]
            document["cases"] = [{"at": tasks[task]["at"], "found": _steady(self._json(task, PRINTED))} for task in self.done]
        document["sha256"] = hashlib.sha256(_canonical(document).encode()).hexdigest()
        part = self.folder / f".receipt-{os.getpid()}-{threading.get_ident()}"
        part.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        os.replace(part, self.receipt)
        return self.receipt

    def _merged_proof(self) -> dict[str, Any]:
        """The receipts of the shards as one, and of that what the cases came to."""
        part = self.folder / f".merged-{os.getpid()}-{threading.get_ident()}"
        call(["blind", "--merge", *(self.folder_of(task) / RESULT for task in self.done), *options(out=part, format="json")])
        whole = json.loads((part / "receipt.json").read_text(encoding="utf-8"))
        merged = self.folder / "merged"
        old = self.folder / f".replaced-{os.getpid()}-{threading.get_ident()}"
        try:
            if merged.is_dir():
                os.rename(merged, old)
            os.rename(part, merged)
        except OSError:
            # Another merge was faster; it had the same shards or more.
            shutil.rmtree(part, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
        goals = [goal for goal in whole["score"]["goals"] if goal.get("unit") != "s"]
        cases = [_steady({name: each[name] for name in ("truth", "answer", "outcome")}) for each in whole["cases"].values()]
        not_made = sorted(words for part in whole["parts"] for words in part["not_made"])
        seed, quota = (whole["parts"][0]["draw"][name] for name in ("seed", "quota"))
        return {
            "program": whole["parts"][0]["program"], "seed": seed, "quota": quota, "not_made": not_made,
            "outcomes": whole["score"]["outcomes"], "goals": goals,
            "cases": sorted(cases, key=_canonical),
        }  # fmt: skip

    def _json(self, task: int, name: str) -> Any:
        return json.loads((self.folder_of(task) / name).read_text(encoding="utf-8"))

    def __repr__(self) -> str:
        return f"<Campaign {self.command}: {len(self.done)} of {len(self._plan['tasks'])} tasks in {self.folder}>"


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))


def _steady(value: Any) -> Any:
    """`value` without what differs from run to run."""
    if isinstance(value, dict):
        return {name: _steady(held) for name, held in value.items() if name not in VOLATILE}
    return [_steady(held) for held in value] if isinstance(value, list) else value


def _entries(printed: Any) -> list[dict[str, Any]]:
    """The rows of what a command printed: its list of runs, verdicts, swaps or cells, or all of it."""
    if isinstance(printed, list):
        return [each for each in printed if isinstance(each, dict)]
    for name in ("runs", "faults", "verdicts", "swaps", "cells", "rows"):
        held = printed.get(name)
        if isinstance(held, list) and held and isinstance(held[0], dict):
            return held
    return [printed]


def _flat(entry: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """The numbers and words of `entry`, those of its parts with dotted names."""
    flat: dict[str, Any] = {}
    for name, held in entry.items():
        if name in VOLATILE:
            continue
        if isinstance(held, Mapping):
            flat.update(_flat(held, f"{above}{name}."))
        elif not isinstance(held, list):
            flat[above + name] = held
    return flat


def main(words: Sequence[str]) -> int:
    """`freeplay campaign`: the exit code."""
    parser = argparse.ArgumentParser(
        prog="freeplay campaign",
        description="Spreads a command over cores and machines, and merges what it leaves into one receipt. Called again it goes on where it was.",
        epilog="freeplay campaign blind --cases 2000 --seed 7 --shards 100 --engine hyperqueue --out proof\n"
        "freeplay campaign run s.toml --sweep path.period=6,12 --sweep=--seed=1,2,3 --out swept",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("command", help="blind, or run, faults, swap, cells, reference-runs, … with --sweep; then its own arguments")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the results, which every worker sees under this path")
    parser.add_argument("--shards", type=int, metavar="N", help="into how many tasks blind is cut; four a worker without it")
    parser.add_argument("--sweep", action="append", default=[], metavar="KEY=V,…", help="values of a key of the scenario, or of an option")
    parser.add_argument("--engine", default="local", choices=list(_campaign_engines.ENGINES), help="what carries out the tasks")
    parser.add_argument("--workers", type=int, metavar="N", help="tasks at a time; one a core without it")
    parser.add_argument("--cluster", metavar="ADDRESS", help="a cluster that is there: HyperQueue's server folder, Dask's scheduler, Slurm's partition")
    parser.add_argument("--attempts", type=int, default=4, metavar="N", help="how often a task is tried; 4 without it")
    parser.add_argument("--keep", action="store_true", help="keep the sealed recordings of blind")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress")
    given, rest = parser.parse_known_args(words)
    found = campaign(
        given.command, *rest, out=given.out, shards=given.shards, sweep=dict(_swept(each) for each in given.sweep), engine=given.engine,
        workers=given.workers, cluster=given.cluster, attempts=given.attempts, keep=given.keep, progress=not given.quiet,
    )  # fmt: skip
    print(f"{found!r}\nreceipt  {found.receipt}")
    return 0


def _swept(word: str) -> tuple[str, list[object]]:
    """A key and its values, from KEY=V,V."""
    name, equals, values = word.rpartition("=") if word.startswith("--") else word.partition("=")
    if not equals or not name or not values:
        raise BadUsage(f"--sweep {word}: give a key and its values, such as path.period=6,12")
    return name, [_parsed(value) for value in values.split(",")]


def _parsed(word: str) -> object:
    """`word` as a number or a truth value where it is one."""
    try:
        return json.loads(word)
    except ValueError:
        return word
