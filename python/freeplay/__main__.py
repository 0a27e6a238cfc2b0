"""`python -m freeplay` runs the `freeplay` command. The package itself implements `campaign`."""

from __future__ import annotations

import os
import signal
import sys

from . import _command
from .errors import FreeplayError


def main(arguments: list[str]) -> int:
    """Runs the command line `arguments` and returns the exit code."""
    try:
        if arguments[:1] == ["campaign"]:
            from ._campaign_command import main as campaign

            # SIGTERM ends a campaign as Ctrl-C does, even if a shell started it in the background and ignores SIGINT.
            for ending in (signal.SIGINT, signal.SIGTERM):
                signal.signal(ending, signal.default_int_handler)
            return int(campaign(arguments[1:]))
        command = _command.executable()
        os.execv(command, [str(command), *arguments])
    except FreeplayError as error:
        print(f"freeplay: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt as interrupt:
        print(f"freeplay: {interrupt or 'interrupted'}", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
