"""The paper's first experiment: a fixed tool reference while a person with a card board comes from three sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.robot.state import RobotState
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop, Moment
from qpsafe.sim.experiments.fixed.settings import FixedSettings
from qpsafe.sim.experiments.shared.control import Control
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.recording.log import Recorder, RunLog
from qpsafe.sim.world.distance import Distance, TrueDistances
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.scene import Scene
from qpsafe.tasks.rotation import euler_zyx, log3
from qpsafe.tick import Tick

Observer = Callable[[Tick, Scene, Plant], None]


@dataclass
class FixedExperiment(FixedSettings):
    """The first experiment with one set of settings, see `FixedSettings`; equal ones give bit-identical logs."""

    def run(self, observer: Observer | None = None) -> RunLog:
        """Run it with the controller.

        Args:
            observer: Called after every tick, e.g. to draw it or to show progress.

        Raises:
            SimulationFailedError: MuJoCo reported bad values.
        """
        scene, loop = self.scene, FixedLoop(self)
        plant, notes, gaps = loop.plant, Notes(self, loop), TrueDistances(scene)
        for _ in range(round(self.duration / loop.controller.dt)):
            moment = loop.step()
            notes.add(moment, gaps.measure(plant.data))
            if observer is not None:
                observer(moment.tick, scene, plant)
            loop.advance()
        return notes.finish()

    def board_distance_without_controller(self) -> NDArray[np.float64]:
        """Smallest distance robot-board at every tick if the robot just keeps its pose (N,) [m]."""
        return self._board_distance(TrueDistances(self.scene))

    def moving_links(self, log: RunLog) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The same of the links that move, in a run and if the robot just keeps its pose, (N,) each [m].

        A foot that is bolted down may be what is nearest to somebody, and gets away from nobody.

        Args:
            log: The run.
        """
        gaps = TrueDistances(self.scene, moving=True)
        return self._board_distance(gaps, log.q), self._board_distance(gaps)

    def _board_distance(self, gaps: TrueDistances, q: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        scene, dt = self.scene, 0.004
        data, poses = scene.make_data(), PosesAhead(self.walk.people, dt)
        result = np.empty(round(self.duration / dt) if q is None else len(q))
        for k in range(len(result)):
            scene.place_people(data, poses(k))
            if q is not None:
                data.qpos[scene.q_addresses] = q[k]
            result[k] = gaps.board(data).distance
        return result


class Notes:
    """What a run of the first or second experiment is remembered by.

    Args:
        experiment: Its settings.
        loop: What runs.

    Raises:
        ConfigurationError: There are no readings of sensors to be written down.
    """

    def __init__(self, experiment: FixedExperiment, loop: FixedLoop) -> None:
        self._experiment, self._plant = experiment, loop.plant
        if not loop.sensor_names:
            expected = "not perfect: a run is remembered by what its sensors read"
            raise ConfigurationError("FixedExperiment", "sensor", experiment.sensor, expected)
        self._recorder = Recorder(loop.controller.dt, loop.sensor_names)

    def add(self, moment: Moment, gaps: tuple[Distance, Distance]) -> None:
        """Write down a tick.

        Args:
            moment: The tick.
            gaps: True distances to boards and to people, as `TrueDistances.measure` finds them at it.
        """
        experiment, tick = self._experiment, moment.tick
        goals = {name: target.sample(tick.path_time).pose for name, target in experiment.references.items()}
        commanded = experiment.robot.at(tick.reference.q)
        measured = [pose_error(moment.state.pose(name), goal) for name, goal in goals.items()]
        self._recorder.add(
            tick,
            moment.q,
            moment.qd,
            moment.distances,
            (np.concatenate([error[0] for error in measured]), np.concatenate([error[1] for error in measured])),
            np.concatenate([euler_error(commanded.pose(name), goal) for name, goal in goals.items()]),
            (gaps[0].distance, gaps[1].distance),
            errors=own_errors(experiment, commanded, goals),
            metrics=experiment.measured(tick, experiment.scene, self._plant),
        )

    def finish(self) -> RunLog:
        """The run so far."""
        return self._recorder.finish()


def own_errors(
    settings: Control, commanded: RobotState, goals: Mapping[str, NDArray[np.float64]]
) -> tuple[NDArray, NDArray] | None:
    """Position and orientation errors of all tools where tasks are the user's and say something else; else None.

    Args:
        settings: Of the experiment.
        commanded: Where the robot is to be.
        goals: Where each tool should be, (4, 4).
    """
    if settings.tasks is None:
        return None
    errors = [pose_error(commanded.pose(name), goal) for name, goal in goals.items()]
    return np.concatenate([error[0] for error in errors]), np.concatenate([error[1] for error in errors])


def pose_error(pose: NDArray[np.float64], target: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Position error (3,) [m] and rotation vector (3,) [rad] from `pose` to `target`."""
    return target[:3, 3] - pose[:3, 3], log3(target[:3, :3] @ pose[:3, :3].T)


def euler_error(pose: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """The paper's orientation error: differences of the Euler angles φ, θ, ψ, wrapped to (-pi, pi] (3,) [rad]."""
    difference = euler_zyx(target[:3, :3]) - euler_zyx(pose[:3, :3])
    return np.pi - np.mod(np.pi - difference, 2.0 * np.pi)
