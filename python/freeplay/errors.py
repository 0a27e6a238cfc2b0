"""The exceptions of the package, with the messages of the command."""

from __future__ import annotations

from collections.abc import Sequence


class FreeplayError(Exception):
    """A command failed.

    `str(error)` is the message of the command. It names the file, the line, the value and the remedy.

    Attributes
    ----------
    code : int
        Exit code of the command. Negative: minus the number of the signal that ended the command.
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
    """An argument or a scenario key is unknown or malformed (exit code 2)."""

    exit_code = 2


class BadInput(FreeplayError, ValueError):
    """A file, a scenario or a recording is invalid (exit code 3)."""

    exit_code = 3


class MachineNotFit(FreeplayError):
    """The computer does not meet a requirement, such as a real-time kernel (exit code 4)."""

    exit_code = 4


class PeerMissing(FreeplayError):
    """Another process is missing: a controller did not start, or the plant or a cluster ended (exit code 5)."""

    exit_code = 5


class InternalFault(FreeplayError):
    """The program or the computer failed (exit code 70), or a signal ended the command."""

    exit_code = 70


class Interrupted(FreeplayError):
    """A signal interrupted the command, which closed its recordings (exit code 130)."""

    exit_code = 130


class NotInstalled(FreeplayError, ImportError):
    """The `freeplay` executable, or a package or program that a call needs, is not installed."""

    exit_code = 5


_KINDS: dict[int, type[FreeplayError]] = {
    kind.exit_code: kind for kind in (BadUsage, BadInput, MachineNotFit, PeerMissing, Interrupted)
}


def error_of(code: int, message: str, command: Sequence[str]) -> FreeplayError:
    """The exception for a command that ended with exit code `code` and the message `message`."""
    return _KINDS.get(code, InternalFault)(message, code, command)
