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
from qpsafe.robot.state import RobotState
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.people.person import PersonPose
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.sensor import make_sensor
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tick import Tick

if TYPE_CHECKING:
    from qpsafe.sim.experiments.fixed.settings import FixedSettings

Array = NDArray[np.float64]

#: Spoils readings: distances (k,) in, distances and ages (or None) out.
Fault = Callable[[Array], tuple[Array, Array | None]]


class Moment(NamedTuple):
    """One tick of a run: what the controller said, and what it was told: distances (k,), or points (p, 3)."""

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
        self.sensor = make_sensor(experiment.sensor, scene, self.controller.spots, experiment.seed)
        self.poses: Callable[[int], Sequence[PersonPose]] = PosesAhead(self.walk.people, self.controller.dt)
        self.k = 0

    def step(self, fault: Fault | None = None) -> Moment:
        """Sense, control and tell the servo; the world stands still until `advance`."""
        controller, plant = self.controller, self.plant
        self.scene.place_people(plant.data, self.poses(self.k))
        q, qd = plant.q, plant.qd
        state = controller.robot.at(q)
        distances, ages = self.sensor.read(plant.data, state), None
        if fault is not None:
            distances, ages = fault(distances)
        tick = controller.step(q, qd, distances, ages=ages)
        reference = tick.reference
        # reference.q holds at the end of this period: the servo is told where it starts from
        plant.apply(reference.q - controller.dt * reference.qd, reference.qd)
        return Moment(tick, q, qd, distances, state)

    def advance(self) -> None:
        """Simulate one period."""
        self.plant.advance()
        self.k += 1

    def copy(self) -> FixedLoop:
        """The run as it is now, to go on in another way; robot, scene, law and rays are shared."""
        shared = (self.scene, self.scene.robot, self.walk, self.poses, self.controller.law, *self.targets.values())
        return copy.deepcopy(self, {id(item): item for item in shared})
