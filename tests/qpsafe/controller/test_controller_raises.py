"""Whatever raises inside a tick, wherever it does, the command advances once, within its limits, and no event is lost.

All parts are of derived classes whose every public method and property may raise: that is all code of a user's there
can be. `run` checks each tick: the position is the integral of the velocity, limits hold, numbers follow one another.
"""

from collections.abc import Callable, Iterator
from inspect import isfunction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.recovery.recovery import RecoveryRules
from qpsafe.sensing.detection import BadInput
from qpsafe.tasks.program import Event
from qpsafe.tasks.trajectory import Sample

TICKS = 36
EVENTS = (Event(0.0, "first"), Event(0.02, "second"), Event(0.02, "third"), Event(0.03, "fourth"))


class Mute(Exception):
    """It cannot say what it is about."""

    def __str__(self) -> str:
        raise RuntimeError("no words")

    __repr__ = __str__


class Nameless(type):
    """A class of classes that have no name."""

    @property
    def __name__(cls) -> str:  # type: ignore[override]
        raise RuntimeError("no name")


class Worse(Mute, metaclass=Nameless):
    """Nor what it is."""


class MuteInput(BadInput):
    """Looks like bad input, and is mute."""

    def __str__(self) -> str:
        raise RuntimeError("no words")


KINDS = (RuntimeError, Mute, Worse, MuteInput, BadInput, StopIteration, MemoryError, ZeroDivisionError, KeyError)


