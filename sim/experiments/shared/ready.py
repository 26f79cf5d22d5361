"""Any robot made ready for an experiment: a home posture and distance sensors where its files have none.

What is chosen is written as a robot folder, `robot.toml` and `spots.toml`, so that it can be read, corrected, replayed
and used for the next run: the experiment runs on that folder, as it would on one written by hand.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import bundled_robots, find_robot, load_quietly
from qpsafe.robot.robot_file.defaults import HOMELESS
from qpsafe.robot.robot_file.starting_file import starting_robot_toml
from qpsafe.sim.experiments.shared.by_hand import by_hand, write_marked
from qpsafe.sim.experiments.shared.folder import copied_folder
from qpsafe.sim.experiments.shared.home import Arm, chosen_home
from qpsafe.sim.experiments.shared.skin import skin_toml
from qpsafe.sim.experiments.shared.strength import bearable
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

MOST = 3.0  # longest arm that the experiments' people can walk around [m]


class Ready(NamedTuple):
    """A robot that an experiment can run on.

    Attributes:
        robot: The robot.
        said: What was chosen for it, in words; nothing for one that has all it needs.
    """

    robot: Robot
    said: tuple[str, ...] = ()


def made_ready(
    where: str, name: str, out: Path, joints: int = 4, in_the_way: Callable[[Robot], Collection[str]] | None = None
) -> Ready:
    """Load a robot and give it what it lacks; nothing is written for one that lacks nothing.

    Args:
        where: The command, for errors.
        name: A bundled name, a robot folder, an MJCF or URDF file, or a model of another package.
        out: Where a folder `robot` is made, if need be.
        joints: How many must carry the tool, at least.
        in_the_way: Names those of chosen sensors that the robot's work does not go with; they are taken off again.

    Raises:
        ConfigurationError: The robot cannot do what the command shows; says why, before anything is written.
        RobotFileError: The robot's files are wrong.
    """
    robot, folder = load_quietly(name), out / "robot"
    check_arm(where, robot, joints)
    bare = find_robot(name).suffix != ".toml"
    if name in bundled_robots():
        return Ready(robot)
    if not bare and robot.spots_path is not None:
        return Ready(robot, robot.notes)
    if by_hand(folder / "robot.toml"):
        return _corrected(where, robot, folder)
    file, said = folder / "spots.toml", list(robot.notes)
    theirs = file.read_text(encoding="utf-8") if by_hand(file) else None
    if bare:
        found = choices(robot)
        text, count, said = found.spots_toml, found.sensors, found.said
    else:
        text, count = skin_toml(robot)
        said.append(f"{count} distance sensors put on its links")
    if not count:
        raise ConfigurationError(where, "--robot", robot.name, "links long enough to carry a distance sensor")
    if bare:
        write_marked(folder / "robot.toml", found.robot_toml(folder))
    else:
        copied_folder(robot, folder, text if theirs is None else theirs)
    if theirs is not None:
        made, off = load_quietly(folder), frozenset[str]()
        said.append(f"{file} was changed by hand and is kept: its sensors are taken")
    else:
        write_marked(file, text)
        made = load_quietly(folder)
        off = frozenset() if in_the_way is None else frozenset(in_the_way(made))
    text = without(text, off)
    if off and "[[spot]]" in text:
        write_marked(file, text)
        made = load_quietly(folder)
        said.append(f"{counted(len(off), 'sensor')} taken off again: what stands in its cell would count as danger")
    said.append(f"written to {folder}: correct it, and give it as --robot")
    return Ready(made, tuple(said))  # the robot that was looked at, so that nothing is looked for twice


def _corrected(where: str, robot: Robot, folder: Path) -> Ready:
    """The robot of a folder that was written here and then corrected: nothing there is written over.

    Args:
        where: The command, for errors.
        robot: Whose model it should be.
        folder: Of the corrected files.

    Raises:
        ConfigurationError: It is of another model.
        RobotFileError: What is there is wrong.
    """
    kept = load_quietly(folder)
    if kept.model_path.resolve() != robot.model_path.resolve():
        expected = f"another folder, or that one taken away: its robot.toml, of {kept.name}, was changed by hand"
        raise ConfigurationError(where, "--out", str(folder), expected)
    said = f"{folder / 'robot.toml'} was changed by hand: that folder is taken as it is; without it all is chosen anew"
    return Ready(kept, (*kept.notes, said))


def without(spots_toml: str, names: Collection[str]) -> str:
    """The text of a file of sensors that was written here, without some of them.

    Args:
        spots_toml: The text.
        names: Of those that are left out.
    """
    head, *tables = spots_toml.split("\n[[spot]]\n")
    kept = [table for table in tables if tomllib.loads(table)["name"] not in names]
    return "\n[[spot]]\n".join((head, *kept))


class Choices(NamedTuple):
    """What is chosen for a robot of which there is only a model file.

    Attributes:
        robot: With the home posture and the accelerations that were chosen.
        spots_toml: Text of the file of its distance sensors.
        sensors: How many these are.
        said: What was assumed and chosen, in words.
    """

    robot: Robot
    spots_toml: str
    sensors: int
    said: list[str]

    def robot_toml(self, folder: Path, spots: str | None = "spots.toml") -> str:
        """Text of its `robot.toml`.

        Args:
            folder: Where it will stand.
            spots: File of its sensors beside it, None for none.
        """
        return starting_robot_toml(self.robot, folder, spots=spots, assumed=self.said)


def choices(robot: Robot, sensors: bool = True) -> Choices:
    """Choose a home posture, if the file states none, accelerations that its torques bear, and distance sensors.

    Args:
        robot: Loaded from the model file alone.
        sensors: Whether it needs any.
    """
    said, home = list(robot.notes), robot.home
    if any(note.startswith(HOMELESS) for note in said):  # an MJCF may have a keyframe
        home, missed = chosen_home(robot)
        said = [note for note in said if not note.startswith(HOMELESS)]
        said.append(f"home posture chosen: {', '.join(f'{q:.2f}' for q in home)} rad")
        said += [f"of the home posture, not as it should be: {item}" for item in missed]
    share, words = bearable(robot)
    made = load_quietly(robot.model_path, home=home, max_acceleration=share * robot.max_acceleration)
    text, count = "", 0
    if sensors:
        with TemporaryDirectory() as place:  # they are chosen by a simulation, which reads the robot's file
            Path(place, "robot.toml").write_text(starting_robot_toml(made, Path(place)), encoding="utf-8")
            text, count = skin_toml(load_quietly(place))
    said += [*words, *([f"{count} distance sensors put on its links"] if sensors else [])]
    return Choices(made, text, count, said)


def check_arm(where: str, robot: Robot, joints: int) -> None:
    """Whether the robot's (first) tool is carried by joints enough, and is of a size that people can stand around.

    Args:
        where: The command, for errors.
        robot: The robot.
        joints: How many, at least.

    Raises:
        ConfigurationError: It is not; names what is wanted.
    """
    arm = Arm.of(robot)
    if len(arm.joints) < joints:
        found = f"{robot.name}, {arm.tool} on {counted(len(arm.joints), 'joint')}"
        wanted = f"an arm with {counted(joints, 'joint')} or more between base and tool"
        raise ConfigurationError(where, "--robot", found, wanted)
    if not (np.isfinite(arm.length) and 0.15 < arm.length <= MOST):
        found = f"{robot.name}, an arm of {arm.length:.2f} m"
        raise ConfigurationError(
            where, "--robot", found, f"an arm of 0.15 to {MOST:g} m from its second joint to its tool"
        )
