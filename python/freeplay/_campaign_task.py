"""One task of a campaign: a command, and its results moved to their place as a whole. Engines start it as a process.

    python -I -S _campaign_task.py FOLDER NUMBER [--with-parent]

A task may be killed at any moment and started again, also while another process works on it: the first one that finishes leaves the results.
SIGTERM, SIGINT, or the file `stop` in the campaign's folder end a task: its command ends, and nothing half done stays. With `--with-parent` a task
also ends with the process that started it. The module imports the standard library alone, because each task starts it anew.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import IO, Any

#: The plan of a campaign, in its folder, and what each task does, a line a task.
PLAN, LINES = "campaign.json", "tasks.jsonl"
#: The folder of the finished tasks, and those of one task.
TASKS, RESULT, PRINTED, LOG, TASK, FAILED = "tasks", "result", "printed.json", "log.txt", "task.json", "failed"
#: While this file is in the campaign's folder, tasks end, on whatever machine they are.
STOP = "stop"
# Exit code of an interrupted task, and the time between two looks for the file, s.
INTERRUPTED, LOOK = 130, 1.0
# An interrupted command has this long to end in order, s.
PATIENCE = 5.0
# prctl: the signal that a process gets when its parent dies.
PR_SET_PDEATHSIG = 1


def name_of(number: int) -> str:
    """The folder of task `number`, counted from 0."""
    return f"{number:06d}"


def path_with_python() -> str:
    """The search path, this interpreter's folder first: a controller that begins with `#!/usr/bin/env python3` finds the packages beside this one,
    also in an environment that is not activated."""
    return f"{os.path.dirname(sys.executable)}{os.pathsep}{os.environ.get('PATH', os.defpath)}"


def points_of(folder: Path, number: int) -> list[dict[str, Any]]:
    """What task `number` does, one after the other."""
    with open(folder / LINES, encoding="utf-8") as lines:
        return list(json.loads(next(itertools.islice(lines, number, None))))


class Stopped(Exception):
    """The campaign was interrupted."""


def perform(folder: Path, number: int) -> int:
    """Carries out task `number` of the campaign in `folder`; the exit code, 0 if its results are there."""
    name = name_of(number)
    final = folder / TASKS / name
    if final.is_dir():
        return 0
    if (folder / STOP).exists():
        return INTERRUPTED
    plan = json.loads((folder / PLAN).read_text(encoding="utf-8"))
    part = folder / TASKS / f".{name}-{socket.gethostname()}-{os.getpid()}"
    # A killed task whose process had the same number may have left this folder.
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        code = _carry_out(folder, part, number, plan)
        if code:
            _keep_words(folder, part, name, code)
            return code if 0 < code < 128 else 70
        try:
            os.rename(part, final)
        except OSError:
            if not final.is_dir():
                raise
    except Stopped:
        return INTERRUPTED
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return 0


def _carry_out(folder: Path, part: Path, number: int, plan: dict[str, Any]) -> int:
    """Runs the commands of the task and leaves their results in `part`; the exit code of the first that fails, else 0."""
    at, begun, seconds, codes = time.time(), time.monotonic(), [], []
    with open(part / PRINTED, "wb") as printed, open(part / LOG, "wb") as log:
        for point in points_of(folder, number):
            started = time.monotonic()
            command = [plan["executable"], *(word.replace("{result}", str(part / RESULT)) for word in point["arguments"])]
            code = _run(command, printed, log, folder / STOP)
            if code not in (0, 1):
                return code
            for surplus in plan["surplus"]:
                shutil.rmtree(part / RESULT / surplus, ignore_errors=True)
            seconds.append(time.monotonic() - started)
            codes.append(code)
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    told = {
        "exit_codes": codes, "begun": at, "seconds": time.monotonic() - begun, "each": seconds, "host": socket.gethostname(),
        "cpu_seconds": sum(each.ru_utime + each.ru_stime for each in used),
    }  # fmt: skip
    (part / TASK).write_text(json.dumps(told) + "\n", encoding="utf-8")
    return 0


def _run(command: list[str], printed: IO[bytes], log: IO[bytes], stop: Path) -> int:
    """Runs `command` until it ends; the exit code.

    Raises
    ------
    Stopped
        The file `stop` is there, or a signal ends this process.
    """
    env = {**os.environ, "PATH": path_with_python()}
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=printed, stderr=log, env=env, preexec_fn=_end_with_parent)
    try:
        while not stop.exists():
            with contextlib.suppress(subprocess.TimeoutExpired):
                return process.wait(LOOK)
        raise Stopped
    except Stopped:
        process.terminate()
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        raise


def _stop(number: int, _frame: object) -> None:
    """Ends the task, once."""
    signal.signal(number, signal.SIG_IGN)
    raise Stopped


def _keep_words(folder: Path, part: Path, name: str, code: int) -> None:
    """Keeps what the command said, for the campaign to tell."""
    said = (part / LOG).read_text(encoding="utf-8", errors="replace")
    failed = folder / FAILED
    failed.mkdir(exist_ok=True)
    (failed / f"{name}.txt").write_text(f"exit code {code}\n{said}", encoding="utf-8")


def _end_with_parent() -> None:
    """Has the kernel end this process with its parent, so that a killed task leaves no command at work."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


if __name__ == "__main__":
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, _stop)
    if sys.argv[3:] == ["--with-parent"]:
        _end_with_parent()
    sys.exit(perform(Path(sys.argv[1]), int(sys.argv[2])))
