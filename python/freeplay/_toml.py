"""Writes values and tables as TOML, for mapping files and scenario keys."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence


def value(item: object) -> str:
    """`item` as a TOML value: text, numbers, lists, and dicts as inline tables.

    Raises
    ------
    TypeError
        TOML can't represent `item`.
    """
    if hasattr(item, "tolist"):  # of NumPy and pandas
        item = item.tolist()
    if isinstance(item, bool):
        return "true" if item else "false"
    if isinstance(item, (str, os.PathLike)):
        return json.dumps(str(item), ensure_ascii=False)
    if isinstance(item, int):
        return str(item)
    if isinstance(item, float):
        return repr(item) if math.isfinite(item) else str(item)
    if isinstance(item, Mapping):
        return "{ " + ", ".join(f"{key(name)} = {value(held)}" for name, held in item.items()) + " }"
    if isinstance(item, Sequence):
        return "[" + ", ".join(value(held) for held in item) + "]"
    raise TypeError(f"TOML cannot represent a value of type {type(item).__name__}: {item!r}")


def key(name: str) -> str:
    """`name` as a TOML key, quoted if necessary."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def leaves(table: Mapping[str, object], above: str = "") -> Iterator[tuple[str, str]]:
    """Pairs of a dotted key and its value as TOML, for all values of `table`."""
    for name, item in table.items():
        # A name may contain dots, as on the command line.
        own = name if re.fullmatch(r"[A-Za-z0-9_.-]+", name) else key(name)
        path = f"{above}.{own}" if above else own
        if isinstance(item, Mapping):
            yield from leaves(item, path)
        elif item is not None:
            yield path, value(item)
