"""Temporary folders that are removed together with the objects that use them."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class Scratch:
    """A temporary folder. It is removed with this object or at the end of the process. A pickle includes its files."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="freeplay-"))
        weakref.finalize(self, shutil.rmtree, self.path, True)

    def __truediv__(self, name: str) -> Path:
        return self.path / name

    def __deepcopy__(self, memo: dict[int, object]) -> Scratch:
        # The files no longer change, so copies share the folder.
        return self

    def __getstate__(self) -> dict[str, bytes]:
        files = (file for file in self.path.rglob("*") if file.is_file())
        return {str(file.relative_to(self.path)): file.read_bytes() for file in files}

    def __setstate__(self, files: dict[str, bytes]) -> None:
        Scratch.__init__(self)
        for name, held in files.items():
            (self.path / name).parent.mkdir(parents=True, exist_ok=True)
            (self.path / name).write_bytes(held)


@dataclass(frozen=True)
class _Inside:
    """A path relative to a scratch folder."""

    path: Path


class Portable:
    """Base class of objects whose copies and pickles include the files of their scratch folder."""

    _scratch: Scratch | None

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        if self._scratch is not None:
            root = self._scratch.path
            inside = {name: held for name, held in state.items() if isinstance(held, Path) and held.is_relative_to(root)}
            state.update({name: _Inside(held.relative_to(root)) for name, held in inside.items()})
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._scratch is not None:
            root = self._scratch.path
            self.__dict__.update({name: root / held.path for name, held in state.items() if isinstance(held, _Inside)})
