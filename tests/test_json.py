"""JSON written anywhere is valid JSON."""

from __future__ import annotations

import ast
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.text.json_text import json_text

ROOT = Path(__file__).resolve().parents[1]
HELPER = ROOT / "qpsafe" / "text" / "json_text.py"
FOLDERS = ("qpsafe", "tasks", "sim", "robots", "examples", "benchmarks", "docs")

numbers = st.none() | st.booleans() | st.integers() | st.floats() | st.text()
values = st.recursive(numbers, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20)


def expected(value: object) -> object:
    """What a reader must find."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, list):
        return [expected(item) for item in value]
    return {key: expected(item) for key, item in value.items()} if isinstance(value, dict) else value


@given(values)
def test_what_is_written_is_read_again_and_what_is_not_finite_is_null(value: object) -> None:
    def refuse(name: str) -> None:
        raise AssertionError(name)

    assert json.loads(json_text(value), parse_constant=refuse) == expected(value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.array([1.5, np.nan, -np.inf]), "[1.5, null, null]"),
        (np.float32("inf"), "null"),
        ((np.int64(3), np.bool_(True)), "[3, true]"),
        ({1: Path("a")}, '{"1": "a"}'),
    ],
)
def test_arrays_and_others(value: object, text: str) -> None:
    assert json_text(value, indent=None) == text


def test_nothing_else_writes_json() -> None:
    """Every other writer could write NaN."""
    calls = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for folder in FOLDERS
        for path in (ROOT / folder).rglob("*.py")
        if path != HELPER and "dump" in (text := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if (isinstance(node, ast.Attribute) and node.attr in ("dump", "dumps") and "json" in ast.unparse(node.value))
        or (isinstance(node, ast.ImportFrom) and node.module == "json" and any("dump" in a.name for a in node.names))
    ]
    assert calls == []
