"""Controller, sensor and plant of the first experiment, one tick at a time; can be copied in mid-run."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.controller import SafetyController
from qpsafe.danger.thresholds import robot_activation
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.ranging.sensor import RangeImage
from qpsafe.robot.state import RobotState
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.people.person import PersonPose
from qpsafe.sim.ranging.in_scene import SceneRanging
from qpsafe.sim.ranging.sets import sensor_kinds
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.sensor import Sensor, make_sensor
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tick import Tick

if TYPE_CHECKING:
    from qpsafe.sim.experiments.fixed.settings import FixedSettings

Array = NDArray[np.float64]

#: Spoils readings: distances (k,) in, distances and ages (or None) out.
Fault = Callable[[Array], tuple[Array, Array | None]]
#: Spoils images: those that came in, those that the controller is given out.
FrameFault = Callable[[list[RangeImage]], list[RangeImage]]


class Moment(NamedTuple):
    """One tick of a run: what the controller said, and what it was told.

    Attributes:
        tick: What it said.
        q: Measured (n,) [rad].
        qd: Measured (n,) [rad/s].
        distances: Readings of the spots, and the nearest of each range sensor's last image (k,) [m]; or points (p, 3).
        state: The robot at q.
    """

    tick: Tick
    q: Array
    qd: Array
    distances: Array
    state: RobotState


class FixedLoop:
    """A run of the first experiment.

    Args:
        experiment: Its settings.
    """

    def __init__(self, experiment: FixedSettings) -> None:
        robot, scene = experiment.robot, experiment.scene
        self.scene, self.walk = scene, experiment.walk
        self.plant = Plant(scene, lag=experiment.lag, q=experiment.start)
        self.targets = experiment.references
        parts, tasks = experiment.parts(), experiment.tasks
        if tasks is None:  # one hierarchy: where all tools are, over how they are turned
            kinds = PositionTask, OrientationTask
            tasks = [kind(name, target) for kind in kinds for name, target in self.targets.items()]
            if parts["activation"] is None:
                parts["activation"] = robot_activation(robot, len(self.targets), len(self.targets))
        self.controller = SafetyController(
            robot,
            tasks,
            experiment.law,
            limits=None if experiment.limits else "off",
            known=known_obstacles(scene),
            barrier=None if experiment.cap is None else DangerBarrier(experiment.cap),
            **parts,
        )
        told, seed, spots = sensor_kinds(experiment.sensor), experiment.seed, self.controller.spots
        self.sensor: Sensor | None = None if told.spots is None else make_sensor(told.spots, scene, spots, seed)
        self.ranging = SceneRanging(scene, told.ranging, seed) if told.ranging else None
        #: What the controller is told of: spots, then range sensors; empty with perfect sight.
        self.sensor_names = () if spots is None or told.spots == "perfect" else spots.names
        self._spots = len(self.sensor_names)
        self.sensor_names += () if self.ranging is None else self.ranging.names
        self.poses: Callable[[int], Sequence[PersonPose]] = PosesAhead(self.walk.people, self.controller.dt)
        self.k = 0

    def step(self, fault: Fault | None = None, frames: FrameFault | None = None) -> Moment:
        """Sense, control and tell the servo; the world stands still until `advance`.

        Args:
            fault: Spoils readings of spots.
            frames: Spoils images.
        """
        controller, plant = self.controller, self.plant
        self.scene.place_people(plant.data, self.poses(self.k))
        q, qd = plant.q, plant.qd
        state = controller.robot.at(q)
        distances, ages = None if self.sensor is None else self.sensor.read(plant.data, state), None
        if fault is not None and distances is not None:
            distances, ages = fault(distances)
        images = self.images(state)
        if frames is not None and images is not None:
            images = frames(images)
        tick = self.ask(q, qd, distances, ages, images)
        reference = tick.reference
        # reference.q holds at the end of this period: the servo is told where it starts from
        plant.apply(reference.q - controller.dt * reference.qd, reference.qd)
        told = [] if distances is None else [distances]
        if self.ranging is not None:
            told.append(self.ranging.nearest.copy())
        return Moment(tick, q, qd, told[0] if len(told) == 1 else np.concatenate(told), state)

    def images(self, state: RobotState) -> list[RangeImage] | None:
        """Images that come at this tick, people in their places; None where no sensor makes images."""
        return (
            None if self.ranging is None else self.ranging.images(self.k * self.controller.dt, self.plant.data, state)
        )

    def ask(
        self, q: Array, qd: Array, distances: Array | None, ages: Array | None, images: list[RangeImage] | None
    ) -> Tick:
        """The controller's answer.

        Args:
            q: Measured (n,) [rad].
            qd: Measured (n,) [rad/s].
            distances: Of the spots, or points; None where there are none.
            ages: Of the readings [s].
            images: That came; None where no sensor makes images.
        """
        if images is None:
            return self.controller.step(q, qd, distances, ages=ages)
        return self.controller.step(q, qd, distances, ages=ages, images=images, now=self.k * self.controller.dt)

    def asked_again(self, k: int, q: Array, qd: Array, distances: Array) -> Tick:
        """The answer at a tick of a recorded run; images are made again, as they were.

        Args:
            k: The tick, one after another from 0.
            q: Measured then (n,) [rad].
            qd: Measured then (n,) [rad/s].
            distances: What the run was remembered by (k,) [m].
        """
        self.k = k
        images = None
        if self.ranging is not None:
            self.scene.place_people(self.plant.data, self.poses(k))
            images = self.images(self.controller.robot.at(q))
        readings = None if self.sensor is None else distances[: self._spots]
        return self.ask(q, qd, readings, None, images)

    def advance(self) -> None:
        """Simulate one period."""
        self.plant.advance()
        self.k += 1

    def copy(self) -> FixedLoop:
        """The run as it is now, to go on in another way; robot, scene, law and rays are shared."""
        shared = (self.scene, self.scene.robot, self.walk, self.poses, self.controller.law, *self.targets.values())
        return copy.deepcopy(self, {id(item): item for item in shared})
