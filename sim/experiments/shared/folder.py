"""A robot's folder in another place: its own files are copied, its model stays where the meshes are that it names."""

from __future__ import annotations

import re
import shutil
import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import bundled_robots, find_robot
from qpsafe.sim.experiments.shared.by_hand import marked, write_whole
from qpsafe.text.json_text import json_text
from qpsafe.text.lines import toml_lines

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

#: Of distance sensors in a robot's folder, of whatever kind.
SENSORS = "spots*.toml"


def copied_folder(robot: Robot, folder: Path, spots: str | None = None) -> Path:
    """Write the files that describe a robot once more: `robot.toml`, the files of its sensors, its regions' meshes.

    The folder of a robot of one's own may be where the model lies, as `qpsafe robots add` has it by default: in a
    package of meshes, in a home folder, around the very place where the copy goes. So nothing else is copied, and the
    model is named by its whole path: `../meshes` and `package://` in it stay right. The folder of a bundled robot has
    nothing else, and is copied as it is.

    Args:
        robot: Loaded from a folder.
        folder: The copy's; files there that it writes, and all of sensors, are replaced.
        spots: Text of a file of distance sensors for a robot that has none; `robot.toml` is marked then, see `by_hand`.

    Returns:
        The folder.

    Raises:
        ConfigurationError: Its `robot.toml` names its model in a way that cannot be edited, or its files lie there.
    """
    check_place(robot, folder)
    if robot.folder.resolve() in [path.parent.resolve() for path in map(find_robot, bundled_robots())]:
        _clear(folder)
        shutil.copytree(robot.folder, folder, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
        return folder
    text = (robot.folder / "robot.toml").read_text(encoding="utf-8-sig")
    sensors = {path.name: path for path in robot.folder.glob(SENSORS)}
    stated = {"model": str(robot.model_path.resolve())}
    if robot.spots_path is not None:
        sensors[robot.spots_path.name] = robot.spots_path
    if robot.spots_path is not None or spots is not None:
        stated["spots"] = "spots.toml" if robot.spots_path is None else robot.spots_path.name
    changed = with_keys(text, stated)
    if changed is None:
        expected = "a line of its own for model, and for spots"
        raise ConfigurationError(robot.folder / "robot.toml", "model", "written in another way", expected)
    for region in tomllib.loads(text).get("regions", ()):
        mesh = Path(region.get("mesh", "/"))
        if not mesh.is_absolute() and ".." not in mesh.parts and (robot.folder / mesh).is_file():
            sensors[str(mesh)] = robot.folder / mesh
    kept = {name: path.read_bytes() for name, path in sensors.items()}
    if spots is not None:
        kept["spots.toml"] = spots.encode()
    kept["robot.toml"] = changed.encode() if spots is None else marked(changed).encode()
    for name, content in kept.items():
        write_whole(folder / name, content)
    _clear(folder, kept)
    return folder


def check_place(robot: Robot, folder: Path) -> None:
    """Refuse to write a copy over the robot itself.

    Args:
        robot: Loaded from a folder.
        folder: Where its copy is to be.

    Raises:
        ConfigurationError: The robot's own files, or its model, lie there.
    """
    place = folder.resolve()
    if place == robot.folder.resolve() or place in robot.model_path.resolve().parents:
        expected = f"another folder for the results: the files of {robot.name} lie there"
        raise ConfigurationError("a robot's copy", "folder", str(folder), expected)


def _clear(folder: Path, kept: Collection[str] = ()) -> None:
    """Take away files of an earlier robot that would be taken for this one's.

    Args:
        folder: The copy's.
        kept: Names of those that are this one's.
    """
    for path in (*folder.glob(SENSORS), folder / "robot.toml"):
        if path.name not in kept:
            path.unlink(missing_ok=True)


def with_keys(text: str, stated: dict[str, str]) -> str | None:
    """The text of a TOML file in which some keys above all tables have other words; all else as it was.

    Args:
        text: As it was.
        stated: Key -> word.

    Returns:
        None where that could not be done by lines.
    """
    lines = toml_lines(text)
    for key, value in stated.items():
        top = next((k for k, line in enumerate(lines) if line.lstrip().startswith("[")), len(lines))
        line = f"{key} = {json_text(value, indent=None)}"
        at = next((k for k in range(top) if re.match(rf"\s*{key}\s*=", lines[k])), None)
        if at is None:
            lines.insert(next((k + 1 for k in range(top) if re.match(r"\s*model\s*=", lines[k])), 0), line)
        else:
            lines[at] = line
    found = "\n".join(lines) + "\n"
    try:
        return found if tomllib.loads(found) == tomllib.loads(text) | stated else None
    except tomllib.TOMLDecodeError:
        return None
