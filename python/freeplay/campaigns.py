"""Campaigns: an engine distributes many cases over cores and machines, and the campaign merges their results into one receipt."""

from __future__ import annotations

import itertools
import json
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _campaign_engines, _campaign_receipt, _command, _toml
from ._campaign_progress import Watcher
from ._campaign_receipt import canonical, own_name, steady
from ._campaign_task import FAILED, LINES, PLAN, PRINTED, RESULT, STOP, TASK, TASKS, name_of
from ._command import PathLike, Progress, call, options, teller
from .errors import BadInput, BadUsage, FreeplayError, InternalFault

if TYPE_CHECKING:
    import pandas as pd

PLAN_SCHEMA = "freeplay.campaign-plan/2"
# Commands without the option --out.
PRINT_ONLY = {"cells"}


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
    **command_options: object,
) -> Campaign:
    """Distributes a command or a parameter sweep over cores and machines, and merges the results into one receipt.

    After an interruption, a crash or a full disk, the same call continues where the campaign stopped. It needs the same arguments and the same
    `out`; engine, workers and attempts may differ.

    Parameters
    ----------
    command : str
        Command to distribute: "blind", or, with `sweep`, "run", "faults", "swap", "cells", "reference-runs" and others. The campaign divides
        "blind" into shards.
    *arguments
        Positional arguments of the command: a scenario, a controller.
    out : path
        Folder for the results, which every worker sees under this path. Finished tasks appear in its folder `tasks`.
    shards : int, optional
        Number of tasks. Default: four for each worker ("blind"), or one for each combination (sweep). The receipt does not depend on the
        number. A task with several combinations keeps their printed results, but no folder for each combination.
    sweep : dict, optional
        Scenario keys, or options with their dashes, and the values of each: `{"path.period": [6, 12], "--seed": range(10)}`. The campaign runs
        every combination.
    engine : {"local", "hyperqueue", "dask", "slurm"}
        Engine that runs the tasks.
    workers : int, optional
        Number of tasks at a time. Default: one for each core of this machine.
    cluster : str, optional
        A running cluster: HyperQueue's server folder, Dask's scheduler address, Slurm's partition. Default: HyperQueue and Dask start a cluster
        on this machine, and Slurm uses its default partition.
    attempts : int
        Number of attempts for each task.
    keep : bool
        True: keep the sealed recordings of "blind".
    progress : callable or bool, optional
        Function that receives a line when tasks are finished. True: print the lines on standard error.
    **command_options
        Options of the command: `cases=2000, seed=7`.

    Returns
    -------
    Campaign

    Raises
    ------
    BadUsage
        An argument or an option is unknown, or `out` contains another campaign.
    PeerMissing
        The cluster does not answer, or it ended.
    KeyboardInterrupt
        Ctrl-C: the tasks end on all machines. The results of finished tasks stay.
    FreeplayError
        Tasks failed in all attempts. The message quotes the first failed task. The results of finished tasks stay.

    Examples
    --------
    >>> proof = campaign("blind", cases=2000, seed=7, engine="hyperqueue", out="proved")  # doctest: +SKIP
    >>> swept = campaign("run", "s.toml", sweep={"clearance.joint_5": [2e-4, 4e-4]}, out="swept")  # doctest: +SKIP
    """
    if engine not in _campaign_engines.ENGINES:
        raise BadUsage(f"unknown engine {engine!r}: choose one of {', '.join(_campaign_engines.ENGINES)}")
    workers = workers or os.cpu_count() or 1
    folder = Path(out).absolute()
    known = _plan_in(folder)
    words = [command, *(str(each) for each in arguments), *options(**command_options)]
    if command == "blind" and _value(words, "--seed") is None:
        # All shards use one seed. A continued campaign takes it from its plan.
        words += ["--seed", str((known or {}).get("seed") or secrets.randbits(63))]
    if shards is None and known:
        shards = known.get("shards")
    plan, tasks = _plan(words, sweep or {}, shards, 4 * workers, keep)
    _lay_out(folder, plan, tasks, known)
    work = _campaign_engines.Work(folder, range(len(tasks)), workers, attempts, cluster)
    _carry_out(folder, plan, engine, work, progress)
    found = Campaign(folder)
    found.merge()
    return found


#: The commands of a task, in order. `at` contains the swept values, `arguments` the command line.
Points = list[dict[str, Any]]


