"""Suspension and recovery, section IV-C, with a robot that follows its reference perfectly."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.recovery.recovery import FOLLOWING, RECOVERING, SUSPENDED, Recovery, RecoveryRules
from qpsafe.recovery.steps import minimum_jerk, run_out
from qpsafe.tasks.joint import PostureTask
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.rotation import exp3
from qpsafe.tasks.trajectory import Sample

DT, SAFE, MEDIUM, DANGEROUS = 0.01, 1.0, 9.0, 20.0
ACTIVE = {SAFE: (1.0, 1.0), MEDIUM: (1.0, 0.0), DANGEROUS: (0.0, 0.0)}
PAPER = RecoveryRules.paper()  # what is the paper's; `test_one_visit` is about the rest
RAMP = PAPER.ramp


class Event(NamedTuple):
    time: float
    name: str


class Line:
    """Moves along x at 0.1 m/s for ever; an event every 0.1 s, named by its number."""

    def sample(self, t: float) -> Sample:
        pose = np.eye(4)
        pose[0, 3] = 0.1 * t
        return Sample(pose, np.array([0.1, 0, 0, 0, 0, 0]))

    def event(self, k: int) -> Event:
        return Event(0.1 * (k + 0.5), str(k))


class Plain:
    """The same line without events."""

    sample = Line.sample


class State:
    """A robot's state, as far as tasks look at it."""

    def __init__(self, pose: np.ndarray) -> None:
        self._pose = pose
        self.q = np.zeros(6)

    def pose(self, frame: str) -> np.ndarray:
        return self._pose


class World:
    """A frame that sits where the last samples told it to be, as far as the tasks are active."""

    def __init__(self, events: bool = True) -> None:
        path = Line() if events else Plain()
        self.tasks = (PositionTask("tcp", path), OrientationTask("tcp", path))
        self.recovery = Recovery(self.tasks, 9.775, DT, PAPER)
        self.pose = np.eye(4)
        self.samples: tuple[Sample, ...] = ()
        self.events: list[str] = []

    def run(self, ticks: int, danger: float, follow: bool = True) -> list[str]:
        phases = []
        for _ in range(ticks):
            a = ACTIVE.get(danger, (0.0, 0.0))
            self.samples = self.recovery.update(danger, State(self.pose), a)  # type: ignore[arg-type]
            self.events.extend(self.recovery.due_events())
            self.recovery.pass_events()
            self.pose = self.pose.copy()
            if follow and a[0]:
                self.pose[:3, 3] = self.samples[0].pose[:3, 3]
            if follow and a[1]:
                self.pose[:3, :3] = self.samples[1].pose[:3, :3]
            phases.append(self.recovery.phase)
        return phases

    def push(self, x: float = 0.0, y: float = 0.0, turn: float = 0.0, rest: bool = True) -> None:
        """Evasion led away, and came to rest while danger was still there."""
        self.pose = self.pose.copy()
        self.pose[:2, 3] += x, y
        self.pose[:3, :3] = exp3(np.array([0.0, 0.0, turn])) @ self.pose[:3, :3]
        if rest:
            self.run(1, DANGEROUS)

    @property
    def stopped(self) -> np.ndarray:
        return self.tasks[0].trajectory.sample(self.recovery.path_time).pose


def test_path_runs_while_following() -> None:
    world = World()
    assert set(world.run(100, SAFE)) == {FOLLOWING}
    assert world.recovery.path_time == pytest.approx(100 * DT)
    assert world.samples[0].twist[0] == 0.1


def test_path_stands_still_while_suspended_and_goes_on_where_it_stopped() -> None:
    world = World()
    world.run(100, SAFE)
    stopped_at, stopped = world.recovery.path_time, world.samples[0].pose
    assert set(world.run(50, DANGEROUS)) == {SUSPENDED}
    assert world.recovery.path_time == stopped_at
    assert world.samples[0].pose == pytest.approx(stopped)
    assert not world.samples[0].twist.any()

    world.push(y=0.2)
    x_dr = world.pose.copy()
    assert world.run(1, SAFE) == [RECOVERING]
    assert world.samples[0].pose == pytest.approx(x_dr)  # recovery starts where the robot is
    while world.run(1, SAFE) == [RECOVERING]:
        assert world.recovery.path_time == stopped_at
    assert world.samples[0].pose == pytest.approx(stopped, abs=1e-12)  # the tick of return still shows x_d,s
    n = round(RAMP / DT)
    world.run(n + 50, SAFE)
    assert world.recovery.path_time == pytest.approx(stopped_at + (0.5 * (n + 1) + 50) * DT)  # a ramp, then full speed
    assert world.samples[0].twist[0] == pytest.approx(0.1)


