"""Pairs of distance and voltage from CSV files as loggers and spreadsheets write them.

What separates the cells is found by the heading: whichever delimiter makes the wanted columns of it. Nothing else is
guessed: a file that could be read in two ways is refused.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from qpsafe.errors import ConfigurationError

#: Columns, and how many of each unit make one of the unit that the column is read in (m, V); the first is the default.
COLUMNS: dict[str, dict[str, float]] = {
    "spot": {},
    "distance": {"m": 1.0, "cm": 100.0, "mm": 1000.0},
    "voltage": {"V": 1.0, "mV": 1000.0},
}
DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
#: Larger files are none that a person measured [bytes].
LARGEST = 20_000_000
FARTHEST, HIGHEST = 5.0, 5.0  # of any such sensor [m, V]
_UNITS = "distance [m], [cm] or [mm], voltage [V] or [mV]"
#: A name, and its unit after a space, an underscore, a slash or in brackets.
_HEADING = re.compile(r"(spot|distance|voltage)(?:[\s_/\[(]+(?:in\s+)?([^\s\])]+)\s*[\])]?)?", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


class _Column(NamedTuple):
    place: int
    scale: float


def read_pairs(path: Path) -> list[tuple[str, float, float]]:
    """Pairs (spot, distance [m], voltage [V]) of a CSV file; `docs/reference/sensing.md` says what it may look like.

    Raises:
        ConfigurationError: Names the file, the line and the value that is wrong, or the delimiter found and the columns
            missing.
    """
    lines = list(io.StringIO(_text(path), newline=""))  # csv wants lines with their ends
    top = next((k for k, line in enumerate(lines) if not _is_remark(line)), 0)
    delimiter, width, columns = _heading(path, top + 1, lines[top].rstrip("\r\n") if lines else "")
    rows: list[tuple[str, list[str]]] = []
    reader = csv.reader(lines[top + 1 :], delimiter=delimiter, skipinitialspace=True)
    try:
        for row in reader:
            key = f"line {top + 1 + reader.line_num}"
            if any(cell.strip() for cell in row) and not row[0].startswith("#"):
                rows.append((key, _cells(path, key, row, width, columns)))
    except csv.Error as problem:
        key = f"line {top + 1 + reader.line_num}"
        raise ConfigurationError(path, key, str(problem), "a row of a CSV file") from None
    if not rows:
        raise ConfigurationError(path, "rows", 0, "at least one pair")
    comma = not any("." in cell for _, row in rows for cell in row[1:])  # else a comma is no decimal mark
    pairs = []
    for key, (spot, *cells) in rows:
        numbers = []
        for name, cell, most in zip(("distance", "voltage"), cells, (FARTHEST, HIGHEST), strict=True):
            numbers.append(_number(path, f"{key}, {name}", cell, comma, columns[name].scale, name, most))
        pairs.append((spot, *numbers))
    return pairs  # type: ignore[return-value]


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ValueError(f"it is larger than {LARGEST:,} bytes")
        encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "utf-8")
        if encoding == "utf-8" and b"\0" in content[:2]:  # UTF-16 without a mark: the heading is plain letters
            encoding = "utf-16-be" if content[0] == 0 else "utf-16-le"
        return content.decode(encoding)
    except UnicodeDecodeError as problem:
        line = content.count(b"\n", 0, problem.start) + 1
        expected = f"text in UTF-8 or UTF-16 (line {line}: {problem.reason}); a spreadsheet writes 'CSV UTF-8'"
        raise ConfigurationError(path, "file", path.name, expected) from None
    except (OSError, ValueError) as problem:
        raise ConfigurationError(path, "file", path.name, f"a readable CSV file ({problem})") from None


def _is_remark(line: str) -> bool:
    """Before the heading: nothing, a comment, or what spreadsheets say about the delimiter."""
    return not line.strip() or line.lstrip().startswith("#") or line.strip().lower().startswith("sep=")


def _heading(path: Path, number: int, line: str) -> tuple[str, int, dict[str, _Column]]:
    """The delimiter that makes the wanted columns of the heading, how many there are, and where these are."""
    split: dict[str, list[str]] = {}
    for delimiter in DELIMITERS:
        try:
            split[delimiter] = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        except csv.Error as problem:
            raise ConfigurationError(path, f"line {number}", line, f"a heading ({problem})") from None
        columns = {name: _matching(split[delimiter], name) for name in COLUMNS}
        if all(len(found) == 1 for found in columns.values()):
            width = len(split[delimiter])
            return delimiter, width, {name: found[0] for name, found in columns.items()}
    delimiter = max(split, key=lambda d: len(split[d]))
    cells, wrong = split[delimiter], []
    for name in COLUMNS:
        found = _matching(cells, name)
        if len(found) != 1:
            wrong.append(f"{name} {'is missing' if not found else f'is there {len(found)} times'}")
    parts = f"{DELIMITERS[delimiter]} between {len(cells)} columns" if len(cells) > 1 else "no delimiter"
    expected = f"the columns spot, distance, voltage ({_UNITS}): found {parts}; {', '.join(wrong)}"
    raise ConfigurationError(path, f"line {number}", line.strip(), expected)


def _matching(cells: Sequence[str], name: str) -> list[_Column]:
    """Columns that are called so, with a unit that is known or without."""
    units = {unit.lower(): scale for unit, scale in COLUMNS[name].items()}
    found = []
    for place, cell in enumerate(cells):
        match = _HEADING.fullmatch(cell.strip())
        if match and match.group(1).lower() == name:
            unit = match.group(2)
            if unit is None or unit.lower() in units:
                found.append(_Column(place, 1.0 if unit is None else units[unit.lower()]))
    return found


def _cells(path: Path, key: str, row: list[str], width: int, columns: dict[str, _Column]) -> list[str]:
    """Spot, distance and voltage of a row, as they are written."""
    if any(cell.strip() for cell in row[width:]):
        expected = f"at most {width} values, as many as headings (is a decimal comma between commas?)"
        raise ConfigurationError(path, key, ",".join(row), expected)
    places = [columns[name].place for name in COLUMNS]
    if len(row) <= max(places) or not row[places[0]].strip():
        raise ConfigurationError(path, key, ",".join(row), "a spot, a distance and a voltage")
    return [row[place].strip() for place in places]


def _number(path: Path, key: str, text: str, comma: bool, scale: float, name: str, most: float) -> float:
    if not _NUMBER.fullmatch(text) or ("," in text and not comma):
        raise ConfigurationError(path, key, text, "a finite number without a unit, one decimal mark in the whole file")
    value = float(text.replace(",", ".")) / scale
    possible = 0.0 < value <= most or (value == 0.0 and name == "voltage")
    if not possible:
        unit = "m" if name == "distance" else "V"
        hint = f"; the heading may state another unit: {_UNITS}" if value > most and scale == 1.0 else ""
        raise ConfigurationError(path, key, value, f"a {name} of 0 to {most:g} {unit}{hint}")
    return value
