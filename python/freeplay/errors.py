"""What can go wrong, with the words of the command."""

from __future__ import annotations

from collections.abc import Sequence


class FreeplayError(Exception):
    """A command that could not do what was asked.

    `str(error)` is what the command says: the file, the line, the value and what to do.

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
    """An argument, or a key of a scenario, that is not understood (exit code 2)."""

    exit_code = 2


class BadInput(FreeplayError, ValueError):
    """A file, a scenario or a recording that can't be used (exit code 3). Nothing was written."""

    exit_code = 3


class MachineNotFit(FreeplayError):
    """The machine is not fit for what was required of it (exit code 4)."""

    exit_code = 4


class PeerMissing(FreeplayError):
    """The other process is missing: a controller that does not come, a plant that is gone (exit code 5)."""

    exit_code = 5


class InternalFault(FreeplayError):
    """A fault of the program or of the machine (exit code 70), or a signal that ended it."""

    exit_code = 70


class Interrupted(FreeplayError):
    """The command was interrupted (exit code 130). Recordings are closed properly."""

    exit_code = 130


class NotInstalled(FreeplayError, ImportError):
    """The `freeplay` executable, or a package that an option needs, is not there."""

    exit_code = 5


_KINDS: dict[int, type[FreeplayError]] = {
    kind.exit_code: kind for kind in (BadUsage, BadInput, MachineNotFit, PeerMissing, Interrupted)
}


def error_of(code: int, message: str, command: Sequence[str]) -> FreeplayError:
    """The exception for a command that ended with `code` and said `message`."""
    return _KINDS.get(code, InternalFault)(message, code, command)
