"""Everything that defines a run of the third experiment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from qpsafe.laws.problem import Law
from qpsafe.sim.experiments.pick_place.cell import Cell
from qpsafe.sim.experiments.pick_place.for_robot import Work, work_for
from qpsafe.sim.experiments.pick_place.people import load_people
from qpsafe.sim.experiments.shared.control import Control
from qpsafe.sim.experiments.shared.programmed import Programmed
from qpsafe.sim.stories.actor import Actor
from qpsafe.sim.world.scene import Scene, build_scene

if TYPE_CHECKING:
    from qpsafe.recovery.recovery import RecoveryRules
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.rules import SensingRules
    from qpsafe.sim.stories.story import Story

#: The bundled people.
PEOPLE = Path(__file__).with_name("people.toml")
SETTLE = 1.0  # a run goes on for this long after its last release, so that the last screw comes to rest [s]


@dataclass
class PickPlaceSettings(Programmed, Control):
    """Everything that defines one run; equal settings give bit-identical logs (wall times aside). Tasks, thresholds,
    evasion and metrics of one's own are those of `Control`.

    Attributes:
        robot: The robot, with spots.
        law: The law, None for the controller's default.
        seed: Varies when, how fast and where people go, and where they reach; 0 is nominal.
        cycles: Screws to carry.
        people_file: TOML file of the people, None for nobody.
        brought: How many screws each person of the file brings along.
        lag: Control lag of the plant [s].
        limit: The run is given up after this time [s].
        sensor: ``ideal`` distances, or those of ``sharp`` sensors.
        rules: What counts as danger; None for the controller's default.
        recovery: How the robot returns to its path; None for the controller's default.
        program: TOML file of what the tool does, with the events ``grip`` and ``release``; by default the IRB 140's, or
            one that suits the robot.
    """

    robot: Robot
    law: Law | None = None
    seed: int = 0
    cycles: int = 10
    people_file: Path | None = PEOPLE
    brought: tuple[int, ...] = (0, 3)
    lag: float = 0.0
    limit: float = 300.0
    sensor: str = "ideal"
    rules: SensingRules | None = None
    recovery: RecoveryRules | None = None
    program: Path | None = None

    @property
    def duration(self) -> float:
        """About how long a run takes, for progress bars [s]."""
        delayed = 1.1 if self.story is None else 1.5
        return delayed * self.cycles * self.reference.duration / len(self.cell.holes) + SETTLE

    @cached_property
    def story(self) -> Story | None:
        """The people's story as this seed varies it."""
        if self.people_file is None:
            return None
        cell = self.work.cell if self.people_file == PEOPLE else None  # the bundled people go where the cell is
        return load_people(self.people_file, self.seed, -self.work.pedestal, cell)

    @property
    def people(self) -> tuple[Actor, ...]:
        """Who is there."""
        return () if self.story is None else self.story.people

    @property
    def carried(self) -> tuple[int, ...]:
        """Screws that each person brings."""
        return tuple((*self.brought, *([0] * len(self.people)))[: len(self.people)])

    @cached_property
    def cell(self) -> Cell:
        """The cell, with as many screws as there are."""
        return replace(self.work.cell, carried=sum(self.carried))

    @property
    def work(self) -> Work:
        """Where things stand for this robot, and what it does there."""
        return work_for(self.robot)

    def own_program(self) -> str:
        """The bundled work, or another robot's own."""
        return self.work.program

    @cached_property
    def scene(self) -> Scene:
        """The world, built on first use."""
        people = () if self.story is None else self.story.persons
        return build_scene(self.robot, pedestal=self.work.pedestal, people=people, furnish=self.cell.furnish)
