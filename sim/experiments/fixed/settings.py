"""Everything that defines a run of the first experiment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.laws.problem import Law
from qpsafe.recovery.returns import RecoveryRules
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sim.experiments.fixed.stage import robot_stage
from qpsafe.sim.experiments.shared.control import Control
from qpsafe.sim.people.choreography import Choreography
from qpsafe.sim.ranging.sets import range_sensors, sensor_kinds
from qpsafe.sim.world.furniture import add_obstacles
from qpsafe.sim.world.scene import Scene, build_scene
from qpsafe.tasks.trajectory import FixedPose, Trajectory

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.stories.story import Story


@dataclass
class FixedSettings(Control):
    """Everything that defines one run; equal settings give bit-identical logs (wall times aside). Tasks, thresholds,
    evasion and metrics of one's own are those of `Control`.

    With the choreography, which shows Table I, thresholds, evasion, sensing and recovery are the paper's unless they
    are given, whatever the robot's file states: people count as standing still, so that levels of danger are passed one
    by one. With a story they are the controller's default; `parameters` says otherwise for either.

    Attributes:
        robot: The robot, with spots.
        law: The law, None for the controller's default.
        seed: Varies the person's distances, directions and times a little; 0 is nominal.
        lag: Control lag of the plant [s].
        limits: Whether the joint limits are on.
        duration: Length [s].
        sensor: ``ideal`` distances, those of ``sharp`` sensors, or ``perfect``: where everybody is nearest to each
            link, as points; that needs no sensors. Or ``vl53l5cx`` arrays in the spots' place, or a ``depth`` camera;
            joined by +, as in ``sharp+depth``, they are there together. See `qpsafe.sim.ranging.sets`.
        rules: What counts as danger, and what sick sensors do; None for the default, see above.
        cap: Cap on the danger field (`DangerBarrier`), None for none.
        choreography: How the person moves; `seed` varies it. By default as the robot's stage says (`sim.robot_stage`).
        recovery: How the robot returns to its path; None for the default, see above.
        story: Who does what instead of the choreography; `seed` varies it too.
        cell: Furniture besides the pedestal: it stands in the scene, and the controller knows it.
        parameters: "paper", or "robot" for what the robot's file states, as after tuning; None for the default, see
            above.
    """

    robot: Robot
    law: Law | None = None
    seed: int = 0
    lag: float = 0.0
    limits: bool = True
    duration: float = 60.0
    sensor: str = "ideal"
    rules: SensingRules | None = None
    cap: float | None = None
    choreography: Choreography = None  # type: ignore[assignment]  # set below: it depends on the robot
    recovery: RecoveryRules | None = None
    story: Story | None = None
    cell: tuple[Obstacle, ...] = ()
    parameters: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        own = "paper" if self._as_in_paper else self.parameters
        if own is not None:
            self.robot = self.robot.with_parameters(own)
        if self.robot.spots_path is None and sensor_kinds(self.sensor).spots in ("ideal", "sharp"):
            raise RobotFileError(self.robot.name, "spots", None, "distance sensors: the experiment needs a spots.toml")
        if self.choreography is None:
            self.choreography = robot_stage(self.robot).choreography

    @property
    def _as_in_paper(self) -> bool:
        return self.parameters == "paper" or (self.parameters is None and self.story is None)

    def parts(self) -> dict[str, Any]:
        """Parts of the controller as arguments of `SafetyController`; None for its default."""
        found = super().parts() | {"sensing": self.rules, "recovery": self.recovery}
        kinds = sensor_kinds(self.sensor)
        if kinds.ranging:
            found["range_sensors"] = range_sensors(kinds.ranging, self.robot)[0]
            if kinds.spots is None:
                found["spots"] = "off"
        if self._as_in_paper:
            paper = {"evasion": "paper", "sensing": SensingRules(velocities=False), "recovery": RecoveryRules.paper()}
            found |= {name: part for name, part in paper.items() if found[name] is None}
        return found

    @cached_property
    def scene(self) -> Scene:
        """The world, built on first use."""
        floor = self.choreography.person.floor if self.story is None else self.story.floor
        furnish = partial(add_obstacles, obstacles=self.cell)
        return build_scene(self.robot, pedestal=-floor, people=self.walk.persons, furnish=furnish)

    @cached_property
    def walk(self) -> Choreography | Story:
        """The choreography, or the story, as this seed varies it."""
        return (self.story or self.choreography).varied(self.seed)

    @cached_property
    def reference(self) -> Trajectory:
        """What the first tool is to follow: in this experiment, to stay where it is."""
        return FixedPose(self.robot.pose(self.robot.tool_frames[0], self.robot.home))

    @cached_property
    def references(self) -> dict[str, Trajectory]:
        """What every tool is to follow: the others stay where they are."""
        first, *others = self.robot.tool_frames
        return {first: self.reference} | {name: FixedPose(self.robot.pose(name, self.robot.home)) for name in others}

    @property
    def start(self) -> NDArray[np.float64]:
        """Joint positions at the beginning (n,) [rad]."""
        return self.robot.home

    def windows(self) -> tuple[tuple[float, float], ...]:
        """Start and end of each approach that fits into the duration [s]."""
        return tuple(window for window in self.walk.windows if window[1] <= self.duration)
