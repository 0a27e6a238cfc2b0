"""Generates the reference page of the package from its docstrings.

    python python/reference.py > docs/python-reference.md
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import freeplay

HEAD = """# The Python package, name by name

`python python/reference.py > docs/python-reference.md` generates this page from the docstrings, and a test compares the two. [The guide](guide/python.md) explains how
to begin.
"""
ORDER = [
    "Recording", "Arm", "compare", "Comparison", "diagnose", "Diagnosis", "run", "Run", "Controller", "Answer", "serve", "examine", "Exam",
    "blind", "Proof", "campaign", "Campaign", "FreeplayError", "BadUsage", "BadInput", "MachineNotFit", "PeerMissing", "InternalFault",
    "Interrupted", "NotInstalled",
]  # fmt: skip


def signature(held: Any) -> str:
    """The parameters of `held` with their defaults, without types, which the list below contains."""
    parameters = [p for p in inspect.signature(held).parameters.values() if p.name not in ("self", "cls")]
    words, marked = [], False
    for p in parameters:
        if p.kind is p.KEYWORD_ONLY and not marked and not any(q.kind is q.VAR_POSITIONAL for q in parameters):
            words.append("*")
        marked = marked or p.kind is p.KEYWORD_ONLY
        star = {p.VAR_POSITIONAL: "*", p.VAR_KEYWORD: "**"}.get(p.kind, "")
        words.append(f"{star}{p.name}" + ("" if p.default is p.empty else f"={p.default!r}"))
    return f"({', '.join(words)})"


def text(docstring: str) -> str:
    """Converts a NumPy-style docstring to Markdown: section titles in bold, parameters as a list."""
    lines, section = [], ""
    source = inspect.cleandoc(docstring).split("\n")
    for number, line in enumerate(source):
        following = source[number + 1] if number + 1 < len(source) else ""
        if re.fullmatch(r"-{3,}", following) and line:
            section = line
            lines.append(f"**{line}**\n")
        elif re.fullmatch(r"-{3,}", line):
            continue
        elif line.startswith(">>>"):
            lines.append(f"    {line}".replace("  # doctest: +SKIP", ""))
        elif section == "Examples" and line:
            lines.append(f"    {line}")
        elif section and line.startswith("    "):
            lines.append(f"  {line.strip()}")
        elif section and line:
            name, colon, kind = line.partition(" : ")
            lines.append(f"- `{name}`: {kind}." if colon else f"- {line}")
        else:
            lines.append(line)
    return "\n".join(lines)


def members(held: type) -> list[tuple[str, Any]]:
    """The public methods and properties of a class, in the order of the source."""
    return [(name, member) for name, member in vars(held).items() if not name.startswith("_") and getattr(member, "__doc__", None) and not isinstance(member, (str, int))]


def described(name: str, held: Any) -> str:
    """The Markdown section of the function or class `held`."""
    if not isinstance(held, type):
        return f"## {name}{signature(held)}\n\n{text(held.__doc__)}\n"
    parts = [f"## class {name}\n\n{text(held.__doc__ or '')}\n"]
    for member, value in members(held):
        if isinstance(value, property):
            parts.append(f"### {name}.{member}\n\n{text(value.__doc__ or '')}\n")
        else:
            parts.append(f"### {name}.{member}{signature(getattr(held, member))}\n\n{text(value.__doc__ or '')}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    print(HEAD)
    print("\n".join(described(name, getattr(freeplay, name)) for name in ORDER), end="")