def _plan(words: list[str], sweep: Mapping[str, Iterable[object]], shards: int | None, many: int, keep: bool) -> tuple[dict[str, Any], list[Points]]:
    """The plan, and the points of each task. `many` is the default number of shards of "blind"."""
    command, is_proof = words[0], words[0] == "blind" and not sweep
    cut: list[tuple[dict[str, object], list[str]]]
    if is_proof:
        # Each shard uses one core, because many shards run in parallel. The command rejects a shard without cases.
        words = words if _value(words, "--jobs") else [*words, "--jobs", "1"]
        count = shards or many
        cases = 40 if not {"--full", "--matrix"} & set(words) else count
        count = min(count, int(_value(words, "--cases") or cases))
        cut = [({"shard": shard + 1}, ["--shard", f"{shard + 1}/{count}"]) for shard in range(count)]
    elif sweep:
        cut = list(_combinations(sweep))
        count = min(shards or len(cut), len(cut))
    else:
        raise BadUsage(f"{command} has no shards: give a sweep, such as sweep={{'--seed': range(10)}}")
    folder = [] if command in PRINT_ONLY else ["--out", "{result}"]
    points = [{"at": at, "arguments": [*words, *more, *folder, "--format", "json"]} for at, more in cut]
    seed = _value(words, "--seed")
    # The commands of one task share a result folder, so it must be empty again before the next of them.
    surplus = [""] if count < len(points) else ["sealed"] if is_proof and not keep else []
    plan = {
        "schema": PLAN_SCHEMA, "command": command, "version": _command.version(), "executable": str(_command.executable()),
        "seed": None if seed is None else int(seed), "shards": count, "surplus": surplus, "tasks": count,
    }  # fmt: skip
    bounds = [task * len(points) // count for task in range(count + 1)]
    return plan, [points[first:last] for first, last in itertools.pairwise(bounds)]


def _value(words: Sequence[str], flag: str) -> str | None:
    """The value of the option `flag` in the arguments `words`. None without the option."""
    for word, following in zip(words, [*words[1:], ""]):
        if word == flag:
            return following
        if word.startswith(f"{flag}="):
            return word.partition("=")[2]
    return None


def _combinations(sweep: Mapping[str, Iterable[object]]) -> Iterator[tuple[dict[str, object], list[str]]]:
    """Every combination of the values of `sweep`, with its command-line arguments."""
    names = list(sweep)
    for values in itertools.product(*(list(sweep[name]) for name in names)):
        words: list[str] = []
        for name, value in zip(names, values):
            words += [name, str(value)] if name.startswith("--") else ["--set", f"{name}={_toml.value(value)}"]
        yield dict(zip(names, values)), words


def _plan_in(folder: Path) -> dict[str, Any] | None:
    """The plan of the campaign in `folder`. None if the folder has none."""
    path = folder / PLAN
    if not path.exists():
        return None
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BadInput(f"{path} is not a plan of a campaign ({error}): remove the folder, or choose another one") from None
    return plan if isinstance(plan, dict) else {}


def _lay_out(folder: Path, plan: dict[str, Any], tasks: list[Points], known: dict[str, Any] | None) -> None:
    """Writes the plan to `folder`, or checks that the existing plan in the folder is the same."""
    lines = "".join(json.dumps(points, default=str, ensure_ascii=False) + "\n" for points in tasks)
    if known is not None:
        there = (folder / LINES).read_text(encoding="utf-8") if (folder / LINES).exists() else None
        if {**known, "executable": None} != {**plan, "executable": None} or there != lines:
            raise BadUsage(f"{folder} contains another campaign: choose another folder, or give the same arguments")
    elif folder.is_dir() and any(folder.iterdir()):
        raise BadUsage(f"{folder} is not empty: choose another folder")
    (folder / TASKS).mkdir(parents=True, exist_ok=True)
    # Writes the plan last, so that a folder with a plan is complete.
    for name, text in ((LINES, lines), (PLAN, json.dumps(plan, indent=1) + "\n")):
        whole = own_name(folder, name)
        whole.write_text(text, encoding="utf-8")
        os.replace(whole, folder / name)


def _carry_out(folder: Path, plan: dict[str, Any], engine: str, work: _campaign_engines.Work, progress: Progress) -> None:
    """Runs the unfinished tasks with the engine, and repeats tasks that failed or were killed."""
    count = plan["tasks"]
    # An interrupted campaign left this file.
    (folder / STOP).unlink(missing_ok=True)
    try:
        with Watcher(folder / TASKS, count, teller(progress)):
            for attempt in range(work.attempts):
                missing = _missing(folder, count)
                if not missing or (attempt and _is_hopeless(folder, missing, count)):
                    break
                asked = _campaign_engines.Work(work.folder, missing, min(work.workers, len(missing)), work.attempts, work.cluster)
                _campaign_engines.start(engine, asked)
    except KeyboardInterrupt:
        done = count - len(_missing(folder, count))
        raise KeyboardInterrupt(f"campaign interrupted: {done} of {count} tasks are done, in {folder / TASKS}. The same call continues the campaign.") from None
    _sweep_out(folder)
    missing = _missing(folder, count)
    if missing:
        raise _failure(folder, missing, count)
    shutil.rmtree(folder / FAILED, ignore_errors=True)


def _missing(folder: Path, count: int) -> list[int]:
    """The unfinished tasks."""
    return [task for task in range(count) if not (folder / TASKS / name_of(task)).is_dir()]


def _is_hopeless(folder: Path, missing: list[int], count: int) -> bool:
    """True if every task failed and no signal ended it: another attempt would fail again."""
    said = [folder / FAILED / f"{name_of(task)}.txt" for task in missing]
    return len(missing) == count and all(path.is_file() and "exit code -" not in path.read_text()[:16] for path in said)


def _sweep_out(folder: Path) -> None:
    """Removes the incomplete folders of killed tasks. Waits up to 10 s for tasks that have not ended yet."""
    patience = time.monotonic() + 10.0
    while parts := list((folder / TASKS).glob(".*")):
        for part in parts:
            shutil.rmtree(part, ignore_errors=True)
        if time.monotonic() > patience:
            break
        time.sleep(0.05)


def _failure(folder: Path, missing: list[int], count: int) -> FreeplayError:
    done = count - len(missing)
    words = f"{len(missing)} of {count} tasks are not done; {done} are, in {folder / TASKS}. The same call continues the campaign."
    said = folder / FAILED / f"{name_of(missing[0])}.txt"
    if not said.is_file():
        return InternalFault(f"{words} A signal ended the tasks, or their workers are gone.")
    code, _, log = said.read_text(encoding="utf-8").partition("\n")
    lines = [line.removeprefix("freeplay: ") for line in log.splitlines() if line.startswith(("freeplay: ", "error: "))] or log.splitlines()[-3:]
    number = int(code.rsplit(" ", 1)[-1])
    kind = {2: BadUsage, 3: BadInput}.get(number, InternalFault)
    return kind(f"{words} Error of the first one: {' '.join(lines[-1:])} ({code})")


class Campaign:
    """Results of a campaign.

    Attributes
    ----------
    folder : Path
        Folder of the results. `Campaign(folder)` opens an earlier campaign, finished or not.
    command : str
        The distributed command.
    """

    def __init__(self, folder: PathLike) -> None:
        self.folder = Path(folder).absolute()
        plan = _plan_in(self.folder)
        if plan is None or plan.get("schema") != PLAN_SCHEMA:
            raise BadInput(f"{self.folder} contains no campaign: it has no {PLAN} with the schema {PLAN_SCHEMA}")
        self._plan = plan
        self.command: str = plan["command"]

    @property
    def done(self) -> list[int]:
        """Numbers of the finished tasks."""
        return [task for task in range(self._plan["tasks"]) if self.folder_of(task).is_dir()]

    def folder_of(self, task: int) -> Path:
        """The folder of a task. It contains `result` with the command's files, `printed.json` with its output, `log.txt` and `task.json`."""
        return self.folder / TASKS / name_of(task)

    @property
    def receipt(self) -> Path:
        """Path of `receipt.json`: the result of every case, without times and machines. It does not depend on the distribution of the cases."""
        return self.folder / "receipt.json"

    @property
    def results(self) -> pd.DataFrame:
        """The results of the finished cases.

        Returns
        -------
        DataFrame
            For "blind" the cases as in `Proof.cases`. Otherwise one row for each entry that a command printed: the task, the swept values, the
            numbers and texts of the entry, and the duration of the command, s.
        """
        import pandas as pd

        if self.command == "blind":
            from .proof import Proof

            frames = [Proof(self.folder_of(task) / RESULT).cases for task in self.done]
            return pd.concat(frames).sort_index() if frames else pd.DataFrame()
        rows = []
        for task, at, printed, seconds in self._printed():
            rows += [{"task": task, **at, **_flat(entry), "seconds": seconds} for entry in _entries(printed)]
        return pd.DataFrame(rows)

    @property
    def proof(self) -> Any:
        """The merged `Proof` of a campaign with "blind"."""
        from .proof import Proof

        return Proof(self.folder / "merged")

    def merge(self) -> Path:
        """Merges the finished tasks into one receipt. The time is proportional to the number of cases; the memory does not grow with it.
        Simultaneous merges give the same receipt.

        Returns
        -------
        Path
            The receipt.
        """
        head: dict[str, Any] = {"schema": _campaign_receipt.SCHEMA, "command": self.command, "version": self._plan["version"]}
        if self.command != "blind":
            printed = (canonical({"at": at, "found": steady(found)}) for _, at, found, _ in self._printed())
            _campaign_receipt.write(self.receipt, head, printed)
            return self.receipt
        head |= self._merged_proof()
        with _campaign_receipt.Sorted(own_name(self.folder, "cases")) as cases:
            not_made: list[str] = []
            for task in self.done:
                shard = json.loads((self.folder_of(task) / RESULT / "receipt.json").read_text(encoding="utf-8"))
                head["program"], draw = shard["parts"][0]["program"], shard["parts"][0]["draw"]
                head["seed"], head["quota"] = draw["seed"], draw["quota"]
                not_made += (words for part in shard["parts"] for words in part["not_made"])
                for each in shard["cases"].values():
                    cases.add(canonical(steady({name: each[name] for name in ("truth", "answer", "outcome")})))
            head["not_made"] = sorted(not_made)
            _campaign_receipt.write(self.receipt, head, cases)
        return self.receipt

    def _merged_proof(self) -> dict[str, Any]:
        """Merges the receipts of the shards into one proof. Returns the parts of its score that do not change from run to run."""
        part, merged, old = (own_name(self.folder, what) for what in ("merged", "merged", "replaced"))
        merged = self.folder / "merged"
        told = call(["blind", "--merge", *(self.folder_of(task) / RESULT for task in self.done), *options(out=part, format="json")])
        try:
            if merged.is_dir():
                os.rename(merged, old)
            os.rename(part, merged)
        except OSError:
            # Another merge was faster. It had the same shards or more.
            shutil.rmtree(part, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
        score = told.json()
        return {"outcomes": score["outcomes"], "goals": [goal for goal in score["goals"] if goal.get("unit") != "s"]}

    def _printed(self) -> Iterator[tuple[int, dict[str, Any], Any, float]]:
        """For each finished case: the number of its task, the swept values, the printed document, and the duration, s."""
        with open(self.folder / LINES, encoding="utf-8") as lines:
            for task, line in enumerate(lines):
                folder = self.folder_of(task)
                if folder.is_dir():
                    seconds = json.loads((folder / TASK).read_text(encoding="utf-8"))["each"]
                    documents = _documents((folder / PRINTED).read_text(encoding="utf-8"))
                    for point, printed, took in zip(json.loads(line), documents, seconds, strict=True):
                        yield task, point["at"], printed, took

    def __repr__(self) -> str:
        return f"<Campaign {self.command}: {len(self.done)} of {self._plan['tasks']} tasks done, in {self.folder}>"


def _documents(text: str) -> Iterator[Any]:
    """The consecutive JSON documents in `text`."""
    decoder, space, at = json.JSONDecoder(), re.compile(r"\s*"), 0
    while (match := space.match(text, at)) and (at := match.end()) < len(text):
        document, at = decoder.raw_decode(text, at)
        yield document


def _entries(printed: Any) -> list[dict[str, Any]]:
    """The rows of a printed document: its list of runs, faults, verdicts, swaps, cells or rows, else the document itself."""
    if isinstance(printed, list):
        return [each for each in printed if isinstance(each, dict)]
    for name in ("runs", "faults", "verdicts", "swaps", "cells", "rows"):
        held = printed.get(name)
        if isinstance(held, list) and held and isinstance(held[0], dict):
            return held
    return [printed]


def _flat(entry: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """The numbers and texts of `entry`. Nested ones have dotted names."""
    flat: dict[str, Any] = {}
    for name, held in entry.items():
        if name in _campaign_receipt.VOLATILE:
            continue
        if isinstance(held, Mapping):
            flat.update(_flat(held, f"{above}{name}."))
        elif not isinstance(held, list):
            flat[above + name] = held
    return flat