class Fuse:
    """Counts the calls of code of the user's; some of them raise."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.lit: Callable[[int], bool] = lambda count: False
        self.kind: type[Exception] = RuntimeError
        self.burnt: list[str] = []

    def touch(self, name: str) -> None:
        self.names.append(name)
        if self.lit(len(self.names)):
            self.burnt.append(name)
            raise self.kind(name)

    def on(self, function: Any, name: str) -> Any:
        def touched(*args: Any, **named: Any) -> Any:
            self.touch(name)
            return function(*args, **named)

        return touched

    def armed(self, kind: type, but: tuple[str, ...] = ()) -> Any:
        """A class derived from `kind` with a fuse on everything public, but for some."""
        body: dict[str, Any] = {}
        for key in sorted(set(dir(kind)) - set(but)):
            found = getattr(kind, key)
            if not key.startswith("_") and isfunction(found):
                body[key] = self.on(found, f"{kind.__name__}.{key}")
            elif not key.startswith("_") and isinstance(found, property):
                assert found.fget is not None
                body[key] = property(self.on(found.fget, f"{kind.__name__}.{key}"))
        return type(f"Armed{kind.__name__}", (kind,), body)


class Reference(Sample):
    """It stays of its kind on a slower clock."""

    def slowed(self, rate: float) -> Sample:
        return type(self)(self.pose, rate * self.twist)


class Swaying:
    """A path with events."""

    def __init__(self, pose: np.ndarray, sample: Any = Sample) -> None:
        self.pose, self.kind = pose, sample

    def sample(self, t: float) -> Any:
        pose = self.pose.copy()
        pose[1, 3] += 0.05 * np.sin(4.0 * t)
        return self.kind(pose, np.array([0.0, 0.2 * np.cos(4.0 * t), 0.0, 0.0, 0.0, 0.0]))

    def event(self, k: int) -> Event | None:
        return EVENTS[k] if k < len(EVENTS) else None


PARTS = ("task", "own task", "path", "sample", "law", "field", "activation", "evasion", "limits", "barrier", "recovery")


def armed_loop(run: Any, robot: Any, fuse: Fuse, parts: frozenset[str]) -> Any:
    """A loop in which the given parts are armed, the others of the built-in kind; the fuse is not lit yet."""

    def kind(part: str, built_in: type) -> Any:
        return fuse.armed(built_in) if part in parts else built_in

    path = kind("path", Swaying)(robot.pose("tcp", robot.home), kind("sample", Reference))
    tasks = [kind("task", qpsafe.PositionTask)("tcp", path), qpsafe.OrientationTask("tcp", path)]
    if "own task" in parts:  # asked method by method
        tasks[1] = fuse.armed(qpsafe.OrientationTask, ("clik", "compiled_clik", "plain"))("tcp", path)
    field = kind("field", qpsafe.DangerField)()
    limits = robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration
    loop = run(
        kind("law", qpsafe.HierarchicalLaw)(),
        tasks=tasks,
        field=field,
        activation=kind("activation", qpsafe.Activation)(),
        evasion=kind("evasion", qpsafe.Evasion)(4.0, 20.0, robot.nq),
        limits=kind("limits", qpsafe.JointLimits)(*limits),
        barrier=kind("barrier", qpsafe.DangerBarrier)(30.0, field=field) if "barrier" in parts else None,
        recovery=kind("recovery", RecoveryRules)(shortest=0.02, ramp=0.02, tolerance=0.05, calm=1.0, dwell=0.0),
    )
    fuse.names.clear()
    return loop


def play(loop: Any, robot: Any, fuse: Fuse, ticks: int = TICKS) -> Iterator[Any]:
    """Follow, be suspended and released, come back, follow; a tick in which something burnt says so."""
    tip = robot.pose("tcp", robot.home)[:3, 3]
    for k in range(ticks):
        burnt = len(fuse.burnt)
        tick = loop.step(tip[None] + [0.16, 0.02, 0.0] if 12 <= k < 18 else np.empty((0, 3)))
        assert (tick.status in ("fault", "bad_input")) == (len(fuse.burnt) > burnt)
        if len(fuse.burnt) > burnt:
            assert tick.messages
            assert all(type(message) is str for message in tick.messages)
            assert tick.events == ()
            assert str(tick)
        yield tick


def until_done(loop: Any, robot: Any, fuse: Fuse) -> list[str]:
    """All events of a play that goes on, unspoilt, until the path has passed them."""
    found = [name for tick in play(loop, robot, fuse) for name in tick.events]
    fuse.lit = lambda count: False
    for k in range(300):
        found += loop.step().events
        if k > 5 and len(found) >= len(EVENTS):
            break
    return found


NAMES = sorted(event.name for event in EVENTS)


def called(run: Any, robot: Any) -> tuple[list[str], set[str]]:
    fuse = Fuse()
    loop = armed_loop(run, robot, fuse, frozenset(PARTS))
    phases = {tick.phase for tick in play(loop, robot, fuse)}
    return fuse.names, phases


def test_a_raise_at_any_kind_of_call_advances_once_and_loses_no_event(run: Any, irb140: Any) -> None:
    """Each method and property that a tick asks anything of, at one of its calls."""
    names, phases = called(run, irb140)
    assert phases == {"following", "suspended", "recovering"}
    asked = {"PositionTask.clik", "OrientationTask.jacobian", "OrientationTask.velocity", "Swaying.event"}
    asked |= {"Reference.offset", "Reference.displaced", "HierarchicalLaw.solve", "DangerField.evaluate"}
    asked |= {"Activation.at", "Evasion.step", "JointLimits.box", "DangerBarrier.scale"}
    assert asked <= set(names)
    rng = np.random.default_rng(13)
    for place, name in enumerate(sorted(set(names))[:: some(2, of=1)]):
        fuse = Fuse()
        loop = armed_loop(run, irb140, fuse, frozenset(PARTS))
        at = int(rng.choice([k for k, other in enumerate(names, 1) if other == name]))
        fuse.kind, fuse.lit = KINDS[place % len(KINDS)], lambda count, at=at: count == at
        assert sorted(until_done(loop, irb140, fuse)) == NAMES, name
        assert fuse.burnt == [name]


@settings(max_examples=some(3, of=8), deadline=None)
@given(
    st.frozensets(st.sampled_from(PARTS), min_size=1),
    st.floats(0.0, 1.0),
    st.integers(1, 400),
    st.sampled_from(KINDS),
)
def test_raises_without_end_advance_once_and_lose_no_event(
    run: Any, irb140: Any, parts: frozenset[str], share: float, lasting: int, kind: type[Exception]
) -> None:
    """Many calls in a row raise, those of braking among them; any parts are armed, the others take the quick way."""
    fuse = Fuse()
    loop = armed_loop(run, irb140, fuse, parts)
    start = int(share * 1000)
    fuse.kind, fuse.lit = kind, lambda count: start <= count < start + lasting
    assert sorted(until_done(loop, irb140, fuse)) == NAMES


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_who_ends_the_program_ends_it_and_nothing_has_moved(run: Any, irb140: Any, stop: type[BaseException]) -> None:
    """The tick did not happen: the next one follows the last one."""
    fuse = Fuse()
    loop = armed_loop(run, irb140, fuse, frozenset(PARTS))
    names, _ = called(run, irb140)
    rng, count = np.random.default_rng(3), 0
    fuse.kind = stop  # type: ignore[assignment]
    fuse.lit = lambda count: rng.random() < 0.04
    tip = irb140.pose("tcp", irb140.home)[:3, 3]
    for k in range(TICKS):
        try:
            loop.step(tip[None] + [0.16, 0.02, 0.0] if 12 <= k < 18 else np.empty((0, 3)))
        except stop:
            count += 1
    assert count > 10
    assert len(names) > 700


def test_an_error_of_tasks_off_their_path_is_told_as_it_was(run: Any, irb140: Any) -> None:
    """What a tick says stays what it was, whatever the trajectory does afterwards, the task's own arrays included."""
    shift = SimpleNamespace(y=0.0)
    pose = irb140.pose("tcp", irb140.home)

    class Moody:
        def sample(self, t: float) -> Sample:
            pose[1, 3] = shift.y
            return Sample(pose, np.zeros(6))  # the same array every time

    class Reusing(qpsafe.PositionTask):
        buffer = np.empty(3)

        def error(self, value: np.ndarray, sample: Any) -> np.ndarray:
            self.buffer[:] = super().error(value, sample)
            return self.buffer

    for kind in (qpsafe.PositionTask, Reusing):
        shift.y = 0.0
        loop = run(tasks=[kind("tcp", Moody())])
        tip = irb140.pose("tcp", irb140.home)[:3, 3]
        told, phases = [], set()
        for k in range(120):
            tick = loop.step(tip[None] + [0.16, 0.02, 0.0] if 5 <= k < 40 else np.empty((0, 3)))
            phases.add(tick.phase)
            late = k % 2  # looked at now and later, or later only
            told.append((tick, None if late else [error.copy() for error in tick.errors]))
        texts = [str(tick) for tick, _ in told]
        lates = [[error.copy() for error in tick.errors] for tick, _ in told]
        shift.y = 0.7
        loop.step()
        assert phases == {"following", "suspended", "recovering"}
        for (tick, errors), text, late in zip(told, texts, lates, strict=True):
            assert str(tick) == text
            assert all(np.array_equal(a, b) for a, b in zip(tick.errors, errors or late, strict=True))
            assert np.linalg.norm(tick.errors[0]) < 0.4


