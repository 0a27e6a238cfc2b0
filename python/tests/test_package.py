"""Tests of the whole package: types, names, reference page, notebooks."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import freeplay
from freeplay import controller

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def test_every_name_is_there_and_documented() -> None:
    for name in freeplay.__all__:
        held = getattr(freeplay, name)
        assert name.isupper() or held.__doc__, f"{name} is not documented"
    assert set(freeplay.__all__) <= set(dir(freeplay)) and freeplay.__version__[0].isdigit()
    with pytest.raises(AttributeError):
        getattr(freeplay, "no_such_name")


def test_a_controller_starts_without_pandas() -> None:
    script = "import freeplay, sys; freeplay.Controller; sys.exit('pandas' in sys.modules or 'numpy' in sys.modules)"
    assert subprocess.call([sys.executable, "-c", script]) == 0


def test_the_sdk_is_one_file_that_works_alone(tmp_path: Path) -> None:
    shutil.copy(str(controller.__file__), tmp_path / "controller.py")
    script = "import controller; assert controller.Controller and controller.serve"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, check=True)


def test_types_are_strict() -> None:
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", "-p", "freeplay"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_reference_page_is_that_of_the_docstrings() -> None:
    page = ROOT.parent / "docs/python-reference.md"
    made = subprocess.run([sys.executable, str(ROOT / "reference.py")], capture_output=True, text=True, check=True).stdout
    assert page.read_text(encoding="utf-8") == made, "python python/reference.py > docs/python-reference.md"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(path, as_version=4)
    if any("rosbags" in cell.source for cell in notebook.cells):
        pytest.importorskip("rosbags")
    assert not any(cell.get("outputs") for cell in notebook.cells), "kept without outputs"
    for data in (ROOT / "notebooks").glob("*.csv"):
        shutil.copy(data, tmp_path)
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    errors = [output for cell in notebook.cells for output in cell.get("outputs", []) if output.output_type == "error"]
    assert not errors
    for cell in notebook.cells:
        if "plot_" in cell.source or "plt." in cell.source:
            shown = [output for output in cell.get("outputs", []) if "image/png" in output.get("data", {})]
            assert shown or cell.cell_type != "code", f"no picture: {cell.source}"
    kept = os.environ.get("FREEPLAY_NOTEBOOKS")
    if kept:
        nbformat.write(notebook, Path(kept) / path.name)


def test_there_are_notebooks() -> None:
    assert len(NOTEBOOKS) == 4
