"""Numbers in sentences: one of a thing is no plural, anywhere in the code."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.text.words import counted, file_word, growth

ROOT = Path(__file__).resolve().parents[3]
FILES = [file for folder in ("qpsafe", "sim", "tasks") for file in (ROOT / folder).rglob("*.py")]
NOUNS = (
    "bodies|cycles|datagrams|frames|joints|levels|links|moments|nodes|packets|pairs|points|regions|robots|runs|seeds"
)
NOUNS += "|segments|spots|tasks|ticks"
PLURAL = re.compile(rf" (\w+ )?({NOUNS})\b")


@given(st.integers(0, 10**9))
def test_only_one_is_singular(number: int) -> None:
    assert counted(number, "point") == f"{number} point" + ("s" if number != 1 else "")


@given(st.floats(-1e12, 1e12))
def test_memory_that_shrinks_does_not_grow_by_less_than_nothing(change: float) -> None:
    text = growth(change)
    assert "-" not in text
    size = float(text.split()[2])
    assert (size if text.startswith("grown") else -size) == pytest.approx(change / 1e6, abs=5.1e-4)


def test_no_sentence_puts_a_plural_behind_any_whole_number() -> None:
    """An f-string's `{n} points` would say "1 points"; numbers with decimals are followed by a plural anyway."""
    wrong = []
    for file in FILES:
        if any(parent.is_symlink() for parent in file.parents):
            continue
        text = file.read_text(encoding="utf-8")
        if not re.search(rf"\}}([\"']\s*f?[\"'])?{PLURAL.pattern}", text):  # no such word behind a value
            continue
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.JoinedStr):
                continue
            for value, after in zip(node.values, node.values[1:], strict=False):
                whole = isinstance(value, ast.FormattedValue) and value.format_spec is None
                if whole and isinstance(after, ast.Constant) and re.match(PLURAL, str(after.value)):
                    wrong.append(f"{file.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)}")
    assert not wrong, "\n".join(wrong)


def test_a_name_as_a_part_of_a_files_makes_no_folder_and_hides_nothing() -> None:
    found = [file_word(name) for name in ("default", "../x.py:make", "/a/b c.py:f", "ümlaut")]
    assert found == ["default", "x.py-make", "a-b-c.py-f", "ümlaut"]
