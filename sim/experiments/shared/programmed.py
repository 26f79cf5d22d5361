"""What experiments have in common whose tool follows a program from a file."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.program import Program
from qpsafe.tasks.program_file import load_program, parse_program
from qpsafe.tasks.reach import joints_for

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


class Programmed:
    """Gives an experiment with a `robot` and a `program` what follows from them."""

    robot: Robot
    program: Path | None

    def own_program(self) -> str:
        """The text of the program that the robot has where no file is given."""
        raise NotImplementedError

    @property
    def program_name(self) -> str:
        """Of its file, for people."""
        return f"the line or work chosen for {self.robot.name}" if self.program is None else self.program.name

    @cached_property
    def program_text(self) -> str:
        """What the program's file says."""
        return self.own_program() if self.program is None else self.program.read_text(encoding="utf-8")

    @cached_property
    def reference(self) -> Program:
        """The tool's program."""
        if self.program is not None:
            return load_program(self.program, self.robot)
        return parse_program(self.program_text, self.program_name, self.robot)

    @property
    def start(self) -> NDArray[np.float64]:
        """Joint positions at which the tool is where the program starts (n,) [rad]."""
        return joints_for(self.robot, self.reference.frame, self.reference.sample(0.0).pose, self.robot.home)
