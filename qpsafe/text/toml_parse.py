"""Any text as TOML tables in bounded time, or one kind of error: every reader of a TOML file goes through here.

The standard library's reader recurses with the nesting, takes a time that grows with the square of a dotted key's
length, and accepts whole numbers that nothing else can hold or print. None of that is in a file that a person writes.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

#: A file larger than this is none that a person wrote [bytes].
LARGEST = 1_000_000
#: Tables and lists in each other, and parts of a dotted key.
DEEPEST = 10
#: TOML promises whole numbers of 64 bits.
_WHOLE = range(-(2**63), 2**63)
_BASIC, _LITERAL = r'"(?:[^"\\\n]|\\[^\n])*+"', r"'[^'\n]*+'"
_PART = rf"(?:(?<![\w-])[\w-]++|{_BASIC}|{_LITERAL})"
#: Comments and strings, in which dots mean nothing, and the group: a key of too many parts. From left to right, up to
#: the first mistake in a text, they are what the standard library reads; each is passed once, even if it never ends.
_TOKEN = re.compile(
    r'#[^\n]*+|"""(?:[^"\\]|\\.|"(?!""))*+(?:"{3,5}+|\\?\Z)'
    r"|'''(?:[^']|'(?!''))*+(?:'{3,5}+|\Z)"
    rf"|({_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST}}})|{_BASIC}?|{_LITERAL}?",
    re.DOTALL,
)


def read_bounded(path: Path) -> str:
    """The text of a file in UTF-8, of at most `LARGEST` bytes.

    Raises:
        OSError: It cannot be read.
        ValueError: Its name is none, it is too large, or not in UTF-8.
    """
    with path.open("rb") as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise ValueError(f"it is larger than {LARGEST:,} bytes")
    try:
        return content.decode("utf-8-sig")  # some editors begin a file with a mark that nobody sees
    except UnicodeDecodeError as problem:
        line = content.count(b"\n", 0, problem.start) + 1
        raise ValueError(f"it is not in UTF-8, in line {line}: {problem.reason}") from None


def toml_table(text: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Raises:
        tomllib.TOMLDecodeError: It is none, or one that nobody writes: nested too deep, or with a whole number of more
            than 64 bits.
    """
    if len(text) > LARGEST:
        raise tomllib.TOMLDecodeError(f"it is larger than {LARGEST:,} characters")
    if long := next((token for token in _TOKEN.finditer(text) if token[1]), None):
        line = text.count("\n", 0, long.start()) + 1
        raise tomllib.TOMLDecodeError(f"A key of more than {DEEPEST} parts (at line {line})")
    try:
        table = tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise tomllib.TOMLDecodeError(f"Tables or lists nested more than {DEEPEST} deep") from None
    except ValueError as problem:  # a number of more than some thousand digits, a date that is none
        raise tomllib.TOMLDecodeError(str(problem)) from None
    _check(table)
    return table


def _check(table: dict[str, Any]) -> None:
    """Depth and numbers, level by level, without recursion."""
    level: list[tuple[str, Any]] = [("", table)]
    for _ in range(DEEPEST + 1):
        below: list[tuple[str, Any]] = []
        for key, value in level:
            if isinstance(value, dict):
                below += value.items()
            elif isinstance(value, list):
                below += ((key, item) for item in value)
            elif isinstance(value, int) and value not in _WHOLE:
                raise tomllib.TOMLDecodeError(f"A whole number of more than 64 bits, of {key}")
        level = below
        if not level:
            return
    raise tomllib.TOMLDecodeError(f"Tables or lists nested more than {DEEPEST} deep, in {level[0][0]}")
