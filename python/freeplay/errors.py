"""The errors of the package, with the words of the command."""

from __future__ import annotations

from collections.abc import Sequence


class FreeplayError(Exception):
    """The command failed.

    `str(error)` has the words of the command: the file, the line, the value and the remedy.

    Attributes
    ----------
    code : int
        Exit code of the command; negative: the number of the signal that ended it.
    command : list of str
        The command line.
    """

    #: Exit code of the command for errors of this kind.
    exit_code = 70

    def __init__(self, message: str, code: int | None = None, command: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.code = self.exit_code if code is None else code
        self.command = list(command)


class BadUsage(FreeplayError, ValueError):
    """An argument or a key of a scenario is unknown or has a wrong form (exit code 2)."""

    exit_code = 2


class BadInput(FreeplayError, ValueError):
    """A file, a scenario or a recording is unusable (exit code 3). Nothing was written."""

    exit_code = 3


class MachineNotFit(FreeplayError):
    """The machine does not meet a requirement, such as a real-time kernel (exit code 4)."""

    exit_code = 4


class PeerMissing(FreeplayError):
    """Another process is missing: a controller does not come, the plant or a cluster is gone (exit code 5)."""

    exit_code = 5


class InternalFault(FreeplayError):
    """The program or the machine has a fault (exit code 70), or a signal ended the command."""

    exit_code = 70


class Interrupted(FreeplayError):
    """The command was interrupted (exit code 130). It closed its recordings."""

    exit_code = 130


class NotInstalled(FreeplayError, ImportError):
    """The `freeplay` executable, or a package that an option needs, is not installed."""

    exit_code = 5


_KINDS: dict[int, type[FreeplayError]] = {
    kind.exit_code: kind for kind in (BadUsage, BadInput, MachineNotFit, PeerMissing, Interrupted)
}


def error_of(code: int, message: str, command: Sequence[str]) -> FreeplayError:
    """The exception for a command that ended with `code` and said `message`."""
    return _KINDS.get(code, InternalFault)(message, code, command)
