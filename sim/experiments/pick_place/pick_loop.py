"""One run of the third experiment, a tick at a time: people, screws, sensors, controller, gripper, arm."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.controller import SafetyController
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sim.experiments.fixed.fixed_loop import Moment
from qpsafe.sim.experiments.pick_place.cell import Parts, Screw
from qpsafe.sim.experiments.pick_place.gripper import Gripper
from qpsafe.sim.experiments.pick_place.handwork import Handwork
from qpsafe.sim.experiments.pick_place.settings import SETTLE, PickPlaceSettings
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.sensor import make_sensor
from qpsafe.sim.world.tool_axis import tool_axis, turned_to
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tick import Tick

GRIP, RELEASE = "grip", "release"  # events of the program
SETTLED = 0.02  # a screw slower than this rests [m/s]


Array = NDArray[np.float64]


def screw_along(axis: Array) -> Obstacle:
    """A screw in the gripper: its head's top at the tip, its shank ahead along the tool's axis (3,)."""
    width, length = 2.0 * Screw.HEAD_RADIUS, Screw.HEAD + Screw.SHANK
    straight = Obstacle.box("screw", (width, width, length), (0.0, 0.0, 0.5 * length))
    return Obstacle("screw", straight.vertices @ turned_to(np.array([0.0, 0.0, 1.0]), axis).T)


class PickEvent(NamedTuple):
    """Something that happened to a screw.

    Attributes:
        tick: When.
        kind: ``grip`` or ``miss``, ``release`` (of nothing: ``empty``), ``delivered`` or ``lost`` (at rest in the box,
            or elsewhere), ``take``, ``place`` or ``nothing`` (a person).
        screw: Its number, -1 for none.
        person: Number of the person, -1 for the robot.
    """

    tick: int
    kind: str
    screw: int = -1
    person: int = -1


class PickLoop:
    """A run of the third experiment.

    Args:
        experiment: Its settings.
    """

    def __init__(self, experiment: PickPlaceSettings) -> None:
        scene, robot, cell = experiment.scene, experiment.robot, experiment.cell
        self.scene, self.cell, self.people = scene, cell, experiment.people
        self.plant = Plant(scene, lag=experiment.lag, q=experiment.start)
        self.program = experiment.reference
        self.frame = self.program.frame
        tasks = experiment.tasks
        if tasks is None:
            tasks = [PositionTask(self.frame, self.program), OrientationTask(self.frame, self.program)]
        self.controller = SafetyController(
            robot,
            tasks,
            experiment.law,
            sensing=experiment.rules,
            known=known_obstacles(scene),
            carried={self.frame: [screw_along(tool_axis(robot, self.frame))]},  # the gripper may hold one
            recovery=experiment.recovery,
            **experiment.parts(),
        )
        spots = self.controller.spots
        assert spots is not None
        self.sensor = make_sensor(experiment.sensor, scene, spots, experiment.seed)
        self.parts = Parts.of(scene, cell.screws)
        self.gripper = Gripper(scene, self.parts)
        self.handwork = Handwork(cell, self.parts, experiment.carried, self.controller.dt)
        self.falling: set[int] = set()
        self.events: list[PickEvent] = []
        self.poses = PosesAhead(self.people, self.controller.dt)
        self.k = 0

    def step(self) -> Moment:
        """Sense, control, grip and tell the servo; the world stands still until `advance`."""
        controller, plant, data = self.controller, self.plant, self.plant.data
        poses = self.poses(self.k)
        gripped = () if self.gripper.holding is None else (self.gripper.holding,)
        for deed in self.handwork.update(data, poses, gripped):
            self.events.append(PickEvent(self.k, deed.kind, deed.screw, deed.person))
            self.falling.discard(deed.screw)
        self.scene.place_people(data, poses)
        q, qd = plant.q, plant.qd
        state = controller.robot.at(q)
        distances = self.sensor.read(data, state)
        tick = controller.step(q, qd, distances)
        for name in tick.events:
            self._act(name, data)
        reference = tick.reference
        # reference.q holds at the end of this period: the servo is told where it starts from
        plant.apply(reference.q - controller.dt * reference.qd, reference.qd)
        return Moment(tick, q, qd, distances, state)

    def asked_again(self, k: int, q: Array, qd: Array, distances: Array) -> Tick:
        """The answer at a tick of a recorded run.

        Args:
            k: The tick, one after another from 0.
            q: Measured then (n,) [rad].
            qd: Measured then (n,) [rad/s].
            distances: Of the spots (k,) [m].
        """
        return self.controller.step(q, qd, distances)

    def advance(self) -> None:
        """Simulate one period, and see which screws have come to rest."""
        self.plant.advance()
        self.k += 1
        if self.falling and self.k % 25 == 0:
            places, speeds = self.parts.positions(self.plant.data), self.parts.speeds(self.plant.data)
            for screw in sorted(self.falling):
                if speeds[screw] < SETTLED:
                    self.falling.discard(screw)
                    kind = "delivered" if self.cell.in_box(places[screw : screw + 1])[0] else "lost"
                    self.events.append(PickEvent(self.k, kind, screw))

    def done(self, cycles: int, settle: float = SETTLE) -> bool:
        """Whether so many screws have been let go, the last one `settle` ago [s]."""
        ticks = [event.tick for event in self.events if event.kind in (RELEASE, "empty")]
        return len(ticks) >= cycles and (self.k - ticks[cycles - 1]) * self.controller.dt >= settle

    def _act(self, name: str, data: Any) -> None:
        if name == GRIP:
            screw = self.gripper.grip(data)
            self.events.append(PickEvent(self.k, "miss" if screw is None else GRIP, -1 if screw is None else screw))
        elif name == RELEASE:
            screw = self.gripper.release(data)
            self.events.append(PickEvent(self.k, "empty" if screw is None else RELEASE, -1 if screw is None else screw))
            if screw is not None:
                self.falling.add(screw)

    def whereabouts(self) -> tuple[str, ...]:
        """Where each screw is: ``gripper``, ``falling``, ``person N``, ``box``, ``hole N`` or ``elsewhere``."""
        places = self.parts.positions(self.plant.data)
        inside = self.cell.in_box(places)
        gaps = np.linalg.norm(places[:, None] - self.cell.holes[None], axis=2)
        found = []
        for k in range(len(places)):
            owner = next((n for n, held in enumerate(self.handwork.held) if k in held), None)
            if k == self.gripper.holding:
                found.append("gripper")
            elif owner is not None:
                found.append(f"person {owner}")
            elif k in self.falling:
                found.append("falling")
            elif inside[k]:
                found.append("box")
            elif gaps[k].min() < 2e-3:
                found.append(f"hole {int(gaps[k].argmin())}")
            else:
                found.append("elsewhere")
        return tuple(found)


def motion(wire_velocities: NDArray[np.float64], qd: NDArray[np.float64]) -> float:
    """How fast the robot moves: its fastest joint frame or the tool's tip, or a joint at 0.1 m from its axis [m/s]."""
    return float(max(np.sqrt((wire_velocities**2).sum(axis=-1)).max(), 0.1 * np.abs(qd).max()))
