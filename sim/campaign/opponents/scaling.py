"""Speed and separation monitoring as path speed scaling: as fast along the path as the nearest person permits."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.separation import Separation
from qpsafe.recovery.recovery import FOLLOWING, SUSPENDED
from qpsafe.sim.campaign.opponents.as_in_paper import AS_IN_PAPER
from qpsafe.sim.campaign.opponents.monitor import Monitor

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tasks.trajectory import Trajectory
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

RAMP = 0.2  # from standstill to the full rate [s]
_LEAST = 1e-4  # an approach slower than this at the full rate needs no scaling [m/s]


class Clocked:
    """A trajectory on a clock of its own, which runs at a rate that is set from outside.

    Args:
        trajectory: What is followed.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self.time, self.rate = 0.0, 1.0
        self._passed = 0  # events
        self._waiting = False  # at one

    def sample(self, _: float) -> Any:
        """The present reference, whatever time is asked for."""
        return self.full().slowed(0.0 if self._waiting else self.rate)

    def full(self) -> Any:
        """The reference at the full rate."""
        return self._trajectory.sample(self.time)

    def advance(self, dt: float, met: Callable[[], bool]) -> None:
        """Let time pass; at an event only when the tasks are met, as a controller's own clock does.

        Args:
            dt: Tick [s].
            met: Tells whether they are.
        """
        ahead = self.time + self.rate * dt
        event = self._trajectory.event(self._passed) if hasattr(self._trajectory, "event") else None
        if event is not None and event.time <= ahead:
            self._waiting = not met()
            if self._waiting:
                return
            self._passed += 1
        self.time = ahead


class PathScaling:
    """Follows the path at the largest rate at which no body approaches a seen point faster than v_max.

    Args:
        station: What the robot does.
        separation: Figures of the monitor; measured ones by default.
    """

    def __init__(self, station: Station, separation: Separation | None = None) -> None:
        self._clock = Clocked(station.reference)
        self._controller = station.controller(trajectory=self._clock, range_sensors=(), **AS_IN_PAPER)
        self._monitor = Monitor(station, separation)
        self._robot, self._dt = station.robot, self._controller.dt
        self._speed = max(station.speed, 0.05)
        self._tolerance = self._controller.recovery_rules.tolerance

    def step(
        self, q: Array, qd: Array, distances: ArrayLike | None = None, *, points: ArrayLike | None = None,
        images: Any = None, now: float = 0.0,
    ) -> Tick:  # fmt: skip
        """One tick, as `SafetyController.step`.

        Args:
            q: Measured (n,) [rad].
            qd: Measured (n,) [rad/s].
            distances: Of the spots (k,) [m].
            points: Instead (p, 3) [m].
            images: Of range sensors.
            now: Present time on the clock of their stamps [s].
        """
        gaps, clock, separation = (
            self._monitor.gaps(q, qd, distances, points, images, now),
            self._clock,
            self._monitor.separation,
        )
        allowed, fall = 0.0, separation.deceleration * self._dt / self._speed
        if gaps is not None and not len(gaps.distances):
            allowed = 1.0
        elif gaps is not None:
            # q̇ at the full rate, as far as the tool says what it is
            frame = self._robot.tool_frames[0]
            full = np.linalg.lstsq(self._robot.jacobian(frame, q), clock.full().twist, rcond=None)[0]
            approach, most = gaps.rows @ full, separation.speed(gaps.distances)
            nearing = approach > _LEAST
            allowed = float(min(1.0, *(most[nearing] / approach[nearing]))) if nearing.any() else 1.0
            # it falls as fast as the joints can brake along the path
            fall = self._dt * float((self._robot.max_acceleration / np.maximum(np.abs(full), 1e-9)).min())
        clock.rate = min(max(allowed, clock.rate - fall), clock.rate + self._dt / RAMP)
        tick = self._controller.step(q, qd, points=_NOBODY)
        clock.advance(self._dt, lambda: all(float(np.linalg.norm(e)) <= self._tolerance for e in tick.errors))
        tick.phase = FOLLOWING if clock.rate > 0.0 else SUSPENDED
        tick.path_time, tick.points = clock.time, self._monitor.seen
        return tick


_NOBODY = np.empty((0, 3))
