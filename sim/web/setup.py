"""What a person chooses on the page, from the robot to the parameters, and what is built of it."""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.errors import ConfigurationError
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.laws.by_name import law_named
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.cell_file import load_cell
from qpsafe.sim.campaign.people.model import EncounterModel
from qpsafe.sim.campaign.trials.station import LINE, Station
from qpsafe.sim.experiments.fast_person import at_speed
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.stage import robot_stage
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.stories.file import load_story
from qpsafe.sim.stories.steps import BoardTable, PersonTable, StoryTable
from qpsafe.sim.stories.story import Story

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController
    from qpsafe.robot.robot import Robot

HOLD, MOVE = "hold a pose", "move on a line"
NOBODY, STRAIGHT, RANDOM = "nobody", "straight at the robot", "random encounter"
DT = 0.004  # of a tick [s]
LONGEST = 600.0  # of a recording [s]
#: What is exchanged while the robot moves; anything else makes the run begin anew.
LIVE = ("law", "projection", "gate", "cap", "thresholds", "mass", "damping")


@dataclass(frozen=True)
class Setup:
    """What is simulated. Whatever a browser may send is checked where it is used, and refused in words.

    Attributes:
        robot: As for `load_robot`.
        task: `HOLD`, `MOVE`, or the path of a program's file.
        story: `NOBODY`, `STRAIGHT`, `RANDOM`, or the path of a story's file: who comes besides the one who is dragged.
        cell: Path of a cell's file, whose furniture stands there besides the pedestal; "" for none.
        seed: Of the people at random.
        board: Whether the person who is dragged carries a card board.
        sight: ``ideal``, ``sharp`` or ``perfect``; a robot without sensors has perfect sight.
        lag: Of the servo [s].
        law: One of `LAWS`.
        projection: Of the hierarchical law.
        gate: Whether commands are verified in the last step.
        cap: Of the danger field, None for none.
        thresholds: Δ, ε and Δ_f, ε_f; None for the robot's own.
        mass: M in units of the robot's own.
        damping: D likewise.
    """

    robot: str = "irb140"
    task: str = HOLD
    story: str = NOBODY
    cell: str = ""
    seed: int = 0
    board: bool = False
    sight: str = "ideal"
    lag: float = 0.0
    law: str = "hierarchical"
    projection: str = "strict"
    gate: bool = True
    cap: float | None = None
    thresholds: tuple[float, float, float, float] | None = None
    mass: float = 1.0
    damping: float = 1.0

    def same_run(self, other: Setup) -> bool:
        """Whether a run can go on when one setup replaces the other."""
        kept = [field.name for field in fields(self) if field.name not in LIVE]
        return all(getattr(self, name) == getattr(other, name) for name in kept)

    @property
    def scenery(self) -> tuple[str, str, str, int, bool]:
        """The fields that decide how the scene looks."""
        return self.robot, self.story, self.cell, self.seed, self.board

    def experiment(self) -> FixedExperiment:
        """The experiment; its story's first person is the one who is dragged.

        Raises:
            ConfigurationError: Names what does not fit.
        """
        if not 0.0 <= self.lag <= 0.1:
            raise ConfigurationError("qpsafe web", "lag", self.lag, "0 to 0.1 s")
        robot = load_robot(self.robot)
        given: dict[str, Any] = {
            "sensor": "perfect" if robot.spots_path is None else self.sight,
            "story": self._story(robot),
            "cell": load_cell(self.cell) if self.cell else (),
            "lag": self.lag,
            "duration": LONGEST,
            "law": law_named(self.law, self.projection),
            "cap": self.cap,
            "gate": None if self.gate else "off",
            "activation": self.activation(robot),
            "evasion": self.evasion(robot),
        }
        if self.task == HOLD:
            return FixedExperiment(robot, **given)
        return PathExperiment(robot, program=LINE if self.task == MOVE else Path(self.task), **given)

    def apply(self, controller: SafetyController, experiment: FixedExperiment) -> None:
        """Change what may change while a controller runs; it counts from the next tick on.

        Args:
            controller: The controller; nothing has changed where a part is refused.
            experiment: Of it; remembers the same parts.

        Raises:
            ConfigurationError: Names what does not fit.
        """
        robot = controller.robot
        law, cap = law_named(self.law, self.projection), self.cap
        barrier = None if cap is None else DangerBarrier(cap)
        activation = self.activation(robot) or _usual_activation(robot)
        evasion = copy.deepcopy(self.evasion(robot)) or Evasion.for_robot(robot, DT)
        evasion.velocity = controller.evasion.velocity
        controller.activation, controller.evasion, controller.law = activation, evasion, law
        controller.barrier, controller.gate = barrier, None if self.gate else "off"
        experiment.law, experiment.cap, experiment.gate = law, cap, None if self.gate else "off"
        experiment.activation, experiment.evasion = activation, self.evasion(robot)

    def activation(self, robot: Robot) -> Activation | None:
        """The thresholds of all tools' tasks; None for the robot's own.

        Raises:
            ConfigurationError: They overlap.
        """
        if self.thresholds is None:
            return None
        delta, epsilon, lower, lower_epsilon = self.thresholds
        count = len(robot.tool_frames)
        keep, release = Threshold(delta, epsilon), Threshold(lower, lower_epsilon)
        return Activation((keep,) * count + (release,) * count)

    def evasion(self, robot: Robot) -> Evasion | None:
        """The admittance; None for the robot's own."""
        if self.mass == self.damping == 1.0:
            return None
        own = _evasion(robot)
        return Evasion(self.mass * own.mass, self.damping * own.damping, robot.nq, DT, own.friction)

    def _story(self, robot: Robot) -> Story:
        floor = -robot_stage(robot).pedestal
        table = self._others(robot, floor)
        board = BoardTable() if self.board else None
        you = PersonTable(name="you", start=(1.6, 0.5), heading=180.0, board=board)
        others = () if table is None else table.person
        duration = LONGEST if table is None else table.duration
        return Story(StoryTable(title=self.story, duration=duration, person=[you, *others]), floor=floor)

    def _others(self, robot: Robot, floor: float) -> StoryTable | None:
        if self.story == NOBODY:
            return None
        if self.story == STRAIGHT:
            return at_speed(2.0).table
        if self.story == RANDOM:
            model = EncounterModel.load()
            plan = Station("hold", robot, furniture=self.cell or None).floor_plan
            return model.encounter(model.random(self.seed), plan).table
        return load_story(self.story, floor=floor).table


def own_thresholds(robot: Robot) -> tuple[float, float, float, float]:
    """Δ, ε and Δ_f, ε_f of a robot."""
    keep, release = robot_thresholds(robot)
    return keep.delta, keep.epsilon, release.delta, release.epsilon


def _usual_activation(robot: Robot) -> Activation:
    found = Setup(thresholds=own_thresholds(robot)).activation(robot)
    assert found is not None
    return found


@lru_cache(maxsize=4)
def _evasion(robot: Robot) -> Evasion:
    return Evasion.for_robot(robot, DT)