def test_references_are_continuous_and_their_twist_is_their_derivative_from_recovery_on() -> None:
    world = World()
    world.run(30, SAFE)
    world.run(30, DANGEROUS)
    world.push(y=0.2, turn=0.5)
    last = world.pose
    for _ in range(400):
        world.run(1, SAFE)
        for sample in world.samples:
            assert np.linalg.norm(sample.twist[:3]) <= 0.25 + 1e-9  # no faster than the rules say
            assert np.linalg.norm(sample.twist[3:]) <= 0.8 + 1e-9
        step = world.samples[0].pose[:3, 3] - last[:3, 3]
        assert step == pytest.approx(world.samples[0].twist[:3] * DT, abs=3e-5)
        last = world.samples[0].pose
    assert world.recovery.phase == FOLLOWING
    assert world.pose == pytest.approx(world.stopped, abs=1e-9)


def test_a_return_begins_with_the_speed_of_the_robot() -> None:
    """What is left of the evasive motion runs out: neither the reference nor its speed jumps at x_d,r."""
    world = World()
    world.run(10, SAFE)
    world.run(1, DANGEROUS)
    for _ in range(5):
        world.push(y=0.1 * DT, turn=0.3 * DT)
    before = world.pose
    world.push(y=0.1 * DT, turn=0.3 * DT, rest=False)
    world.run(1, SAFE)
    assert world.samples[0].pose == pytest.approx(world.pose)
    assert world.samples[0].twist[:3] == pytest.approx((world.pose - before)[:3, 3] / DT)
    assert world.samples[1].twist[3:] == pytest.approx([0.0, 0.0, 0.3])
    last = world.samples[0]
    while world.run(1, SAFE) == [RECOVERING]:
        assert world.samples[0].pose[:3, 3] - last.pose[:3, 3] == pytest.approx(
            0.5 * DT * (world.samples[0].twist + last.twist)[:3], abs=1e-5
        )
        last = world.samples[0]
    assert world.pose == pytest.approx(world.stopped, abs=1e-9)


def test_a_task_faster_than_a_return_is_held_until_its_motion_has_run_out() -> None:
    """No step in its speed when danger goes: it fades with a time constant, then the return begins from there."""
    world, rules, fast = World(), PAPER, 0.6
    world.run(10, SAFE)
    world.run(1, DANGEROUS)
    for _ in range(5):
        world.push(y=fast * DT)
    world.push(y=fast * DT, rest=False)
    speed, held = fast, 0
    while speed > rules.speed:
        world.run(1, SAFE)
        speed *= np.exp(-DT / rules.fade)
        assert world.samples[0].twist[1] == pytest.approx(speed, rel=1e-9)
        world.pose[1, 3] += world.samples[0].twist[1] * DT  # the reference of a tick is where its motion begins
        held += 1
    assert held == np.ceil(rules.fade / DT * np.log(fast / rules.speed))
    world.run(1, SAFE)
    assert world.samples[0].twist[1] == pytest.approx(speed, rel=1e-9)  # the return begins with what is left
    assert world.run(400, SAFE)[-1] == FOLLOWING
    assert world.pose == pytest.approx(world.stopped, abs=1e-9)


def test_what_a_task_does_not_control_never_holds_its_return() -> None:
    """The tool may turn as fast as evasion wants: position returns at once."""
    world = World()
    world.run(10, SAFE)
    world.run(1, DANGEROUS)
    for _ in range(5):
        world.push(turn=2.0 * DT)
    world.push(turn=2.0 * DT, rest=False)
    while world.run(1, MEDIUM) == [RECOVERING]:
        world.push(turn=2.0 * DT, rest=False)
        assert world.recovery.path_time < 10 * DT + 1e-9
    assert world.recovery.phase == FOLLOWING


def test_danger_during_recovery_suspends_again() -> None:
    world = World()
    world.run(10, SAFE)
    world.run(10, DANGEROUS)
    stopped_at = world.recovery.path_time
    world.push(y=0.5)
    world.run(20, SAFE)
    assert world.run(1, DANGEROUS) == [SUSPENDED]
    assert world.recovery.path_time == stopped_at
    here = world.pose.copy()
    world.run(1, SAFE)
    assert world.samples[0].pose == pytest.approx(here)  # a new return, from the new pose


