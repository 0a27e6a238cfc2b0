"""Checks the Python blocks of the guide and of the READMEs: every name exists, and every call fits its signature."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import freeplay

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*(ROOT / "docs/guide").glob("*.md"), ROOT / "README.md", ROOT / "python/README.md"])


def blocks() -> list[Any]:
    """Every Python block, with its page and its number."""
    found = []
    for page in PAGES:
        text = page.read_text()
        for number, block in enumerate(re.findall(r"^```python[^\n]*\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)):
            found.append(pytest.param(block, id=f"{page.relative_to(ROOT)}-{number + 1}"))
    return found


class Known:
    """Placeholder for a value while a test reads a block. `kind` is its class, if the package annotates it."""

    def __init__(self, kind: Any = None) -> None:
        self.kind = kind


def returned(held: Any) -> Any:
    """The class that a call of `held` returns. None for a class outside of the package."""
    if inspect.isclass(held):
        return held
    name = str(getattr(held, "__annotations__", {}).get("return", ""))
    return getattr(freeplay, name, None) if name.isidentifier() else None


def looked_up(node: ast.expr, names: dict[str, Known]) -> Any:
    """The object of the package that the expression `node` refers to. None for objects outside of the package."""
    if isinstance(node, ast.Name):
        return freeplay if node.id == "freeplay" else names.get(node.id)
    if isinstance(node, ast.Attribute):
        held = looked_up(node.value, names)
        if isinstance(held, Known):
            held = held.kind
        if held is None:
            return None
        assert hasattr(held, node.attr), f"{ast.unparse(node)}: {held!r} has no {node.attr}"
        return getattr(held, node.attr)
    if isinstance(node, ast.Call):
        return Known(returned(looked_up(node.func, names)))
    return None


def check_call(call: ast.Call, held: Any) -> None:
    """Checks that the arguments of `call` fit the signature of `held`."""
    if any(isinstance(word, ast.Starred) for word in call.args) or any(word.arg is None for word in call.keywords):
        return
    method = inspect.isfunction(held) and "." in held.__qualname__
    values = [None] * (len(call.args) + (1 if method else 0))
    try:
        inspect.signature(held).bind(*values, **{str(word.arg): None for word in call.keywords})
    except TypeError as error:
        raise AssertionError(f"{ast.unparse(call)}: {error}") from error


def checked(block: str) -> int:
    """Checks a block, and returns the number of its calls of the package."""
    names: dict[str, Known] = {}
    count = 0
    for statement in ast.parse(block).body:
        for node in ast.walk(statement):
            if isinstance(node, ast.Attribute):
                looked_up(node, names)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                held = looked_up(node.func, names)
                if callable(held) and not isinstance(held, Known):
                    check_call(node, held)
                    count += 1
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            value = looked_up(statement.value, names)
            names[statement.targets[0].id] = value if isinstance(value, Known) else Known()
    return count


@pytest.mark.parametrize("block", blocks())
def test_a_block_is_understood(block: str) -> None:
    calls = checked(block)
    assert calls > 0 or "freeplay." not in block


def test_a_wrong_block_is_not() -> None:
    for wrong in [
        "freeplay.diagnos('a', [])",
        "freeplay.diagnose('a', [], sed=1)",
        "found = freeplay.diagnose('a', [])\nfound.plots(0)",
        "found = freeplay.diagnose('a', [])\nfound.plot_found(0, 1, 2, 3, 4, 5, 6)",
        "freeplay.Recording.from_frame(1, colums={})",
    ]:
        with pytest.raises(AssertionError):
            checked(f"import freeplay\n\n{wrong}\n")
