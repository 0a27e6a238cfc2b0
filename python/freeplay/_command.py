"""Finds the `freeplay` executable and runs it."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Union

from ._campaign_task import path_with_python
from .errors import InternalFault, NotInstalled, error_of

#: A file or folder.
PathLike = Union[str, "os.PathLike[str]"]
#: Receiver of progress. `True`: lines on standard error. A function: receives each line. `None` or `False`: no progress.
Progress = Union[Callable[[str], object], bool, None]

# Environment variable with the path of an executable that replaces the installed one.
VARIABLE = "FREEPLAY_EXECUTABLE"


@dataclass(frozen=True)
class Completed:
    """Exit code and output of a command."""

    code: int
    stdout: str
    stderr: str

    def json(self) -> Any:
        """Standard output as JSON."""
        try:
            return json.loads(self.stdout)
        except ValueError as error:
            raise InternalFault(f"the output of the command is not JSON ({error}): {self.stdout[:200]!r}") from None


def executable() -> Path:
    """Path of the executable: the one in FREEPLAY_EXECUTABLE, else the one installed with this package, else the one on the PATH.

    Raises
    ------
    NotInstalled
        None of them exists.
    """
    named = os.environ.get(VARIABLE)
    if named:
        if not os.access(named, os.X_OK):
            raise NotInstalled(f"{VARIABLE} is {named}, which is not an executable file")
        return Path(named).absolute()
    schemes = [sysconfig.get_path("scripts"), sysconfig.get_path("scripts", f"{os.name}_user")]
    for folder in schemes:
        installed = Path(folder) / "freeplay"
        if os.access(installed, os.X_OK):
            return installed
    found = shutil.which("freeplay")
    if found is None:
        raise NotInstalled(
            f"the freeplay executable is neither in {schemes[0]} nor on the PATH: install the wheel with pip, or set {VARIABLE} to the executable"
        )
    return Path(found).absolute()


@lru_cache(maxsize=1)
def version() -> str:
    """The version of the executable, such as "0.1.0"."""
    words = call(["--version"]).stdout.split()
    return words[1] if len(words) > 1 else "unknown"


def call(
    arguments: Sequence[object],
    *,
    accept: Sequence[int] = (0,),
    progress: Progress = None,
    cwd: PathLike | None = None,
    env: dict[str, str] | None = None,
) -> Completed:
    """Runs the executable with `arguments` and waits for it.

    Parameters
    ----------
    arguments : sequence
        The arguments after `freeplay`. Numbers and paths are converted to text.
    accept : sequence of int
        Exit codes that raise no error.
    progress : callable, bool or None
        Function that receives each line of standard error immediately.
    cwd : path, optional
        Working directory of the command.
    env : dict, optional
        Additional environment variables.

    Raises
    ------
    FreeplayError
        The exit code is not in `accept`. The exception has the command's message.
    """
    command = [str(executable()), *(str(argument) for argument in arguments)]
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
        cwd=cwd,
        env={**os.environ, "PATH": path_with_python(), "NO_COLOR": "1", **(env or {})},
    )
    lines: list[str] = []
    try:
        reader = threading.Thread(target=_pass_on, args=(process.stderr, lines, teller(progress)), daemon=True)
        reader.start()
        assert process.stdout is not None
        stdout = process.stdout.read()
        code = process.wait()
    except BaseException:
        # SIGINT lets the command close its recordings. After 10 s SIGKILL ends it.
        process.send_signal(signal.SIGINT)
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        raise
    reader.join()
    completed = Completed(code, stdout, "".join(lines))
    if code not in accept:
        raise error_of(code, _words(completed), command)
    return completed


def teller(progress: Progress) -> Callable[[str], object] | None:
    """The function that receives the lines of progress, or None without progress."""
    if progress is True:
        return _in_notebook() or (lambda line: print(line, file=sys.stderr, flush=True))
    return progress or None


def _in_notebook() -> Callable[[str], object] | None:
    """In a notebook: a function that overwrites one line under the cell. Elsewhere: None, and each line appears below the last."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython.display import display

    handle = display({"text/plain": "…"}, raw=True, display_id=True)
    return lambda line: handle.update({"text/plain": line}, raw=True)


def _pass_on(stream: Any, lines: list[str], tell: Callable[[str], object] | None) -> None:
    for line in stream:
        lines.append(line)
        if tell is not None:
            tell(line.rstrip("\n"))
    stream.close()


def _words(completed: Completed) -> str:
    """The error message of a failed command: its standard error from the last line that begins with `freeplay:` or `error:`."""
    lines = completed.stderr.splitlines()
    starts = [number for number, line in enumerate(lines) if re.match(r"(freeplay|error): ", line)]
    words = "\n".join(lines[starts[-1] :] if starts else lines[-5:]).strip()
    words = re.sub(r"^(freeplay|error): ", "", words)
    points_back = completed.code in (5, 70) or "above" in words
    if points_back and starts and (before := "\n".join(lines[max(0, starts[-1] - 20) : starts[-1]]).strip()):
        # Includes the last lines of a controller or plant that ended.
        words += f"\n{before}"
    if completed.code < 0:
        name = signal.Signals(-completed.code).name
        words = f"{name} ended the command" + (f"; its last output: {words}" if words else "")
    return words or f"the command ended with exit code {completed.code} and printed nothing"


def options(**values: object) -> list[str]:
    """Command-line options: `seed=1` becomes `--seed 1`. None and False give no option, True gives the flag alone, a list repeats the flag."""
    words: list[str] = []
    for name, value in values.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif isinstance(value, (list, tuple)):
            for item in value:
                words += [flag, str(item)]
        else:
            words += [flag, str(value)]
    return words
