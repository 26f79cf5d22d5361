"""Where in a TOML text a key stands, so that a mistake can be named with its line."""

from __future__ import annotations

import re
from collections.abc import Sequence

Key = tuple[str | int, ...]
_HEAD = re.compile(r"\s*+(\[\[?)([^\]]++)\]")
_KEY = re.compile(r"\s*+([\w.\"'-]++)\s*+=")


def toml_lines(text: str) -> list[str]:
    """The lines of a TOML text, without their ends: only a newline ends one, not all that `str.splitlines` takes."""
    return text.replace("\r\n", "\n").removesuffix("\n").split("\n")


def line_of(text: str, keys: Sequence[str | int]) -> int:
    """Line, from 1, of a key such as ``("segment", 2, "to")``, or of the innermost table around it that has a line."""
    lines = key_lines(text)
    for length in range(len(keys), 0, -1):
        if tuple(keys[:length]) in lines:
            return lines[tuple(keys[:length])]
    return 1


def key_lines(text: str) -> dict[Key, int]:
    """Line, from 1, of every table and every key at the beginning of a line; keys of inline tables have none."""
    found: dict[Key, int] = {}
    counts: dict[Key, int] = {}  # of the tables in each array so far
    table: Key = ()
    for number, line in enumerate(toml_lines(text), start=1):
        if head := _HEAD.match(line):
            table = _inside(counts, _split(head.group(2)))
            if head.group(1) == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = (*table, counts[table] - 1)
            found.setdefault(table, number)
        elif key := _KEY.match(line):
            found.setdefault((*table, *_split(key.group(1))), number)
    return found


def _inside(counts: dict[Key, int], table: Key) -> Key:
    """A header's key with the numbers of the array tables it is in: the latest of each."""
    key: Key = ()
    for part in table[:-1]:
        key = (*key, part)
        key = (*key, counts[key] - 1) if key in counts else key
    return (*key, *table[-1:])


def _split(dotted: str) -> Key:
    return tuple(part.strip(" \"'") for part in dotted.split("."))
