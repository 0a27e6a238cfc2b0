"""The receipt of a campaign: the result of every case. Its bytes do not depend on the distribution of the cases.

Files sort the cases of all shards by their hashes, so that the memory does not grow with their number.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

SCHEMA = "freeplay.campaign/1"
#: Fields that change from run to run of the same case: times, machines, salts, and drawn names.
VOLATILE = frozenset({
    "latency_us", "deadlines", "machine", "salt", "cpu_seconds", "seconds", "isolation", "files", "config_hash", "freeplay", "scenario",
})  # fmt: skip
# Number of characters that a bucket collects in memory before it writes them to its file.
HELD = 1 << 18


def canonical(value: Any) -> str:
    """The canonical text of a JSON value: sorted keys, no spaces."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))


def steady(value: Any) -> Any:
    """`value` without the fields in `VOLATILE`."""
    if isinstance(value, dict):
        return {name: steady(held) for name, held in value.items() if name not in VOLATILE}
    return [steady(held) for held in value] if isinstance(value, list) else value


def own_name(folder: Path, what: str) -> Path:
    """A path in `folder` that is unique to this process and thread."""
    return folder / f".{what}-{os.getpid()}-{threading.get_ident()}"


class Sorted:
    """Sorts texts by their hashes. It stores them in files in `folder`, one for each of 256 buckets."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.held = folder, [list[str]() for _ in range(256)]
        self.sizes = [0] * 256
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)

    def add(self, text: str) -> None:
        """Adds a text without line breaks."""
        digest = hashlib.sha256(text.encode()).digest()
        bucket = digest[0]
        self.held[bucket].append(f"{digest.hex()} {text}\n")
        self.sizes[bucket] += len(text)
        if self.sizes[bucket] > HELD:
            with open(self.folder / f"{bucket:02x}", "a", encoding="utf-8") as file:
                file.writelines(self.held[bucket])
            self.held[bucket], self.sizes[bucket] = [], 0

    def __iter__(self) -> Iterator[str]:
        for bucket, held in enumerate(self.held):
            path = self.folder / f"{bucket:02x}"
            lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.exists() else []
            lines += [line[:-1] for line in held]
            yield from (line[65:] for line in sorted(lines))

    def __enter__(self) -> Sorted:
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


def write(path: Path, head: Mapping[str, Any], cases: Iterable[str]) -> None:
    """Writes a receipt with the fields of `head` and the texts of `cases` to `path`, atomically. Its `sha256` is the hash of the canonical text
    of all other fields."""
    # In the canonical text the cases precede every field of the head.
    assert all(name > "cases" for name in head)
    whole, part = hashlib.sha256(b'{"cases":['), own_name(path.parent, "receipt")
    with open(part, "w", encoding="utf-8") as file:
        file.write("{\n" + "".join(f" {canonical(name)}: {canonical(head[name])},\n" for name in head) + ' "cases": [')
        comma = ""
        for text in cases:
            whole.update(f"{comma}{text}".encode())
            file.write(f"{comma}\n  {text}")
            comma = ","
        whole.update(("]," + canonical(head)[1:]).encode())
        file.write(f'\n ],\n "sha256": "{whole.hexdigest()}"\n}}\n')
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, path)
