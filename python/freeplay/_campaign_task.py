"""One task of a campaign: a command, and its results moved to their place as a whole. Engines start it as a process.

    python -I -S _campaign_task.py FOLDER NUMBER

It may be killed at any moment and started again, also while another one is at work on the same task: whoever is done first leaves the
results. Only the standard library is imported, for it is started once a task.
"""

from __future__ import annotations

import ctypes
import itertools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

#: The plan of a campaign, in its folder, and what each task does, a line a task.
PLAN, LINES = "campaign.json", "tasks.jsonl"
#: The folder of the finished tasks, and those of one task.
TASKS, RESULT, PRINTED, LOG, TASK, FAILED = "tasks", "result", "printed.json", "log.txt", "task.json", "failed"
# prctl: the signal that a process gets when its parent dies.
PR_SET_PDEATHSIG = 1


def name_of(number: int) -> str:
    """The folder of task `number`, counted from 0."""
    return f"{number:06d}"


def points_of(folder: Path, number: int) -> list[dict[str, Any]]:
    """What task `number` does, one after the other."""
    with open(folder / LINES, encoding="utf-8") as lines:
        return list(json.loads(next(itertools.islice(lines, number, None))))


def perform(folder: Path, number: int) -> int:
    """Does task `number` of the campaign in `folder`; the exit code, 0 if its results are there."""
    name = name_of(number)
    final = folder / TASKS / name
    if final.is_dir():
        return 0
    plan = json.loads((folder / PLAN).read_text(encoding="utf-8"))
    part = folder / TASKS / f".{name}-{socket.gethostname()}-{os.getpid()}"
    # Left by a task that was killed and had the same number of its process.
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    at, begun, seconds, codes = time.time(), time.monotonic(), [], []
    with open(part / PRINTED, "wb") as printed, open(part / LOG, "wb") as log:
        for point in points_of(folder, number):
            started = time.monotonic()
            command = [plan["executable"], *(word.replace("{result}", str(part / RESULT)) for word in point["arguments"])]
            code = subprocess.call(command, stdin=subprocess.DEVNULL, stdout=printed, stderr=log, preexec_fn=_end_with_parent)
            if code not in (0, 1):
                _fail(folder, part, name, code)
                return code if 0 < code < 128 else 70
            for surplus in plan["surplus"]:
                shutil.rmtree(part / RESULT / surplus, ignore_errors=True)
            seconds.append(time.monotonic() - started)
            codes.append(code)
    told = {"exit_codes": codes, "begun": at, "seconds": time.monotonic() - begun, "each": seconds, "host": socket.gethostname()}
    (part / TASK).write_text(json.dumps(told) + "\n", encoding="utf-8")
    try:
        os.rename(part, final)
    except OSError:
        if not final.is_dir():
            raise
        shutil.rmtree(part, ignore_errors=True)
    return 0


def _fail(folder: Path, part: Path, name: str, code: int) -> None:
    """Keeps what the command said, for the campaign to tell, and removes the rest."""
    said = (part / LOG).read_text(encoding="utf-8", errors="replace")
    failed = folder / FAILED
    failed.mkdir(exist_ok=True)
    (failed / f"{name}.txt").write_text(f"exit code {code}\n{said}", encoding="utf-8")
    shutil.rmtree(part, ignore_errors=True)


def _end_with_parent() -> None:
    """Ends the command with this process: a task that is killed leaves nothing at work."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(perform(Path(sys.argv[1]), int(sys.argv[2])))
