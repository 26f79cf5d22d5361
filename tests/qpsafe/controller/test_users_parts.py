"""Parts and input of a user's that change, call back, or answer what none may: told, within limits, never a crash."""

from __future__ import annotations

import copy
import gc
import pickle
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.activation import Switching
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.sensing.units import UnitWatch

N, THRESHOLDS = 6, robot_thresholds(qpsafe.load_robot("irb140"))


def made(robot: Any, law: Any = None, **parts: Any) -> qpsafe.SafetyController:
    goal = robot.pose("tcp", robot.home)
    goal[0, 3] += 0.1
    here = qpsafe.FixedPose(goal)
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    return qpsafe.SafetyController(robot, tasks, law, **parts)


class Calls(qpsafe.HierarchicalLaw):
    """Calls the controller that it works for, in some ticks."""

    def __init__(self, again: set[int]) -> None:
        super().__init__()
        object.__setattr__(self, "again", again)
        object.__setattr__(self, "state", {"tick": 0, "controller": None})

    def solve(self, problem: Any) -> Any:
        self.state["tick"] += 1
        if self.state["tick"] in self.again:
            robot = self.state["controller"].robot
            self.state["controller"].step(robot.home, np.zeros(N), points=[])
        return super().solve(problem)


@given(st.sets(st.integers(1, 40), min_size=1, max_size=6))
def test_a_part_that_calls_step_is_told_and_no_tick_is_integrated_twice(irb140: Any, again: set[int]) -> None:
    law = Calls(again)
    controller = made(irb140, law)
    law.state["controller"] = controller
    ticks = [controller.step(irb140.home, np.zeros(N), points=[]) for _ in range(40)]
    assert {k + 1 for k, tick in enumerate(ticks) if tick.status == "fault"} == again
    assert all("a tick is being made" in ticks[k - 1].messages[0] for k in again)
    for before, after in pairwise(ticks):
        assert after.reference.seq == before.reference.seq + 1
        np.testing.assert_allclose(after.reference.q, before.reference.q + 0.004 * after.reference.qd, atol=1e-12)


class Answers(qpsafe.Activation):
    """Activations of a user's own."""

    answer: tuple[float, ...] = ()

    def at(self, cdf_n: float) -> Switching:
        return Switching((1.0, 1.0), self.answer, "low")


@pytest.mark.parametrize(
    "answer",
    [(np.nan, np.nan), (1.0, np.nan), (1.0,), (), (1.0, 1.0, 1.0), (2.0, 1.0), (0.2, 0.9), (1.0, -0.1), (np.inf, 0.0)],
)
def test_activations_that_are_none_are_a_fault_and_the_robot_stands(irb140: Any, answer: tuple[float, ...]) -> None:
    kind = type("Own", (Answers,), {"answer": answer})
    controller = made(irb140, activation=kind(THRESHOLDS))
    for _ in range(5):
        tick = controller.step(irb140.home, np.zeros(N), points=[])
        assert tick.status == "fault"
        assert "activations" in tick.messages[0]
        assert not tick.reference.qd.any()


@pytest.mark.parametrize("answer", [(1.0, 1.0), (1.0, 0.0), (0.4, 0.4), (0.0, 0.0)])
def test_activations_of_a_users_own_count(irb140: Any, answer: tuple[float, ...]) -> None:
    kind = type("Own", (Answers,), {"answer": answer})
    controller = made(irb140, activation=kind(THRESHOLDS))
    tick = controller.step(irb140.home, np.zeros(N), points=[])
    assert (tick.status, tuple(tick.activations)) == ("ok", answer)


class Grows:
    """Something with as many numbers as are wanted, and other ones when it is read again."""

    def __init__(self, second: Any) -> None:
        self.second, self.reads = second, 0

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        self.reads += 1
        if self.reads > 1 and isinstance(self.second, Exception):
            raise self.second
        return np.asarray(np.full(20, 9.0) if self.reads == 1 else self.second, dtype=float)


@pytest.mark.parametrize(
    "second",
    [np.full(10**6, 50.0), np.full(21, 50.0), np.zeros(0), np.zeros((20, 3)), np.float64(50.0), ValueError("gone")],
)
def test_input_that_changes_while_it_is_read_harms_nobody(irb140: Any, second: Any) -> None:
    """The watch over units reads again what a tick has accepted, every so often."""
    controller = made(irb140)
    watch = UnitWatch(qpsafe.load_spots(irb140), 0.004)
    for k in range(60):
        tick = controller.step(irb140.home, np.zeros(N), Grows(second))
        assert (tick.status, tick.messages) == ("ok", ()), k
        given_ = Grows(second)
        given_.reads = 1
        assert watch.notes(given_, None) == ()


def test_what_is_carried_is_what_was_given(irb140: Any) -> None:
    """The caller's own dictionary and lists may change afterwards."""
    things = [qpsafe.Obstacle.box("screw", (0.01, 0.01, 0.05), (0.0, 0.0, 0.03))]
    carried: dict[str, Any] = {"tcp": things}
    controller, other = made(irb140, carried=carried), made(irb140, carried={"tcp": list(things)})
    things.clear()
    carried["tcp"] = 3
    carried["nowhere"] = 4
    for one in (controller, other):
        one.gate = VerifiedMotion(person_speed=2.0)
        one.clearance = None
    for _ in range(20):
        a, b = (one.step(irb140.home, np.zeros(N), points=[]) for one in (controller, other))
        assert a.status == "ok"
        assert a.reference == b.reference
    assert list(controller.carried) == ["tcp"]


def test_what_remembers_is_of_one_controller_alone(irb140: Any) -> None:
    """One would be moved by what the other one sees. It is free again once that is gone, or has another."""
    evasion = qpsafe.Evasion(2.0, 10.0, N)
    first, second = made(irb140, evasion=evasion), made(irb140)
    with pytest.raises(qpsafe.ConfigurationError, match="evasion"):
        made(irb140, evasion=evasion)
    with pytest.raises(qpsafe.ConfigurationError, match="evasion"):
        second.evasion = evasion
    with pytest.raises(qpsafe.ConfigurationError, match="evasion"):
        DangerMonitor(irb140, 0.004, evasion=evasion)
    monitor = DangerMonitor(irb140, 0.004, evasion=qpsafe.Evasion(2.0, 10.0, N))
    with pytest.raises(qpsafe.ConfigurationError, match="evasion"):
        second.evasion = monitor.evasion
    first.evasion = evasion  # its own
    for one in (copy.deepcopy(first), copy.copy(first), pickle.loads(pickle.dumps(first))):
        one.step(irb140.home, np.zeros(N), points=[])
    first.evasion = None
    second.evasion = evasion
    del second
    gc.collect()
    third = made(irb140, evasion=evasion)
    assert third.evasion is evasion


class Copies(Calls):
    """Copies the controller that it works for within a tick."""

    def solve(self, problem: Any) -> Any:
        self.state["copies"] = [copy.deepcopy(self.state["controller"]), copy.copy(self.state["controller"])]
        return qpsafe.HierarchicalLaw.solve(self, problem)


def test_a_copy_made_within_a_tick_can_make_ticks(irb140: Any) -> None:
    law = Copies(set())
    controller = made(irb140, law)
    law.state["controller"] = controller
    controller.step(irb140.home, np.zeros(N), points=[])
    for one in law.state["copies"]:
        assert one.step(irb140.home, np.zeros(N), points=[]).status == "ok"
