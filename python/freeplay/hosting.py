"""Hosts each Python controller in its own process: `run` writes an executable for each and passes its path to the command."""

from __future__ import annotations

import os
import pickle
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Union

from ._scratch import Scratch
from .controller import Controller, serve
from .errors import BadUsage

#: A built-in name, the path of an executable or an FMU, or a Python controller class or object.
ControllerLike = Union[str, "os.PathLike[str]", Controller, type[Controller]]


def argument(given: ControllerLike, scratch: Scratch, taken: set[str]) -> str:
    """The value of `--controller` for `given`: a name, or the path of an executable in `scratch` that runs it.

    Raises
    ------
    BadUsage
        `given` is not a controller, or can't be pickled.
    """
    if isinstance(given, (str, os.PathLike)):
        word = str(given)
        # A name without a folder means a file in the working directory if one exists, not a program on the PATH.
        return str(Path(word).absolute()) if os.sep not in word and Path(word).is_file() else word
    if not isinstance(given, Controller) and not (isinstance(given, type) and issubclass(given, Controller)):
        raise BadUsage(f"{given!r} is no controller: give a built-in name, the path of an executable or an FMU, or a freeplay.Controller")
    return str(_program(given, scratch, taken))


def _program(given: Controller | type[Controller], scratch: Scratch, taken: set[str]) -> Path:
    """Writes an executable that runs `given`, named after the controller."""
    import cloudpickle

    base = "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in given.name) or "python"
    name = next(each for each in (base, *(f"{base}-{number}" for number in range(2, 1000))) if each not in taken)
    taken.add(name)
    try:
        # Cloudpickle sends a class of the notebook or of the script whole; the other process imports one of a module.
        payload = cloudpickle.dumps(given)
    except Exception as error:
        raise BadUsage(f"controller {given.name!r} can't be pickled for another process: {error}") from error
    frozen, path = scratch / f"{name}.pickle", scratch / name
    frozen.write_bytes(pickle.dumps({"path": sys.path, "controller": payload}))
    frozen.chmod(0o600)
    words = [sys.executable, "-m", "freeplay.hosting", str(frozen)]
    package = Path(__file__).resolve().parent.parent
    path.write_text(f'#!/bin/sh\nPYTHONPATH={shlex.quote(str(package))}:"$PYTHONPATH" exec {shlex.join(words)} "$@"\n')
    path.chmod(0o700)
    return path


def host(frozen: str, arguments: Sequence[str]) -> None:
    """Unpickles the controller in the file `frozen` and serves it. The environment or `arguments` name the run."""
    held = pickle.loads(Path(frozen).read_bytes())
    sys.path[:] = list(dict.fromkeys(held["path"] + sys.path))
    controller = pickle.loads(held["controller"])
    serve(controller() if isinstance(controller, type) else controller, arguments)


if __name__ == "__main__":
    host(sys.argv[1], sys.argv[2:])
