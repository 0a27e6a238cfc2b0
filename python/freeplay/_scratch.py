"""Folders that live as long as what lies in them is used."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path


class Scratch:
    """A folder under the system's temporary one; removed with this object, or at the end of the process."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="freeplay-"))
        weakref.finalize(self, shutil.rmtree, self.path, True)

    def __truediv__(self, name: str) -> Path:
        return self.path / name
