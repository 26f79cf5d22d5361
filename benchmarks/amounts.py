"""How much tests draw: a part in `make test`, which ends while one waits; all of it wherever slow tests run too."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import pytest
from _pytest.mark import ParameterSet

#: Set by tests/conftest.py before tests are collected.
VARIABLE, FEW, ALL = "QPSAFE_DRAWN", "few", "all"


def some(few: int, of: int) -> int:
    """So many draws, examples or ticks: `few` without the slow tests, else all."""
    return few if os.environ.get(VARIABLE) == FEW else of


def first(count: int, values: Iterable[Any]) -> list[Any]:
    """Values of a parameter, all but the first ones marked slow; tuples are values of several parameters."""
    chosen = [value if isinstance(value, tuple) else (value,) for value in values]
    return [pytest.param(*value, marks=pytest.mark.slow if k >= count else ()) for k, value in enumerate(chosen)]


def thinned(step: int, values: Iterable[Any]) -> list[Any]:
    """Values of one parameter, all but every so-manieth marked slow: for families of many that are alike."""
    return [
        pytest.param(*value.values, marks=(*value.marks, *marks), id=value.id)
        if isinstance(value, ParameterSet)
        else pytest.param(value, marks=marks)
        for k, value in enumerate(values)
        for marks in [(pytest.mark.slow,) if k % step else ()]
    ]


def crossed(one: Iterable[Any], other: Iterable[Any]) -> list[Any]:
    """All pairs; marked slow where neither is the first of its kind: each value is tried in any case."""
    ones, others = list(one), list(other)
    return [
        pytest.param(a, b, marks=pytest.mark.slow if i and j else ())
        for i, a in enumerate(ones)
        for j, b in enumerate(others)
    ]
