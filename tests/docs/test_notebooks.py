"""The notebooks run from the first cell to the last; they hold no output, which would be old at once."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_is_committed_without_output(notebook: Path) -> None:
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []
    assert any("assert " in "".join(cell["source"]) for cell in cells)  # it says what must hold


@pytest.mark.slow  # three kernels, each of which imports everything
def test_the_notebooks_run() -> None:
    assert len(NOTEBOOKS) == 3
    command = [sys.executable, "-m", "pytest", "--nbmake", "-p", "no:xdist", "-p", "no:cacheprovider", "-q", *NOTEBOOKS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
