"""`python -m freeplay`: the command, and `python -m freeplay campaign`, which is this package's own."""

from __future__ import annotations

import os
import sys

from . import _command
from .errors import FreeplayError


def main(arguments: list[str]) -> int:
    """Does what `arguments` say; the exit code."""
    try:
        if arguments[:1] == ["campaign"]:
            from ._campaign_command import main as campaign

            return int(campaign(arguments[1:]))
        command = _command.executable()
        os.execv(command, [str(command), *arguments])
    except FreeplayError as error:
        print(f"freeplay: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
