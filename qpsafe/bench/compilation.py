"""How long a first use compiles: all kernels of the project, from an empty cache, in a process of their own."""

from __future__ import annotations

import importlib.util
import json
import os
import pkgutil
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from qpsafe.text.json_text import json_text

#: In a source tree the last three lie beside the folder qpsafe, where walking through its folder does not lead.
PACKAGES = ("qpsafe", "qpsafe.tasks", "qpsafe.robots", "qpsafe.sim")


class Start(NamedTuple):
    """A process that makes all kernels ready.

    Attributes:
        kernels: Processor time of each kernel [s].
        processor: Processor time of the process, with everything it imports [s].
        wall: From its start to the last kernel [s].
    """

    kernels: dict[str, float]
    processor: float
    wall: float


def modules() -> list[str]:
    """Names of all modules of the project that have kernels, by their text: none of them is imported."""
    found = set()
    for package in PACKAGES:
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            spec = importlib.util.find_spec(module.name)
            if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
                continue
            if re.search(r"^@entry\(|= entry\(", Path(spec.origin).read_text(encoding="utf-8"), re.MULTILINE):
                found.add(module.name)
    return sorted(found)


def time_compilation() -> tuple[Start, Start]:
    """Two starts: the first one compiles all kernels, the second one loads them from the cache.

    The cache is a folder that is removed afterwards; the user's own is not looked at.
    """
    with tempfile.TemporaryDirectory(prefix="qpsafe-compile-") as cache:
        return _start(cache), _start(cache)


def _start(cache: str) -> Start:
    names = modules()
    code = f"from qpsafe.bench.compilation import _report; _report({names!r})"
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    kernels, processor = json.loads(done.stdout)
    return Start(kernels, processor, time.perf_counter() - begin)


def _report(names: list[str]) -> None:
    """In the other process: import the modules, print what it took."""
    for name in names:
        importlib.import_module(name)
    from qpsafe.compiled.compiled import seconds

    print(json_text((seconds, time.process_time()), indent=None))
