"""`--robot`: any robot, made ready, with what was chosen for it said in one short list."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import TYPE_CHECKING

from qpsafe.cli.common import say
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.robot.robot import Robot


def own_folder(name: str) -> Path:
    """Where a folder is made for a robot by commands that write nothing else: one for each model, whatever its name.

    Many call their file `model.urdf`, and what one command has made another may be playing.

    Args:
        name: What was typed.
    """
    path = Path(name).resolve() if Path(name).exists() else Path(name)
    mark = hashlib.sha256(str(path).encode()).hexdigest()[:6]
    word = re.sub(r"[^\w.-]+", "-", path.stem)
    return Path("out/robots") / f"{word}-{mark}"


def any_robot(where: str, name: str, out: Path, screen: Console, joints: int = 6, picks: bool = False) -> Robot:
    """The robot that is meant, with a home posture and sensors.

    Args:
        where: The command, for errors.
        name: What was typed.
        out: Folder of the results; what is chosen for a robot is written there.
        screen: Where it is said.
        joints: How many must carry the tool, at least.
        picks: Whether it is to pick and place, with no chosen sensor that would take the cell for danger.

    Raises:
        ConfigurationError: The robot cannot do what the command shows.
    """
    from qpsafe.sim.experiments.pick_place.for_robot import in_the_way
    from qpsafe.sim.experiments.shared.ready import made_ready

    ready = made_ready(where, name, out, joints, in_the_way if picks else None)
    say(screen, f"{ready.robot.name}:", ready.said)
    return ready.robot


def ready_name(where: str, name: str, screen: Console, joints: int = 1, sensors: bool = False) -> str:
    """The name of a robot that is described: a bare model gets what it lacks in `own_folder`, as in the demos.

    Args:
        where: The command, for errors.
        name: What was typed.
        screen: Where it is said what was chosen.
        joints: How many must carry the tool of one that something is chosen for, at least.
        sensors: Whether a folder without sensors is not enough: a copy gets some.

    Raises:
        ConfigurationError: Nothing can be chosen for it.
    """
    from qpsafe.robot.loader import find_robot, load_quietly

    if find_robot(name).suffix == ".toml" and not (sensors and load_quietly(name).spots_path is None):
        return name
    any_robot(where, name, own_folder(name), screen, joints)
    return str(own_folder(name) / "robot")


def check_stated(where: str, name: str, sensors: bool) -> None:
    """Refuse a robot of which something would have to be chosen: no real one may drive to what was guessed.

    Args:
        where: The command, for errors.
        name: What was typed.
        sensors: Whether they are in use.

    Raises:
        ConfigurationError: Its files state no home pose, or no sensors while they are in use.
    """
    from qpsafe.robot.loader import load_quietly
    from qpsafe.robot.robot_file.defaults import HOMELESS

    robot = load_quietly(name)
    if any(note.startswith(HOMELESS) for note in robot.notes):
        expected = "a robot whose home pose is stated: `qpsafe robots add` first, and look at what it writes"
        raise ConfigurationError(where, "--robot", name, expected)
    if sensors and robot.spots_path is None:
        expected = "a robot with sensors, as in a spots.toml, or --no-sensors: it would see nobody"
        raise ConfigurationError(where, "--robot", name, expected)
