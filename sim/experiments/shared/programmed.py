"""What experiments have in common whose tool follows a program from a file."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.program import Program
from qpsafe.tasks.program_file import load_program
from qpsafe.tasks.reach import joints_for

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


class Programmed:
    """Gives an experiment with a `robot` and a `program` what follows from them."""

    robot: Robot
    program: Path

    @cached_property
    def program_text(self) -> str:
        """What the program's file says."""
        return self.program.read_text(encoding="utf-8")

    @cached_property
    def reference(self) -> Program:
        """The tool's program."""
        return load_program(self.program, self.robot)

    @property
    def start(self) -> NDArray[np.float64]:
        """Joint positions at which the tool is where the program starts (n,) [rad]."""
        return joints_for(self.robot, "tcp", self.reference.sample(0.0).pose, self.robot.home)
