"""A controlled IRB 140 whose joints follow their references perfectly, watched for its limits at every tick."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.tick import Tick

TOLERANCE = 1e-9


class Run:
    """A closed loop without a plant: what is commanded at one tick is measured at the next.

    Every tick is checked: the reference is finite, it is the integral of its own velocity, and it respects the limits
    of velocity and acceleration, and of position once it has been inside them.
    """

    def __init__(self, robot: Any, law: Any = None, q: Any = None, **options: Any) -> None:
        self.robot = robot
        goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
        self.tasks = options.pop("tasks", [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)])
        self.controller = qpsafe.SafetyController(robot, self.tasks, law, **options)
        self.q = np.array(robot.home if q is None else q, dtype=float)
        self.qd = np.zeros(robot.nq)
        self.count = 0
        self._inside = np.zeros(robot.nq, dtype=bool)

    def step(self, points: Any = (), distances: Any = None) -> Tick:
        """One tick of good joint data."""
        seen = {"points": points} if distances is None else {"distances": distances}
        return self.feed(self.q, self.qd, **seen)

    def feed(self, *data: Any, **named: Any) -> Tick:
        """One tick of any data whatever."""
        was_active, last_q, last_qd = self.count > 0 and self._active, self.q, self.qd
        tick = self.controller.step(*data, **named)
        reference = tick.reference
        assert tick.status in ("ok", "degraded", "bad_input", "fault")
        assert reference.seq == self.count
        assert reference.time == self.count * self.controller.dt
        self.count += 1
        self._active = reference.active
        if was_active:
            assert reference.active
        elif reference.active:  # now it knows where the robot is
            last_q, last_qd = np.array(data[0], dtype=float), np.zeros(self.robot.nq)
        else:
            assert np.array_equal(reference.q, self.robot.home)
            assert not reference.qd.any()
            return tick
        self._watch(reference.q, reference.qd, last_q, last_qd)
        self.q, self.qd = reference.q, reference.qd
        return tick

    def _watch(self, q: np.ndarray, qd: np.ndarray, last_q: np.ndarray, last_qd: np.ndarray) -> None:
        robot, dt = self.robot, self.controller.dt
        assert q.shape == qd.shape == (robot.nq,)
        assert q.dtype == qd.dtype == np.float64
        assert np.isfinite(q).all()
        assert np.isfinite(qd).all()
        assert (np.abs(q - last_q - qd * dt) <= 1e-12 + 1e-15 * np.abs(q)).all()
        if self.controller.limits == "off":
            return
        assert (np.abs(qd) <= robot.max_velocity + TOLERANCE).all()
        assert (np.abs(qd - last_qd) <= robot.max_acceleration * dt + TOLERANCE).all()
        inside = (q >= robot.lower - TOLERANCE) & (q <= robot.upper + TOLERANCE)
        assert inside[self._inside].all()
        self._inside |= inside

    @property
    def all_inside(self) -> bool:
        """Whether every joint has come inside its position limits; from then on it may not leave them."""
        return bool(self._inside.all())

    def stir(self, ticks: int = 40) -> None:
        """Set the robot in motion with a point in front of the tool."""
        tip = self.robot.pose("tcp", self.robot.home)[:3, 3]
        for _ in range(ticks):
            self.step(tip[None] + [0.12, 0.03, 0.05])
        assert np.abs(self.qd).max() > 0.1

    def settle(self, ticks: int, *data: Any, **named: Any) -> Tick:
        """Feed the same data; the robot must come to rest on the spot, as fast as it may, and stay."""
        start, most = self.qd, self.robot.max_acceleration * self.controller.dt
        for k in range(ticks):
            tick = self.feed(*data, **named)
            expected = np.sign(start) * np.maximum(np.abs(start) - (k + 1) * most, 0.0)
            assert np.abs(tick.reference.qd - expected).max() <= TOLERANCE
        assert not tick.reference.qd.any()
        return tick


@pytest.fixture(scope="session")
def irb140() -> Any:
    """The bundled robot."""
    return qpsafe.load_robot("irb140")


@pytest.fixture(scope="session")
def by_hand(irb140: Any) -> qpsafe.SpotArray:
    """The bundled robot's twenty spots placed by hand: on every link some that look to the sides, and upright ones."""
    return qpsafe.SpotArray.load(irb140.folder / "spots-by-hand.toml", irb140)


@pytest.fixture(scope="session")
def run(irb140: Any) -> Callable[..., Run]:
    """Makes a closed loop: `run(law=None, q=None, **options of SafetyController)`."""

    spots = qpsafe.load_spots(irb140)  # once, it takes longer than all the rest

    def make(law: Any = None, **options: Any) -> Run:
        return Run(irb140, law, **({"spots": spots} | options))

    return make
