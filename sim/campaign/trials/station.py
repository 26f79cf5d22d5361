"""Where a trial takes place and what the robot does there: hold a pose, a line, pick-and-place, or a user's program."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.controller import SafetyController
from qpsafe.danger.separation import Separation
from qpsafe.danger.thresholds import robot_activation
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.sensing.cell_file import load_cell
from qpsafe.sensing.skin.spots import SpotArray, load_spots
from qpsafe.sim.campaign.digests import State, robot_state, state_of
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
from qpsafe.sim.campaign.trials.servo import OMEGA, stopped, wire_speeds
from qpsafe.sim.engine.distances import Distances
from qpsafe.sim.engine.world import World
from qpsafe.sim.experiments.fixed.stage import robot_stage
from qpsafe.sim.experiments.path.for_robot import line_for
from qpsafe.sim.experiments.pick_place.cell import Cell
from qpsafe.sim.experiments.pick_place.for_robot import work_for
from qpsafe.sim.ranging.sets import delay, range_sensors, sensor_kinds
from qpsafe.sim.world.furniture import add_obstacles
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.scene import Scene, build_scene
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.program import Program
from qpsafe.tasks.program_file import ProgramError, load_program, parse_program
from qpsafe.tasks.reach import joints_for
from qpsafe.tasks.trajectory import FixedPose, Trajectory

if TYPE_CHECKING:
    from qpsafe.batch.pack import Packed
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.hulls import Obstacle
    from qpsafe.tasks.task import Task

Array = NDArray[np.float64]

LINE = Path(__file__).with_name("line.toml")
RATES = (0.5, 2.0, 20.0)  # of that line, for robots that cannot follow it where it is [m/s, m/s², m/s³]
#: Motions that have a name; any other is the path of a program's file.
MOTIONS = ("hold", "line", "pick")


@dataclass(frozen=True)
class Station:
    """A robot at its work.

    Attributes:
        motion: One of `MOTIONS`, or the path of a program.
        robot: The robot, with spots.
        lag: Of its servos [s].
        sensor: As for `Plan`.
        furniture: A cell's TOML file, None for none.
    """

    motion: str
    robot: Robot
    lag: float = 0.0
    sensor: str = "ideal"
    furniture: str | None = None

    @cached_property
    def cell(self) -> Cell | None:
        """Tables, support and box of the third experiment, without screws; None where nothing but the pedestal is."""
        return replace(work_for(self.robot).cell, full=0) if self.motion == "pick" else None

    @cached_property
    def pedestal(self) -> float:
        """Height of the robot's base above the floor [m]."""
        return work_for(self.robot).pedestal if self.motion == "pick" else robot_stage(self.robot).pedestal

    @cached_property
    def scene(self) -> Scene:
        """The world without people."""
        return build_scene(self.robot, pedestal=self.pedestal, people=(), furnish=self._furnish)

    def _furnish(self, spec: Any) -> None:
        if self.cell is not None:
            self.cell.furnish(spec)
        if self.furniture is not None:
            add_obstacles(spec, load_cell(self.furniture))

    @cached_property
    def world(self) -> World:
        """The same as flat arrays for the engine."""
        return World.of(self.scene)

    @cached_property
    def spots(self) -> SpotArray:
        """The robot's distance sensors."""
        spots = load_spots(self.robot)
        assert spots is not None  # a station without them is refused
        return spots

    @cached_property
    def without_images(self) -> Station:
        """The same for a controller that is told points: no sensor is waited for."""
        return replace(self, sensor="ideal") if sensor_kinds(self.sensor).ranging else self

    @cached_property
    def packed(self) -> dict[str, Packed | None]:
        """Controllers as blocks for compiled code, by their names; filled by `qpsafe.sim.campaign.trials.play`."""
        return {}

    @cached_property
    def distances(self) -> Distances:
        """Pairs of shapes that must not touch: the robot's and furniture, floor, its own."""
        return Distances(self.world, self.robot)

    @cached_property
    def floor_plan(self) -> FloorPlan:
        """The cell as people see it."""
        robot, rng = self.robot, np.random.default_rng(3)
        wires = [robot.wire(rng.uniform(robot.lower, robot.upper), np.zeros(robot.nq)) for _ in range(500)]
        reach = max(float(np.hypot(*wire.ends[:, :2].T).max()) for wire in wires)
        tool = robot.pose(robot.tool_frames[0], self.start)[:3, 3]
        return FloorPlan.of(self.scene, tuple(tool.tolist()), reach)

    @cached_property
    def known(self) -> tuple[Obstacle, ...]:
        """The part of the cell that the controller knows."""
        return tuple(known_obstacles(self.scene))

    @cached_property
    def program(self) -> Program | None:
        """What the first tool follows; None where it stays where it is."""
        if self.motion == "hold":
            return None
        if self.motion not in MOTIONS:
            return load_program(Path(self.motion), self.robot)
        if self.motion == "pick":
            text = work_for(self.robot).program
        else:
            text = LINE.read_text(encoding="utf-8")
        try:
            return parse_program(text, f"the motion {self.motion!r}", self.robot)
        except ProgramError:
            if self.motion == "pick":
                raise
            return parse_program(line_for(self.robot, RATES), f"the motion {self.motion!r}", self.robot)

    @property
    def reference(self) -> Trajectory:
        """Of the first tool."""
        first = self.robot.tool_frames[0]
        return self.program or FixedPose(self.robot.pose(first, self.robot.home))

    @cached_property
    def start(self) -> Array:
        """Joint position at the beginning (n,) [rad]."""
        if self.program is None:
            return self.robot.home
        return joints_for(self.robot, self.robot.tool_frames[0], self.program.sample(0.0).pose, self.robot.home)

    def body_name(self, body: int) -> str:
        """Of the robot's tree: the joint that moves it, ``base`` for 0."""
        return "base" if body == 0 else self.robot.joint_names[body - 1]

    def tasks(self, trajectory: Trajectory | None = None) -> list[Task]:
        """Positions of all tools, then their orientations; the first tool follows its reference, or another one.

        Args:
            trajectory: Instead of `reference`.
        """
        first, *others = self.robot.tool_frames
        targets = {first: trajectory or self.reference}
        targets |= {name: FixedPose(self.robot.pose(name, self.start)) for name in others}
        kinds = PositionTask, OrientationTask
        return [kind(name, target) for kind in kinds for name, target in targets.items()]

    def controller(self, law: Any = None, trajectory: Trajectory | None = None, **parts: Any) -> SafetyController:
        """A controller for this work, with the station's tasks, thresholds and known obstacles.

        Args:
            law: The law; the controller's default if None.
            trajectory: Of the first tool, instead of `reference`.
            parts: More arguments of `SafetyController`.
        """
        count = len(self.robot.tool_frames)
        kinds = sensor_kinds(self.sensor)
        given: dict[str, Any] = {"known": self.known, "spots": "off" if kinds.spots is None else self.spots}
        if kinds.ranging and "range_sensors" not in parts:
            given["range_sensors"], _ = range_sensors(kinds.ranging, self.robot)
        thresholds = self.robot.with_parameters(parts.get("parameters", "robot"))
        given |= {"activation": robot_activation(thresholds, count, count)} | parts
        return SafetyController(self.robot, self.tasks(trajectory), law, **given)

    def nominal(self, ticks: int) -> float:
        """Time on the path after so many undisturbed ticks [s]: less than theirs where events wait.

        Args:
            ticks: Of `dt`.
        """
        while len(self._alone) < ticks:
            self._go_on_alone()
        return self._alone[ticks - 1]

    @cached_property
    def _alone(self) -> list[float]:
        return []

    @cached_property
    def _loner(self) -> list[Any]:
        return [self.controller(range_sensors=()), self.start, np.zeros(self.robot.nq)]

    def _go_on_alone(self) -> None:
        controller, q, qd = self._loner
        tick = controller.step(q, qd, points=np.empty((0, 3)))
        self._loner[1:] = tick.reference.q, tick.reference.qd
        self._alone.append(tick.path_time)

    @cached_property
    def separation(self) -> Separation:
        """Figures of a monitor made for this station: the delays of servo and sensors are part of its reaction time."""
        late = self.lag + 2.0 / OMEGA if self.lag > 0.0 else 0.0
        reaction = Separation.reaction_time + late + delay(self.sensor, self.robot)
        return Separation(self.deceleration, reaction_time=reaction)

    @cached_property
    def deceleration(self) -> float:
        """a_s: the smallest deceleration of a stop from the motion, or from 0.5 m/s where there is none [m/s²].

        Measured in the robot's model: every joint brakes at its acceleration limit; a_s = v²/(2 s) of the points of the
        wire that go at least half as fast as the fastest one, s the way they take to rest.
        """
        return min(stopped(self.robot, q, qd) for q, qd in self._moving or self._pushed())

    @cached_property
    def speed(self) -> float:
        """Of the fastest end of the wire in the nominal motion [m/s]; 0 where it never exceeds 0.1 m/s."""
        return max((float(wire_speeds(self.robot, q, qd).max()) for q, qd in self._moving), default=0.0)

    @cached_property
    def _moving(self) -> Sequence[tuple[Array, Array]]:
        """Configurations and joint velocities in the motion; none where it stands, or is slow."""
        if self.program is None:
            return []
        robot, frame, found = self.robot, self.robot.tool_frames[0], []
        q: Array = self.start
        for t in np.arange(0.0, min(self.program.duration, 20.0), 0.1):
            sample = self.program.sample(float(t))
            q = joints_for(robot, frame, sample.pose, q)
            qd = np.asarray(np.linalg.pinv(robot.jacobian(frame, q)) @ sample.twist, dtype=np.float64)
            if wire_speeds(robot, q, qd).max() > 0.1:
                found.append((q, qd))
        return found

    def _pushed(self) -> Iterator[tuple[Array, Array]]:
        """The start at 0.5 m/s, whatever way: from where evasion may have to stop."""
        robot, rng = self.robot, np.random.default_rng(7)
        for _ in range(60):
            wild = rng.normal(size=robot.nq) * robot.max_velocity
            yield self.start, 0.5 / wire_speeds(robot, self.start, wild).max() * wild