@settings(max_examples=some(8, of=40), deadline=None)
@given(
    st.lists(st.integers(0, 12), min_size=1, max_size=6),
    st.lists(st.tuples(st.integers(0, 14), st.sampled_from(["away and back", "a copy", "another", "the same"]))),
)
def test_no_exchange_of_tasks_makes_an_event_happen_twice(
    irb140: Any, times: list[int], exchanges: list[tuple[int, str]]
) -> None:
    """The clock stands exactly on events, at rest or not, while tasks are taken away and put back."""
    pose = irb140.pose("tcp", irb140.home)

    class Still:
        def __init__(self) -> None:
            self.events = [Event(0.004 * time, f"{k}") for k, time in enumerate(sorted(times))]

        def sample(self, t: float) -> Sample:
            return Sample(pose, np.zeros(6))

        def event(self, k: int) -> Event | None:
            return self.events[k] if k < len(self.events) else None

    path = Still()
    here = [qpsafe.PositionTask("tcp", path)]
    there = [qpsafe.PositionTask("tcp", qpsafe.FixedPose(pose))]
    controller = qpsafe.SafetyController(irb140, here, spots=None)
    found: list[str] = []
    for k in range(20):
        found += controller.step(irb140.home, np.zeros(6), points=[]).events
        for when, what in exchanges:
            if when == k:
                if what == "away and back":
                    controller.set_tasks(there)
                if what == "another":
                    controller.set_tasks([qpsafe.OrientationTask("tcp", path)])
                controller.set_tasks([qpsafe.PositionTask("tcp", Still())] if what == "a copy" else here)
    assert sorted(found) == sorted(str(k) for k in range(len(times)))


def test_tasks_whose_events_cannot_be_read_leave_the_old_ones(run: Any, irb140: Any) -> None:
    class Broken(qpsafe.FixedPose):
        def event(self, k: int) -> Event | None:
            raise OSError("the program's file is gone")

    loop = run()
    loop.step()
    controller = loop.controller
    before = controller.tasks, controller.activation, controller.recovery.tasks, controller.recovery.clocks
    with pytest.raises(OSError, match="gone"):
        controller.set_tasks([qpsafe.PositionTask("tcp", Broken(irb140.pose("tcp", irb140.home)))])
    assert before == (controller.tasks, controller.activation, controller.recovery.tasks, controller.recovery.clocks)
    assert loop.step().status == "ok"
