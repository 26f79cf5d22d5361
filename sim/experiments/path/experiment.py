"""The paper's second experiment: the tool goes back and forth on a line while a person with a board comes and goes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.experiments.fixed.experiment import FixedExperiment, Observer
from qpsafe.sim.experiments.path.for_robot import line_for, walk_for
from qpsafe.sim.experiments.shared.programmed import Programmed
from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.sim.recording.log import RunLog
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.scene import Scene
from qpsafe.tick import Tick

#: The bundled path.
PROGRAM = Path(__file__).with_name("path.toml")

ROBOT = "irb140"  # whose line, and whose people, are the bundled ones
#: Quiet for two passes of the line; then from the front, then from the left.
SECOND_EXPERIMENT: tuple[Approach, ...] = (
    Approach(math.radians(0.0), start=9.0, medium_distance=1.02, close_distance=0.78, close_pause=2.0),
    Approach(math.radians(60.0), start=24.0, medium_distance=0.92, close_distance=0.62, close_pause=2.0),
)


@dataclass(frozen=True)
class PathRun:
    """A finished run, N ticks.

    Attributes:
        log: Every signal; errors are against the path.
        path_time: The path's clock (N,) [s].
        speed: Of the path's reference, as the clock runs (N,) [m/s].
        origin: Of the path's reference (N, 3) [m].
    """

    log: RunLog
    path_time: NDArray[np.float64]
    speed: NDArray[np.float64]
    origin: NDArray[np.float64]


@dataclass
class PathExperiment(Programmed, FixedExperiment):
    """One run of the second experiment; settings as for the first.

    Attributes:
        program: TOML file of what the tool follows; by default the IRB 140's line, or one that suits the robot.
    """

    duration: float = 45.0
    program: Path | None = None

    def __post_init__(self) -> None:
        if self.choreography is None:
            own = self.robot.name == ROBOT
            self.choreography = Choreography(SECOND_EXPERIMENT) if own else walk_for(self.robot, self.reference)
        super().__post_init__()

    def own_program(self) -> str:
        """The bundled line, or another robot's own."""
        return PROGRAM.read_text(encoding="utf-8") if self.robot.name == ROBOT else line_for(self.robot)

    def run_path(self, observer: Observer | None = None) -> PathRun:
        """Run it; see `FixedExperiment.run`."""
        times: list[float] = []

        def observe(tick: Tick, scene: Scene, plant: Plant) -> None:
            times.append(tick.path_time)
            if observer is not None:
                observer(tick, scene, plant)

        log = self.run(observe)
        path_time = np.array(times)
        samples = [self.reference.sample(t) for t in times]
        rate = np.diff(path_time, prepend=0.0) / log.dt
        speed = rate * [float(np.linalg.norm(sample.twist[:3])) for sample in samples]
        return PathRun(log, path_time, speed, np.array([sample.pose[:3, 3] for sample in samples]))
