"""Values written into the text of a `robot.toml`: comments and all other tables stay as they are."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.robot.robot_file.schema import Units
from qpsafe.sim.experiments.shared.folder import copied_folder
from qpsafe.sim.tuning.values import Values, present
from qpsafe.text.lines import toml_lines

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

#: Begins the comment that names the run; one of an earlier run gives way.
MARK = "# qpsafe tune:"
_HEADER = re.compile(r"""\s*\[\[?\s*[\w."' -]+\s*\]?\]\s*(#.*)?$""")


def write_folder(robot: Robot, values: Values, run: str, folder: Path) -> Path:
    """A copy of a robot's folder in which `robot.toml` states the values; its model stays where it is.

    Args:
        robot: Whose folder.
        values: To state.
        run: Which run they come from, in a line.
        folder: The copy's; what was there is replaced.

    Returns:
        The folder.

    Raises:
        ConfigurationError: The file is written in a way that cannot be edited.
    """
    copied_folder(robot, folder)
    write_values(folder / "robot.toml", robot, values, run)
    return folder


def write_values(file: Path, robot: Robot, values: Values, run: str) -> None:
    """State values in a robot's file, and read it again: it must say them, and all else as before.

    Args:
        file: The `robot.toml`.
        robot: That it describes.
        values: To state.
        run: Which run they come from, in a line.

    Raises:
        ConfigurationError: The file is written in a way that cannot be edited; it is as it was then.
    """
    before = file.read_text(encoding="utf-8-sig")  # some editors begin with a mark
    text = edited(before, _in_units(before, robot, values), f"{MARK} {run}")
    if text is None:
        expected = "tables [danger], [evasion], [recovery], [sensing] and [gate] with a line of its own for each key"
        raise ConfigurationError(file, "danger", "written in another way", expected)
    file.write_text(text, encoding="utf-8")
    try:
        off = farthest(present(load_quietly(file.parent)), values)
    except BaseException:
        file.write_text(before, encoding="utf-8")
        raise
    if off > 1e-9:
        file.write_text(before, encoding="utf-8")
        raise ConfigurationError(file, "danger", f"reads {off:.1g} off what was written", "the same values")


def farthest(first: Values, second: Values) -> float:
    """The largest relative difference of two sets of values."""
    worst = 0.0
    for key, one in vars(first).items():
        other = getattr(second, key)
        pairs = zip(one, other, strict=True) if isinstance(one, tuple) else [(one, other)]
        worst = max(worst, *(abs(a - b) / max(abs(a), abs(b), 1e-12) if a != b else 0.0 for a, b in pairs))
    return worst


def edited(text: str, tables: Mapping[str, Mapping[str, Any]], comment: str) -> str | None:
    """The text of a TOML file in which some tables state some values.

    Args:
        text: As it was.
        tables: Table -> key -> number or list of numbers.
        comment: Goes under the header of each of these tables.

    Returns:
        None where that could not be done by lines.
    """
    lines = toml_lines(text)
    for table, values in tables.items():
        lines = _with_table(lines, table, values, comment)
    found = "\n".join(lines) + "\n"
    wanted = tomllib.loads(text)
    for table, values in tables.items():
        kept = wanted.get(table, {})
        wanted[table] = (kept if isinstance(kept, dict) else {}) | dict(values)
    try:
        return found if tomllib.loads(found) == wanted else None
    except tomllib.TOMLDecodeError:
        return None


def _with_table(lines: list[str], table: str, values: Mapping[str, Any], comment: str) -> list[str]:
    header = re.compile(rf"\s*\[\s*{table}\s*\]\s*(#.*)?$")
    start = next((k for k, line in enumerate(lines) if header.match(line)), None)
    if start is None:
        stated = [f"{key} = {_shown(value)}" for key, value in values.items()]
        return [*lines, "", f"[{table}]", comment, *stated]
    end = next((k for k in range(start + 1, len(lines)) if _HEADER.match(lines[k])), len(lines))
    body, left = [comment], dict(values)
    k = start + 1
    while k < end:
        line = lines[k]
        key = line.partition("=")[0].strip()
        if key in left and "=" in line:
            stop = _end_of_value(lines, k, end)
            rest = _trailing_comment(lines[stop - 1])
            body.append(f"{key} = {_shown(left.pop(key))}{rest}")
            k = stop
            continue
        if not line.startswith(MARK):
            body.append(line)
        k += 1
    last = len(body)
    while last > 1 and (not body[last - 1].strip() or body[last - 1].lstrip().startswith("#")):
        last -= 1  # what stands over the next table belongs to it
    added = [f"{key} = {_shown(value)}" for key, value in left.items()]
    return [*lines[: start + 1], *body[:last], *added, *body[last:], *lines[end:]]


def _end_of_value(lines: list[str], start: int, end: int) -> int:
    """The line after a value that may go over several."""
    for stop in range(start + 1, end + 1):
        try:
            tomllib.loads("\n".join(lines[start:stop]))
            return stop
        except tomllib.TOMLDecodeError:
            continue
    return start + 1


def _trailing_comment(line: str) -> str:
    found = re.search(r"\s+#[^\"']*$", line)
    return found.group(0) if found else ""


def _shown(value: Any) -> str:
    return "[" + ", ".join(map(repr, value)) + "]" if isinstance(value, list) else repr(value)


def _in_units(text: str, robot: Robot, values: Values) -> dict[str, dict[str, Any]]:
    """The tables of values in the units of a file, and in its order of the joints."""
    said = tomllib.loads(text)
    units = Units.model_validate(said["units"])
    per = {"speed": units.metres, "approach": units.metres, "angular_speed": units.radians}
    per["joint_speed"] = units.radians
    order = [robot.joint_names.index(name) for name in said["joints"]]

    def stated(key: str, value: Any) -> Any:
        return [value[k] for k in order] if isinstance(value, tuple) else value / per.get(key, 1.0)

    return {
        table: {key: stated(key, value) for key, value in kept.items() if _finite(value)}
        for table, kept in values.tables().items()
    }


def _finite(value: Any) -> bool:
    return isinstance(value, tuple) or abs(value) < float("inf")  # sidestep may be infinite: it is left as it is
