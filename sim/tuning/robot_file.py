"""Values written into the text of a `robot.toml`: comments and all other tables stay as they are."""

from __future__ import annotations

import codecs
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.robot.robot_file.schema import Units
from qpsafe.sim.experiments.shared.folder import copied_folder
from qpsafe.sim.tuning.values import Values, present
from qpsafe.text.whole_file import whole_file

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.tuning.judge import Judged
    from qpsafe.sim.tuning.result import Tuned

#: Begins the comment that names the run; one of an earlier run gives way.
MARK = "# qpsafe tune:"
#: A comment to the end of its line, or a number.
_PIECES = re.compile(r"#[^\r\n]*|[+-]?(?:inf|nan|\d[\w.+-]*)")
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


def write_choice(found: Tuned, judged: Judged | None, folder: Path) -> str:
    """Write what a search chose to a copy of the robot's folder; the present values, if nothing speaks for it.

    Args:
        found: Of the search.
        judged: The judgement, if there was one.
        folder: For the copy, `robot`.

    Returns:
        What was written, in words.
    """
    robot = load_quietly(found.search.plan.robot)
    for_it = judged is None or (not judged.new_faults and any(map(judged.better, ("harm", "lost"))))
    if found.chosen.number == 0 or not for_it:
        write_folder(robot, present(robot), f"{found.run}; nothing spoke for others", folder / "robot")
        return "robot/robot.toml with the present values, since nothing speaks for others"
    write_folder(robot, found.space.at(found.chosen.point), found.run, folder / "robot")
    return "robot/robot.toml"


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
    before = file.read_bytes()
    mark = codecs.BOM_UTF8 * before.startswith(codecs.BOM_UTF8)  # some editors begin with one
    said = before.removeprefix(mark).decode("utf-8")
    text = edited(said, _in_units(said, robot, values), f"{MARK} {run}")
    if text is None:
        expected = "tables [danger], [evasion], [recovery], [sensing] and [gate] with a line of its own for each key"
        raise ConfigurationError(file, "danger", "written in another way", expected)
    with whole_file(file) as part:
        trial = part.with_suffix(".toml")  # beside the model that it names
        trial.write_bytes(mark + text.encode())
        try:
            off = farthest(present(load_quietly(trial)), values)
            if off > 1e-9:
                raise ConfigurationError(file, "danger", f"reads {off:.1g} off what was written", "the same values")
            trial.replace(part)
        finally:
            trial.unlink(missing_ok=True)


def check_writing(robot: Robot) -> None:
    """Refuse a robot whose file cannot be edited, before anything is searched for it.

    Args:
        robot: Loaded from a folder or a model file.

    Raises:
        ConfigurationError: Its file is written in a way that cannot be edited.
    """
    with TemporaryDirectory() as place:
        try:
            write_folder(robot, present(robot), "a trial", Path(place, "robot"))
        except ConfigurationError as problem:  # of the copy: it is the robot's own file that is to be changed
            raise ConfigurationError(
                robot.folder / "robot.toml", problem.key, problem.value, problem.expected
            ) from None


def farthest(first: Values, second: Values) -> float:
    """The largest relative difference of two sets of values."""
    worst = 0.0
    for key, one in vars(first).items():
        other = getattr(second, key)
        pairs = zip(one, other, strict=True) if isinstance(one, tuple) else [(one, other)]
        worst = max(worst, *(abs(a - b) / max(abs(a), abs(b), 1e-12) if a != b else 0.0 for a, b in pairs))
    return worst


def edited(text: str, tables: Mapping[str, Mapping[str, Any]], comment: str) -> str | None:
    """The text of a TOML file in which some tables state some values; line ends and comments stay as they are.

    Args:
        text: As it was.
        tables: Table -> key -> number or list of numbers.
        comment: Goes under the header of each of these tables.

    Returns:
        None where that could not be done by lines.
    """
    lines = text.removesuffix("\n").split("\n")  # a line keeps its carriage return
    end = "\r" if lines[0].endswith("\r") else ""
    lines[-1] += end * (not lines[-1].endswith("\r"))  # the last line may have had no end
    for table, values in tables.items():
        lines = _with_table(lines, table, values, comment, end)
    found = "\n".join(lines) + "\n"
    wanted = tomllib.loads(text)
    for table, values in tables.items():
        kept = wanted.get(table, {})
        wanted[table] = (kept if isinstance(kept, dict) else {}) | dict(values)
    try:
        return found if tomllib.loads(found) == wanted else None
    except tomllib.TOMLDecodeError:
        return None


def _with_table(lines: list[str], table: str, values: Mapping[str, Any], comment: str, end: str) -> list[str]:
    """The lines with the values in a table, which is added if there is none.

    Args:
        lines: Of the file.
        table: Its name.
        values: Key -> number or list of numbers.
        comment: Under its header.
        end: Carriage return of new lines, if any.
    """
    header = re.compile(rf"\s*\[\s*([\"']?){table}\1\s*\]\s*(#.*)?$")
    start = next((k for k, line in enumerate(lines) if header.match(line)), None)
    if start is None:
        stated = [f"{key} = {_shown(value)}{end}" for key, value in values.items()]
        return [*lines, end, f"[{table}]{end}", comment + end, *stated]
    stop = next((k for k in range(start + 1, len(lines)) if _HEADER.match(lines[k])), len(lines))
    body, left, k = [comment + end], dict(values), start + 1
    while k < stop:
        key = lines[k].partition("=")[0].strip().strip("\"'")
        if key in left and "=" in lines[k]:
            after = _end_of_value(lines, k, stop)
            body += _restated(lines[k:after], left.pop(key))
            k = after
            continue
        if not lines[k].startswith(MARK):
            body.append(lines[k])
        k += 1
    last_stated = len(body)
    while last_stated > 1 and (not body[last_stated - 1].strip() or body[last_stated - 1].lstrip().startswith("#")):
        last_stated -= 1  # what stands over the next table belongs to it
    added = [f"{key} = {_shown(value)}{end}" for key, value in left.items()]
    return [*lines[: start + 1], *body[:last_stated], *added, *body[last_stated:], *lines[stop:]]


def _end_of_value(lines: list[str], start: int, end: int) -> int:
    """The line after a value that may go over several."""
    for stop in range(start + 1, end + 1):
        try:
            tomllib.loads("\n".join(lines[start:stop]) + "\n")
            return stop
        except tomllib.TOMLDecodeError:
            continue
    return start + 1


def _restated(lines: list[str], value: Any) -> list[str]:
    """The lines of a key with another value: number by number if it has as many, else with its comments above it.

    Args:
        lines: Of the key and its value, numbers only.
        value: Number or list of numbers.
    """
    key, equals, text = "\n".join(lines).partition("=")
    wanted, listed = (value, True) if isinstance(value, list) else ([value], False)
    there = [found for found in _PIECES.finditer(text) if not found.group().startswith("#")]
    if listed is text.lstrip().startswith("[") and len(there) == len(wanted):
        for found, number in zip(reversed(there), reversed(wanted), strict=True):
            text = text[: found.start()] + repr(number) + text[found.end() :]
        return (key + equals + text).split("\n")
    *above, last = [re.search(r"#.*|\r?$", line[len(key) * (k == 0) :]) for k, line in enumerate(lines)]
    said = [found.group() for found in above if found is not None and found.group().startswith("#")]
    rest = "" if last is None else last.group()
    return [*said, f"{key.rstrip()} = {_shown(value)}{'  ' * rest.startswith('#')}{rest}"]


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
