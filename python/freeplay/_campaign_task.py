"""One task of a campaign: runs commands, and then moves their results to the final folder atomically. Engines start this file as a process.

    python -I -S _campaign_task.py FOLDER NUMBER [--with-parent]

A task may be killed at any moment and started again, even while another process works on it. The results come from the first process that
finishes. SIGTERM, SIGINT, or the file `stop` in the campaign's folder end a task with its command; no incomplete results stay. With `--with-parent`
a task also ends with the process that started it. The module imports only the standard library, because each task starts it again.
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

#: Files in a campaign's folder: the plan, and the commands of the tasks, one line for each task.
PLAN, LINES = "campaign.json", "tasks.jsonl"
#: Folder of the finished tasks; files and folder of one task; folder with the output of failed tasks.
TASKS, RESULT, PRINTED, LOG, TASK, FAILED = "tasks", "result", "printed.json", "log.txt", "task.json", "failed"
#: While the campaign's folder contains this file, tasks end on all machines.
STOP = "stop"
# Exit code of an interrupted task, and the period of the checks for the file `stop`, s.
INTERRUPTED, LOOK = 130, 1.0
# Time for an interrupted command to end itself, s.
PATIENCE = 5.0
# Option of prctl: signal to a process when its parent dies.
PR_SET_PDEATHSIG = 1


def name_of(number: int) -> str:
    """Name of the folder of the task `number`, counted from 0."""
    return f"{number:06d}"


def path_with_python() -> str:
    """The PATH with this interpreter's folder in front. A controller that begins with `#!/usr/bin/env python3` then finds the packages of this
    environment, even if the environment is not activated."""
    return f"{os.path.dirname(sys.executable)}{os.pathsep}{os.environ.get('PATH', os.defpath)}"


def points_of(folder: Path, number: int) -> list[dict[str, Any]]:
    """The commands of the task `number`, in order."""
    with open(folder / LINES, encoding="utf-8") as lines:
        return list(json.loads(next(itertools.islice(lines, number, None))))


class Stopped(Exception):
    """The campaign or the task was interrupted."""


def perform(folder: Path, number: int) -> int:
    """Runs the task `number` of the campaign in `folder`. Returns the exit code, 0 if the results exist."""
    name = name_of(number)
    final = folder / TASKS / name
    if final.is_dir():
        return 0
    if (folder / STOP).exists():
        return INTERRUPTED
    plan = json.loads((folder / PLAN).read_text(encoding="utf-8"))
    part = folder / TASKS / f".{name}-{socket.gethostname()}-{os.getpid()}"
    # A killed task with the same process number may have left this folder.
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
    """Runs the commands of the task with their results in `part`. Returns the exit code of the first command that fails, else 0."""
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
    """Runs `command` until it ends, and returns the exit code.

    Raises
    ------
    Stopped
        The file `stop` exists, or a signal ends this process.
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
    """Signal handler: ends the task, and ignores further signals."""
    signal.signal(number, signal.SIG_IGN)
    raise Stopped


def _keep_words(folder: Path, part: Path, name: str, code: int) -> None:
    """Stores the output of a failed command, which the campaign quotes."""
    said = (part / LOG).read_text(encoding="utf-8", errors="replace")
    failed = folder / FAILED
    failed.mkdir(exist_ok=True)
    (failed / f"{name}.txt").write_text(f"exit code {code}\n{said}", encoding="utf-8")


def _end_with_parent() -> None:
    """Requests that the kernel ends this process with its parent, so that the command of a killed task ends too."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


if __name__ == "__main__":
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, _stop)
    if sys.argv[3:] == ["--with-parent"]:
        _end_with_parent()
    sys.exit(perform(Path(sys.argv[1]), int(sys.argv[2])))
