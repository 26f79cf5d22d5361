"""The source's first experiment: a fixed tool reference while a person with a card board comes from three sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.laws.problem import Law
from qpsafe.sim.people.choreography import Choreography
from qpsafe.sim.world.distance import board_distance, person_distance
from qpsafe.sim.recording.log import Recorder, RunLog
from qpsafe.sim.experiments.fixed.loop import FixedLoop
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.experiments.fixed.stage import robot_stage
from qpsafe.sim.world.scene import Scene, build_scene
from qpsafe.tasks.rotation import euler_zyx, log3
from qpsafe.tasks.trajectory import FixedPose, Trajectory
from qpsafe.tick import Tick

if TYPE_CHECKING:
    from qpsafe.recovery.recovery import RecoveryRules
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.rules import SensingRules
    from qpsafe.sim.stories.story import Story

Observer = Callable[[Tick, Scene, Plant], None]


@dataclass
class FixedExperiment:
    """Everything that defines one run; equal settings give bit-identical logs (wall times aside).

    Attributes:
        robot: The robot, with spots.
        law: The law, None for the controller's default.
        seed: Varies the person's distances, directions and times a little; 0 is nominal.
        lag: Control lag of the plant [s].
        limits: Whether the joint limits are on.
        duration: Length [s].
        sensor: ``ideal`` distances, or those of ``sharp`` sensors.
        rules: What counts as danger, and what sick sensors do; None for the controller's default.
        cap: Cap on the danger field (`DangerBarrier`), None for none.
        choreography: How the person moves; `seed` varies it. By default as the robot's stage says (`sim.robot_stage`).
        recovery: How the robot returns to its path; None for the controller's default.
        story: Who does what instead of the choreography; `seed` varies it too.
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

    def __post_init__(self) -> None:
        if self.robot.spots_path is None:
            raise RobotFileError(self.robot.name, "spots", None, "distance sensors: the experiment needs a spots.toml")
        if self.choreography is None:
            self.choreography = robot_stage(self.robot).choreography

    @cached_property
    def scene(self) -> Scene:
        """The world, built on first use."""
        floor = self.choreography.person.floor if self.story is None else self.story.floor
        return build_scene(self.robot, pedestal=-floor, people=self.walk.persons)

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

    def run(self, observer: Observer | None = None) -> RunLog:
        """Run it with the controller.

        Args:
            observer: Called after every tick, e.g. to draw it or to show progress.

        Raises:
            SimulationFailedError: MuJoCo reported bad values.
        """
        robot, scene, loop = self.robot, self.scene, FixedLoop(self)
        controller, plant = loop.controller, loop.plant
        assert controller.spots is not None
        recorder = Recorder(controller.dt, controller.spots.names)
        for _ in range(round(self.duration / controller.dt)):
            tick, q, qd, distances, state = loop.step()
            goals = {name: target.sample(tick.path_time).pose for name, target in self.references.items()}
            commanded = robot.at(tick.reference.q)
            measured = [pose_error(state.pose(name), goal) for name, goal in goals.items()]
            recorder.add(
                tick,
                q,
                qd,
                distances,
                (np.concatenate([error[0] for error in measured]), np.concatenate([error[1] for error in measured])),
                np.concatenate([euler_error(commanded.pose(name), goal) for name, goal in goals.items()]),
                (board_distance(scene, plant.data).distance, person_distance(scene, plant.data).distance),
            )
            if observer is not None:
                observer(tick, scene, plant)
            loop.advance()
        return recorder.finish()

    def board_distance_without_controller(self) -> NDArray[np.float64]:
        """Smallest distance robot-board at every tick if the robot just keeps its pose (N,) [m]."""
        scene, walk, dt = self.scene, self.walk, 0.004
        data = scene.make_data()
        result = np.empty(round(self.duration / dt))
        for k in range(len(result)):
            scene.place_people(data, walk.poses(k * dt))
            result[k] = board_distance(scene, data).distance
        return result

    def windows(self) -> tuple[tuple[float, float], ...]:
        """Start and end of each approach that fits into the duration [s]."""
        return tuple(window for window in self.walk.windows if window[1] <= self.duration)


def pose_error(pose: NDArray[np.float64], target: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Position error (3,) [m] and rotation vector (3,) [rad] from `pose` to `target`."""
    return target[:3, 3] - pose[:3, 3], log3(target[:3, :3] @ pose[:3, :3].T)


def euler_error(pose: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """The source's orientation error: differences of the Euler angles φ, θ, ψ, wrapped to (-pi, pi] (3,) [rad]."""
    difference = euler_zyx(target[:3, :3]) - euler_zyx(pose[:3, :3])
    return np.pi - np.mod(np.pi - difference, 2.0 * np.pi)
