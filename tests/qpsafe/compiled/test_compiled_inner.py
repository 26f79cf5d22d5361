"""What compiled code shares: views, references, and kernels that are found wherever packages lie."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import types

from qpsafe.bench.compilation import PACKAGES, modules
from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import entry, inline, seconds
from qpsafe.compiled.memory import view


def cut(block: np.ndarray, rows: int) -> float:
    matrix, rest = view(block, 2, (rows, 3)), view(block, 2 + 3 * rows, (2,))
    rest[1] += matrix[rows - 1, 2]
    return matrix[1, 0] - view(matrix, 2, (2, 2))[1, 1] + rest[0]


cut_compiled = entry(types.float64(types.float64[::1], types.int64))(cut)


def test_a_view_is_the_same_array_in_python_and_compiled() -> None:
    for rows in (2, 3, 5):
        ours, theirs = np.random.default_rng(rows).normal(size=(2, 4 + 3 * rows))
        theirs[:] = ours
        assert cut_compiled(ours, rows) == cut(theirs, rows)
        assert ours.tobytes() == theirs.tobytes()


class Parts(NamedTuple):
    whole: np.ndarray
    numbers: np.ndarray
    half: np.ndarray


@inline
def fill(parts: Parts, value: float) -> int:
    for i in range(parts.half.shape[0]):
        parts.half[i] += value
        parts.numbers[i] = i
    return parts.whole.shape[0]


@entry(types.int64(types.float64[::1], types.int64[::1], types.float64))
def through_a_reference(a: np.ndarray, numbers: np.ndarray, value: float) -> int:
    parts = by_reference(Parts(a, numbers, a[a.shape[0] // 2 :]))
    return fill(parts, value) + fill(parts, 2.0 * value)


def test_a_reference_stands_for_the_tuple() -> None:
    a, numbers = np.arange(6.0), np.full(3, -1)
    assert through_a_reference(a, numbers, 10.0) == 12
    assert a.tolist() == [0.0, 1.0, 2.0, 33.0, 34.0, 35.0]
    assert numbers.tolist() == [0, 1, 2]


def test_every_kernel_is_timed() -> None:
    """Wherever packages lie: in the folders of a fresh clone, without links, or in a wheel."""
    found = modules()
    folders = {package: Path(importlib.import_module(package).__path__[0]) for package in PACKAGES}
    assert found == sorted(
        ".".join((package, *path.relative_to(folder).with_suffix("").parts))
        for package, folder in folders.items()
        for path in folder.rglob("*.py")
        if "entry(" in path.read_text("utf-8") and "def entry(" not in path.read_text("utf-8")
    )
    for name in found:
        importlib.import_module(name)
    own = {kernel.rsplit(".", 1)[0] for kernel in seconds if kernel.startswith("qpsafe.")}
    assert own - {"qpsafe.hqp.own.hierarchy"} == set(found) - {"qpsafe.hqp.own.solver"}
