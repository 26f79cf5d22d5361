"""Suspension and recovery, section IV-C, with a robot that follows its reference perfectly."""

import numpy as np
import pytest

from qpsafe.recovery import FOLLOWING, RECOVERING, SUSPENDED, Recovery
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.trajectory import Sample

DT, SAFE, DANGEROUS = 0.01, 1.0, 20.0
KEEP_ALL, KEEP_NONE = (1.0, 1.0), (0.0, 0.0)


class Line:
    """Moves along x at 0.1 m/s for ever."""

    def sample(self, t: float) -> Sample:
        pose = np.eye(4)
        pose[0, 3] = 0.1 * t
        return Sample(pose, np.array([0.1, 0, 0, 0, 0, 0]))


class World:
    """A frame that sits where the last position sample told it to be."""

    def __init__(self) -> None:
        path = Line()
        self.tasks = (PositionTask("tcp", path), OrientationTask("tcp", path))
        self.recovery = Recovery(self.tasks, 9.775, DT)
        self.pose = np.eye(4)
        self.samples: tuple[Sample, ...] = ()

    def run(self, ticks: int, danger: float, follow: bool = True) -> list[str]:
        phases = []
        for _ in range(ticks):
            a = KEEP_ALL if danger < 5 else KEEP_NONE
            self.samples = self.recovery.update(danger, lambda _: self.pose, a)
            if follow:
                self.pose = self.samples[0].pose
            phases.append(self.recovery.phase)
        return phases


def test_path_runs_while_following() -> None:
    world = World()
    assert set(world.run(100, SAFE)) == {FOLLOWING}
    assert world.recovery.path_time == pytest.approx(100 * DT)
    assert world.samples[0].twist[0] == 0.1


def test_path_stands_still_while_suspended_and_goes_on_where_it_stopped() -> None:
    world = World()
    world.run(100, SAFE)
    stopped_at, stopped = world.recovery.path_time, world.samples[0].pose
    assert set(world.run(50, DANGEROUS, follow=False)) == {SUSPENDED}
    assert world.recovery.path_time == stopped_at
    assert world.samples[0].pose == pytest.approx(stopped)
    assert not world.samples[0].twist.any()

    world.pose = world.pose.copy()
    world.pose[1, 3] += 0.2  # the evasive motion led away
    x_dr = world.pose.copy()
    assert world.run(1, SAFE) == [RECOVERING]
    assert world.samples[0].pose == pytest.approx(x_dr)  # recovery starts where the robot is
    phases = world.run(400, SAFE)
    assert phases.index(FOLLOWING) == 400 - phases.count(FOLLOWING)  # once following, it stays
    resumed = phases.count(FOLLOWING) - 1  # the tick of return still shows x_d,s
    assert world.recovery.path_time == pytest.approx(stopped_at + resumed * DT)


def test_references_are_continuous_from_recovery_on() -> None:
    world = World()
    world.run(30, SAFE)
    world.run(30, DANGEROUS, follow=False)
    world.pose = world.pose.copy()
    world.pose[1, 3] += 0.2
    last = world.pose
    for _ in range(300):
        world.run(1, SAFE)
        assert np.abs(world.samples[0].pose - last).max() <= 0.25 * DT + 1e-9  # no faster than the move's peak speed
        last = world.samples[0].pose


def test_danger_during_recovery_suspends_again() -> None:
    world = World()
    world.run(10, SAFE)
    world.run(10, DANGEROUS, follow=False)
    world.pose = world.pose.copy()
    world.pose[2, 3] += 0.5
    world.run(20, SAFE)
    assert world.run(1, DANGEROUS) == [SUSPENDED]
    here = world.pose.copy()
    world.run(1, SAFE)
    assert world.samples[0].pose == pytest.approx(here)  # a new move, from the new pose


def test_recovery_waits_until_the_robot_is_back() -> None:
    world = World()
    world.run(10, SAFE)
    world.run(10, DANGEROUS, follow=False)
    world.pose = world.pose.copy()
    world.pose[1, 3] += 0.05
    assert set(world.run(500, SAFE, follow=False)) == {RECOVERING}  # it does not move: never recovered
    world.pose = world.tasks[0].trajectory.sample(world.recovery.path_time).pose
    assert world.run(1, SAFE) == [FOLLOWING]


def test_nan_danger_suspends() -> None:
    assert World().run(1, float("nan")) == [SUSPENDED]
