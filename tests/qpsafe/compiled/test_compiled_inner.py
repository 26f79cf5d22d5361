"""Inner functions take a short way through numba: the same results as by numba's own, and nobody else notices."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import types

from qpsafe.bench.compilation import PACKAGES, modules
from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import OPTIONS, entry, inline, seconds
from qpsafe.compiled.memory import view


def mixed(a: np.ndarray, b: np.ndarray, k: int) -> float:
    """Loops, negative indices, slices, integers among floats, min and max, NaN on the way."""
    total, count = 0.0, 0
    for i in range(a.shape[0]):
        part = b[i, 1:]
        total += min(max(a[-1 - i] / part[k], -3.0), 7.0) + abs(part[-1]) ** 2
        count += 1 if a[i] > part[0] else -i
    return total * count if total == total else float(count)


own_inner = inline(mixed)
numba_inner = numba.njit(error_model="numpy")(mixed)
_arrays = types.float64[::1], types.float64[:, ::1]


@entry(types.float64(*_arrays, types.int64))
def by_own(a: np.ndarray, b: np.ndarray, k: int) -> float:
    return own_inner(a, b, k) + own_inner(b[0], b, k)


@numba.njit(types.float64(*_arrays, types.int64))
def by_numba(a: np.ndarray, b: np.ndarray, k: int) -> float:
    return numba_inner(a, b, k) + numba_inner(b[0], b, k)


def test_the_bits_are_those_of_numba() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b = rng.normal(size=5), rng.normal(size=(5, 5)) * rng.choice([0.0, 1.0, 1e3], (5, 5))
        a[rng.random(5) < 0.05] = np.nan
        assert np.array(by_own(a, b, 1)).tobytes() == np.array(by_numba(a, b, 1)).tobytes()


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


def test_operators_of_other_types_are_found_afterwards() -> None:
    @numba.njit
    def others(text: str, pairs: tuple, table: np.ndarray) -> tuple:
        numbers = [3, 4, 5]
        known = {"a": 1.5}
        return text[1], pairs[1], numbers[-1], known["a"], (table[1] + table)[0]

    assert others("abc", (1, "x"), np.arange(3.0)) == ("b", "x", 5, 1.5, 1.0)


def test_a_mistake_is_told_as_numba_tells_it() -> None:
    @inline
    def wrong(a):  # type: ignore[no-untyped-def]
        return a["x"]

    @numba.njit(**OPTIONS)
    def caller(a):  # type: ignore[no-untyped-def]
        return wrong(a)

    with pytest.raises(numba.TypingError, match="getitem"):
        caller(np.zeros(3))
