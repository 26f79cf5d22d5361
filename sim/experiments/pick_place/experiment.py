"""The paper's third experiment: screws from a support into a box, while two people come for screws and bring some."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.experiments.fixed.experiment import Observer, euler_error, own_errors, pose_error
from qpsafe.sim.experiments.pick_place.pick_loop import RELEASE, PickEvent, PickLoop, motion
from qpsafe.sim.experiments.pick_place.settings import SETTLE, PickPlaceSettings
from qpsafe.sim.recording.log import Recorder, RunLog
from qpsafe.sim.world.clearance import Furniture
from qpsafe.sim.world.distance import TrueDistances

STATES = 10  # ticks between two states that are kept for pictures


@dataclass(frozen=True)
class PickRun:
    """A finished run, N ticks.

    Attributes:
        log: Every signal; errors are against the program, board distances +inf.
        path_time: The program's clock (N,) [s].
        motion: How fast the robot moves, see `qpsafe.sim.experiments.pick_place.pick_loop.motion`, (N,) [m/s].
        events: What happened to the screws.
        screws: Where each screw is at the end.
        clearance: Smallest distance robot-furniture, every `STATES` ticks, (M,) [m].
        states: Positions of everything that moves, every `STATES` ticks, (M, nq).
        finished: Whether all cycles were done in time.
    """

    log: RunLog
    path_time: NDArray[np.float64]
    motion: NDArray[np.float64]
    events: tuple[PickEvent, ...]
    screws: tuple[str, ...]
    clearance: NDArray[np.float64]
    states: NDArray[np.float64]
    finished: bool

    def times(self, *kinds: str) -> NDArray[np.float64]:
        """When events of some kinds happened [s]."""
        return np.array([event.tick * self.log.dt for event in self.events if event.kind in kinds])

    def count(self, *kinds: str) -> int:
        """How many events of some kinds there were."""
        return sum(event.kind in kinds for event in self.events)

    @property
    def cycle_times(self) -> NDArray[np.float64]:
        """From one release to the next, the first one from the beginning [s]."""
        return np.diff(self.times(RELEASE, "empty"), prepend=0.0)


@dataclass
class PickPlaceExperiment(PickPlaceSettings):
    """The third experiment with one set of settings, see `PickPlaceSettings`; equal ones give bit-identical logs."""

    def run(self, observer: Observer | None = None) -> PickRun:
        """Run it with the controller, until the last screw lies in the box or `limit` is over.

        Args:
            observer: Called after every tick, e.g. to draw it or to show progress.

        Raises:
            SimulationFailedError: MuJoCo reported bad values.
        """
        loop = PickLoop(self)
        controller, plant, scene, robot, frame = loop.controller, loop.plant, loop.scene, self.robot, loop.frame
        assert controller.spots is not None
        recorder = Recorder(controller.dt, controller.spots.names)
        furniture, gaps = Furniture(scene), TrueDistances(scene)
        path_time, moving, states, clearance = [], [], [], []
        left, after = round(self.limit / controller.dt), round(SETTLE / controller.dt)
        done = 0
        while left > 0 and after > 0:
            tick, q, qd, distances, state = loop.step()
            done += tick.events.count(RELEASE)
            left, after = left - 1, after - (done >= self.cycles)
            pose, goal = state.pose(frame), self.reference.sample(tick.path_time).pose
            commanded = robot.at(tick.reference.q)
            gap = gaps.person(plant.data).distance if self.people else np.inf
            recorder.add(
                tick,
                q,
                qd,
                distances,
                pose_error(pose, goal),
                euler_error(commanded.pose(frame), goal),
                (np.inf, gap),
                errors=own_errors(self, commanded, {frame: goal}),
                metrics=self.measured(tick, scene, plant),
            )
            path_time.append(tick.path_time)
            wire = state.wire(qd)
            moving.append(motion(np.concatenate((wire.start_velocities, wire.end_velocities)), qd))
            if loop.k % STATES == 0:
                states.append(plant.data.qpos.copy())
                clearance.append(furniture.distance(plant.data))
            if observer is not None:
                observer(tick, scene, plant)
            loop.advance()
        return PickRun(
            recorder.finish(),
            np.array(path_time),
            np.array(moving),
            tuple(loop.events),
            loop.whereabouts(),
            np.array(clearance),
            np.array(states),
            finished=done >= self.cycles,
        )