def test_a_task_still_released_returns_smoothly_later_while_the_path_goes_on() -> None:
    """In medium danger position recovers and the path goes on; orientation follows once it is active again."""
    world = World(events=False)
    world.run(10, SAFE)
    world.run(10, DANGEROUS)
    world.push(y=0.1, turn=1.0)
    assert world.run(300, MEDIUM)[-1] == FOLLOWING
    assert world.samples[1].pose[:3, :3] == pytest.approx(world.pose[:3, :3])  # not pulled while released
    start = world.recovery.path_time
    world.run(1, SAFE)
    assert world.samples[1].pose[:3, :3] == pytest.approx(world.pose[:3, :3], abs=1e-12)
    for _ in range(300):
        world.run(1, SAFE)
        assert np.linalg.norm(world.samples[1].twist[3:]) <= 0.8 + 1e-9
    assert world.recovery.path_time == pytest.approx(start + 301 * DT)
    assert world.pose[:3, :3] == pytest.approx(np.eye(3), abs=1e-12)


def test_recovery_waits_until_the_robot_is_back() -> None:
    world = World()
    world.run(10, SAFE)
    world.run(10, DANGEROUS)
    world.push(y=0.05)
    assert set(world.run(500, SAFE, follow=False)) == {RECOVERING}  # it does not move: never recovered
    assert world.recovery.waits_for == ("position",)  # and says so
    world.pose = world.stopped
    assert world.run(1, SAFE) == [FOLLOWING]
    assert world.recovery.waits_for == ()


def test_nan_danger_suspends() -> None:
    assert World().run(1, float("nan")) == [SUSPENDED]


def test_a_pause_ramps_the_clock_to_rest_and_resumes_where_it_stopped() -> None:
    world = World()
    world.run(50, SAFE)
    world.recovery.paused = True
    world.run(round(RAMP / DT), SAFE)
    stopped_at = world.recovery.path_time
    world.run(100, SAFE)
    assert world.recovery.path_time == stopped_at
    assert not world.samples[0].twist.any()
    world.recovery.paused = False
    world.run(1, SAFE)
    assert stopped_at < world.recovery.path_time < stopped_at + DT


def test_an_event_waits_until_the_tasks_are_met() -> None:
    world = World()
    world.push(turn=0.1, rest=False)  # as if the orientation had been released
    for _ in range(50):
        world.run(1, MEDIUM)
    assert world.events == []
    assert 0.05 - DT <= world.recovery.path_time <= 0.05
    assert world.recovery.waits_for == ("orientation",)
    world.pose[:3, :3] = np.eye(3)
    world.run(2, SAFE)
    assert world.events == ["0"]


@given(
    spells=st.lists(
        st.tuples(st.sampled_from((SAFE, MEDIUM, DANGEROUS)), st.integers(1, 60), st.booleans(), st.floats(-0.1, 0.1)),
        min_size=5,
        max_size=30,
    )
)
@settings(deadline=None, max_examples=some(10, of=60))
def test_no_event_is_lost_or_doubled_and_the_clock_never_goes_back(spells: list) -> None:
    """Whatever danger, pauses and evasion do: the events are 0, 1, 2 ... up to where the path is."""
    world, last = World(), 0.0
    for danger, ticks, paused, shift in spells:
        world.recovery.paused = paused
        if danger == DANGEROUS:
            world.push(y=shift, turn=3.0 * shift, rest=paused)
        for _ in range(ticks):
            (phase,) = world.run(1, danger)
            assert (phase == SUSPENDED) == (danger == DANGEROUS)
            assert world.recovery.path_time >= last
            assert world.recovery.path_time == last or phase == FOLLOWING
            last = world.recovery.path_time
    assert world.events == [str(k) for k in range(len(world.events))]
    assert abs(len(world.events) - last / 0.1) <= 0.5 + 1e-9


