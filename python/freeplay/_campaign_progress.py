"""Progress display of a campaign, for every engine."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path
from typing import Any

# Period of the checks, s.
LOOK = 0.5


class Watcher:
    """Reports the number of finished tasks out of `count`. It counts the folders in `tasks` with final names."""

    def __init__(self, tasks: Path, count: int, tell: Any) -> None:
        self.tasks, self.count, self.tell = tasks, count, tell
        self.stop, self.begun = threading.Event(), time.monotonic()
        self.before = self.done()
        self.thread = threading.Thread(target=self._watch, daemon=True)

    def done(self) -> int:
        """Number of finished tasks."""
        return sum(1 for entry in os.scandir(self.tasks) if not entry.name.startswith("."))

    def __enter__(self) -> Watcher:
        if self.tell:
            self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop.set()
        if self.tell:
            self.thread.join()
            self._say(self.done())

    def _watch(self) -> None:
        told = -1
        while not self.stop.wait(LOOK):
            done = self.done()
            if done != told:
                self._say(done)
                told = done

    def _say(self, done: int) -> None:
        seconds = time.monotonic() - self.begun
        new = done - self.before
        rest = f", about {(self.count - done) * seconds / new:.0f} s left" if 0 < new and done < self.count else ""
        self.tell(f"campaign  {done} of {self.count} tasks, {seconds:.0f} s{rest}")