def station(robot: str, motion: str, lag: float = 0.0, sensor: str = "ideal", cell: str | None = None) -> Station:
    """The station of a robot and a motion, built once a process for each state of their files.

    Args:
        robot: A bundled name or a path, as for `load_robot`.
        motion: One of `MOTIONS`, or the path of a program.
        lag: Of the servos [s].
        sensor: As for `Plan`.
        cell: A TOML file of furniture, None for none.

    Raises:
        ConfigurationError: The robot has no spots, or cannot do the motion.
    """
    # os.path, unlike Path, says False of what cannot be a name
    if motion not in MOTIONS and not os.path.isfile(motion):
        raise ConfigurationError("campaign", "motions", motion, f"one of {', '.join(MOTIONS)}, or a program's file")
    state = robot_state(robot) + state_of(cell, None if motion in MOTIONS else motion)
    return _station(robot, motion, lag, sensor, cell, state)


@cache
def _station(robot: str, motion: str, lag: float, sensor: str, cell: str | None, state: State) -> Station:
    found = Station(motion, load_quietly(robot), lag, sensor, cell)
    if found.robot.spots_path is None:
        raise ConfigurationError("campaign", "robot", robot, "a robot with distance sensors (spots.toml)")
    found.start  # noqa: B018  a program that the robot cannot follow is refused now
    return found
