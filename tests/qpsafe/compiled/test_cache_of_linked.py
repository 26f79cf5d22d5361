"""Cached compiled code that calls other compiled code: after a change of either, as an upgrade is, both are new."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from amounts import first, some

CALLEE = """
from numba import types
from qpsafe.compiled.compiled import entry

@entry(types.float64(types.float64))
def callee(x):
    return {body}
"""
CALLER = """
from numba import types
from qpsafe.compiled.compiled import entry, linked
{imports}

@entry(types.float64(types.float64){uses})
def caller(x):
    return {body}
"""
INLINE = """
from qpsafe.compiled.compiled import inline, linked
from called import callee

_callee = linked(callee)

@inline
def middle(x):
    return _callee(x) + 100.0
"""
FORMS = {
    "its own": ("from called import callee\n_callee = linked(callee)", "", "_callee(x)", 0.0),
    "of what it uses": ("import between\nfrom between import middle", ", between", "middle(x)", 100.0),
}


def answer(folder: Path, x: float) -> float:
    """What the caller says, in a process of its own with a cache in the folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(folder)}
    code = f"from calling import caller; print(caller({x}))"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


@pytest.mark.long
@pytest.mark.parametrize("form", first(1, reversed(FORMS)))
def test_a_changed_callee_is_the_one_that_is_called(tmp_path: Path, form: str) -> None:
    """It was an abort of the process: the cached caller asked for the name of a callee that is not there any more."""
    imports, uses, body, more = FORMS[form]
    (tmp_path / "between.py").write_text(INLINE, encoding="utf-8")
    (tmp_path / "calling.py").write_text(CALLER.format(imports=imports, uses=uses, body=body), encoding="utf-8")
    for number, text in enumerate(("x + 1.0", "x * 3.0", "x + 1.0", "x - 2.5")[: some(2, of=4)]):
        called = tmp_path / "called.py"
        called.write_text(CALLEE.format(body=text), encoding="utf-8")
        os.utime(called, (1e9 + number, 1e9 + number))  # sources of the same second are another time, too
        assert answer(tmp_path, 5.0) == eval(text, {"x": 5.0}) + more
        assert answer(tmp_path, 7.0) == eval(text, {"x": 7.0}) + more


@pytest.mark.slow
def test_a_changed_caller_is_the_one_that_answers(tmp_path: Path) -> None:
    imports, uses, _, _ = FORMS["its own"]
    (tmp_path / "called.py").write_text(CALLEE.format(body="x + 1.0"), encoding="utf-8")
    for number, (body, wanted) in enumerate((("_callee(x)", 6.0), ("2.0 * _callee(x)", 12.0), ("_callee(x)", 6.0))):
        calling = tmp_path / "calling.py"
        calling.write_text(CALLER.format(imports=imports, uses=uses, body=body), encoding="utf-8")
        os.utime(calling, (1e9 + number, 1e9 + number))
        assert answer(tmp_path, 5.0) == wanted
