"""`--robot` of the demos: any robot, made ready, with what was chosen for it said in one short list."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import TYPE_CHECKING

from qpsafe.cli.common import say

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
