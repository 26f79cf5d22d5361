"""A whole Monte Carlo sample, by any `concurrent.futures` executor.

Pieces are handed out in order, `IN_FLIGHT` at a time, and put together in order: memory is bounded, and the result is
the same to the last bit for any executor and any number of workers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from typing import TYPE_CHECKING

from qpsafe.errors import ConfigurationError
from qpsafe.placement.sample import Detections, Sample
from qpsafe.sim.placement.cast import Setup, cast_pairs, pieces
from qpsafe.sim.placement.draw import workspace_radius

if TYPE_CHECKING:
    from qpsafe.placement.candidates import Candidates
    from qpsafe.robot.robot import Robot

#: Pieces handed out and not yet put together.
IN_FLIGHT = 32


class MonteCarlo:
    """Random pairs of the robot and a dummy, seen by all candidate nodes.

    Args:
        robot: The robot.
        candidates: Its candidate nodes.
        seed: Of everything random.
        pedestal: Height of the robot's base above the floor [m].
        radius: Of the disc about the base axis that dummies stand in [m]; by default as far as the wire reaches.

    Raises:
        ConfigurationError: A value makes no sense.
    """

    def __init__(
        self,
        robot: Robot,
        candidates: Candidates,
        *,
        seed: int = 0,
        pedestal: float = 0.55,
        radius: float | None = None,
    ) -> None:
        radius = workspace_radius(robot) if radius is None else radius
        if not 0.1 <= radius <= 10.0:
            raise ConfigurationError("MonteCarlo", "radius", radius, "0.1 to 10 m")
        if not 0.05 <= pedestal <= 2.0:
            raise ConfigurationError("MonteCarlo", "pedestal", pedestal, "0.05 to 2 m")
        if not (isinstance(seed, int) and seed >= 0):
            raise ConfigurationError("MonteCarlo", "seed", seed, "a whole number >= 0")
        robot_file = robot.folder if (robot.folder / "robot.toml").is_file() else robot.model_path
        zones = candidates.sensor.directions
        self.setup = Setup(robot_file, candidates.nodes, zones, candidates.free, seed, float(radius), float(pedestal))

    def sample(
        self,
        pairs: int = 3000,
        number: int = 0,
        executor: Executor | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Sample:
        """Draw a sample.

        Args:
            pairs: How many pairs.
            number: Of the sample; those of different numbers are independent of each other.
            executor: Anything with `submit`, e.g. a `ProcessPoolExecutor` or Dask's `Client.get_executor()`; by
                default everything is done here.
            progress: Called with the number of pairs finished.

        Raises:
            ConfigurationError: No pair is wanted, or pairs are infeasible.
        """
        if not (isinstance(pairs, int) and pairs >= 1):
            raise ConfigurationError("MonteCarlo", "pairs", pairs, "a number of pairs >= 1")
        parts = self._parts(pairs, number, executor)
        return Sample.collect(len(self.setup.nodes), _watched(parts, progress))

    def _parts(self, pairs: int, number: int, executor: Executor | None) -> Iterator[Detections]:
        if executor is None:
            for first, count in pieces(pairs):
                yield cast_pairs(self.setup, number, first, count)
            return
        waiting: deque[Future[Detections]] = deque()
        try:
            for first, count in pieces(pairs):
                waiting.append(executor.submit(cast_pairs, self.setup, number, first, count))
                if len(waiting) >= IN_FLIGHT:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def _watched(parts: Iterator[Detections], progress: Callable[[int], None] | None) -> Iterator[Detections]:
    done = 0
    for part in parts:
        yield part
        done += len(part.counts)
        if progress is not None:
            progress(done)