def test_times_are_set_back_when_the_robot_could_not_go_along() -> None:
    world = World()
    world.run(5, SAFE)
    world.run(5, DANGEROUS)
    world.push(y=0.1)
    world.run(10, SAFE)
    clocks, samples = world.recovery.clocks, world.samples
    world.recovery.update(SAFE, State(world.pose), ACTIVE[SAFE])  # type: ignore[arg-type]
    world.recovery.clocks = clocks
    again = world.recovery.update(SAFE, State(world.pose), ACTIVE[SAFE])  # type: ignore[arg-type]
    world.recovery.clocks = clocks
    assert again[0].pose == pytest.approx(samples[0].pose, abs=1e-2)
    once_more = world.recovery.update(SAFE, State(world.pose), ACTIVE[SAFE])  # type: ignore[arg-type]
    assert (once_more[0].pose == again[0].pose).all()


def test_nothing_waits_for_a_posture() -> None:
    path = Line()
    recovery = Recovery((PositionTask("tcp", path), PostureTask(np.ones(6))), 9.775, DT, PAPER)
    for danger in [SAFE, *[DANGEROUS] * 3]:
        recovery.update(danger, State(path.sample(recovery.path_time).pose), ACTIVE[danger])  # type: ignore[arg-type]
    here = State(path.sample(recovery.path_time).pose)
    for _ in range(400):  # joints never come to the posture, position is at its place
        recovery.update(SAFE, here, ACTIVE[SAFE])  # type: ignore[arg-type]
        if recovery.phase == FOLLOWING:
            break
    assert recovery.phase == FOLLOWING


def test_without_recovery_the_path_goes_on_whatever_happens() -> None:
    path = Plain()
    recovery = Recovery((PositionTask("tcp", path),), 9.775, DT, RecoveryRules(enabled=False))
    for _ in range(10):
        recovery.update(DANGEROUS, State(np.eye(4)), (0.0,))  # type: ignore[arg-type]
    assert recovery.phase == FOLLOWING
    assert recovery.path_time == pytest.approx(10 * DT)


@pytest.mark.parametrize(
    "key", ["speed", "angular_speed", "joint_speed", "shortest", "fade", "acceleration", "tolerance", "ramp", "calm"]
)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "fast"])
def test_rules_that_cannot_be_are_refused_by_name(key: str, value: object) -> None:
    with pytest.raises(ConfigurationError, match=key):
        RecoveryRules(**{key: value})  # type: ignore[arg-type]


def test_minimum_jerk_goes_from_rest_to_rest_and_its_derivative_is_right() -> None:
    assert minimum_jerk(0.0) == (0.0, 0.0)
    assert minimum_jerk(1.0) == (1.0, 0.0)
    for tau in np.linspace(0.01, 0.99, 9):
        difference = (minimum_jerk(tau + 1e-6)[0] - minimum_jerk(tau - 1e-6)[0]) / 2e-6
        assert minimum_jerk(tau)[1] == pytest.approx(difference, abs=1e-8)
        difference = (run_out(tau + 1e-6)[0] - run_out(tau - 1e-6)[0]) / 2e-6
        assert run_out(tau)[1] == pytest.approx(difference, abs=1e-8)
    assert (run_out(0.0), run_out(1.0)) == ((0.0, 1.0), (0.0, 0.0))
    assert max(minimum_jerk(t)[1] for t in np.linspace(0, 1, 1001)) == pytest.approx(15.0 / 8.0)


class Passing:
    """A line along x at a constant speed, with an event in the middle of the motion, twice."""

    def __init__(self, pose: np.ndarray, speed: float) -> None:
        self.pose, self.speed = pose, speed

    def sample(self, t: float) -> Sample:
        pose = self.pose.copy()
        pose[0, 3] += self.speed * t
        return Sample(pose, np.array([self.speed, 0.0, 0.0, 0.0, 0.0, 0.0]))

    def event(self, k: int) -> Event | None:
        return Event(0.4 * (k + 1), str(k)) if k < 2 else None


@pytest.mark.parametrize("speed", first(1, [-0.03, 0.01]))
def test_events_in_the_middle_of_a_motion_are_reached(irb140: Any, run: Any, speed: float) -> None:
    """While the clock stands for an event, its reference stands too: else the robot would lead it for ever."""
    path = Passing(irb140.pose("tcp", irb140.home), speed)
    loop = run(tasks=[qpsafe.PositionTask("tcp", path, 5.0), qpsafe.OrientationTask("tcp", path)])
    events: list[str] = []
    for _ in range(1500):
        events += loop.step().events
    assert events == ["0", "1"]
    assert loop.controller.recovery.path_time > 2.0
