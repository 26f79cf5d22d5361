"""What is said while kernels are made ready: a word if they are compiled, none if they are loaded, however slowly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

KERNEL = """
from numba import types
from qpsafe.compiled.compiled import entry

@entry(types.float64(types.float64))
def kernel(x):
    return 2.0 * x
"""
#: Every compilation, and every look into the cache, outlasts the patience: a machine that is busy beyond measure.
BUSY = """
import time
from numba.core.dispatcher import _FunctionCompiler
from numba.core.caching import FunctionCache
from qpsafe.compiled import compiled
compiled.PATIENCE = 0.0
look = FunctionCache.load_overload
FunctionCache.load_overload = lambda *given: (time.sleep(0.5), look(*given))[1]
run = _FunctionCompiler.compile
_FunctionCompiler.compile = lambda *given: (time.sleep(0.5), run(*given))[1]
import kernel
"""


def start(folder: Path, setting: str) -> str:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", setting], env=environment, capture_output=True, text=True, timeout=300, check=True
    )
    return done.stderr


@pytest.mark.slow
def test_it_says_compiling_if_and_only_if_something_compiles_for_long(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    assert start(tmp_path, BUSY).count("compiling for this machine") == 1
    assert "compiling" not in start(tmp_path, BUSY)  # it is in the cache
    patient = "from qpsafe.compiled import compiled\ncompiled.PATIENCE = 1e3\nimport kernel"
    with (tmp_path / "kernel.py").open("a") as file:
        file.write("\n# not in the cache any more\n")
    assert "compiling" not in start(tmp_path, patient)
