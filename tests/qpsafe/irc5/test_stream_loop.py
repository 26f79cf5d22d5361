"""The loop between robot and controller in simulated time: when it stops the robot, and what lets it go on."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np
import pytest

import qpsafe
from qpsafe.irc5.loop import LoopRules, StreamLoop, gate
from qpsafe.irc5.messages import RobotPacket, decode_sensor, encode_robot
from qpsafe.irc5.session import Phase
from qpsafe.irc5.supervisor import State, StopCategory
from qpsafe.sim.irc5.controller import IdealBody, SimulatedIrc5
from qpsafe.sim.irc5.in_process import ROBOT_ADDRESS, Here

pytestmark = pytest.mark.long

FREE = np.full(20, np.inf)


class Cell:
    """A robot that is to move its tool by some centimetres, and everything between."""

    def __init__(self, rules: LoopRules | None = None, shift: float = 0.05) -> None:
        self.robot = qpsafe.load_robot("irb140")
        goal = self.robot.pose("tcp", self.robot.home)
        goal[1, 3] += shift
        task = qpsafe.PositionTask("tcp", qpsafe.FixedPose(goal))
        self.here = Here(qpsafe.SafetyController(self.robot, [task]), rules)
        self.irc5 = SimulatedIrc5(IdealBody(self.robot.home))
        self.distances = FREE.copy()
        self.answers: list = []

    @property
    def state(self) -> State:
        return self.here.loop.supervisor.state

    def run(self, cycles: int, until: Callable[[], bool] = lambda: False) -> int:
        """Some cycles in lock-step; how many were run."""
        for k in range(cycles):
            if until():
                return k
            packet = self.irc5.packet()
            sent = [] if packet is None else [(encode_robot(packet), ROBOT_ADDRESS)]
            found = [decode_sensor(data, 6) for data in self.here.receive(sent, self.distances)]
            self.answers += found
            if packet is not None:
                self.irc5.take(found)
            self.irc5.advance()
        return cycles

    def causes(self) -> str:
        return " | ".join(self.here.loop.supervisor.causes)


@pytest.fixture
def cell() -> Cell:
    cell = Cell()
    cell.run(200)
    assert cell.state is State.RUNNING
    return cell


def test_from_idle_to_running_and_to_the_goal(cell: Cell) -> None:
    states = [t.after for t in cell.here.loop.supervisor.log]
    assert states == [State.SEEDING, State.RUNNING]
    cell.run(800)
    goal = cell.robot.pose("tcp", cell.robot.home)[1, 3] + 0.05
    assert abs(cell.robot.pose("tcp", cell.irc5.body.q)[1, 3] - goal) < 1e-3


def test_before_the_first_distances_the_robot_is_held() -> None:
    cell = Cell()
    session, loop = cell.here.loop.session, cell.here.loop
    for k in range(50):
        packet = RobotPacket(k, 4 * k, cell.robot.home, clock=1.0 + 0.004 * k)
        session.offer(encode_robot(packet), ROBOT_ADDRESS, 0.004 * k)
        cycle = session.take()
        assert cycle is not None
        assert loop.step(cycle, np.full(20, np.nan), np.full(20, np.inf)) is None
        answer = decode_sensor(session.answer(None) or b"", 6)
        assert np.allclose(answer.q_ref, cell.robot.home, atol=1e-12)
        assert (answer.qd_ref == 0.0).all()
    assert cell.state is State.SEEDING
    assert not loop.supervisor.causes


def test_the_robots_own_stop_is_lifted_by_its_own_start(cell: Cell) -> None:
    cell.irc5.motors(False)
    cell.run(2)
    assert cell.state is State.STOPPED
    assert "motors off" in cell.causes()
    cell.run(100)
    assert (cell.answers[-1].q_ref == cell.answers[-2].q_ref).all()
    cell.irc5.motors(True)
    cell.run(5)
    assert cell.state is State.SEEDING
    cell.run(200)
    assert cell.state is State.RUNNING


def test_with_manual_acknowledgement_it_is_not() -> None:
    cell = Cell(LoopRules(manual=True))
    cell.run(200)
    cell.irc5.restart()
    cell.run(300)
    assert cell.state is State.STOPPED
    held = cell.answers[-1].q_ref
    assert cell.here.loop.acknowledge()
    cell.run(300)
    assert cell.state is State.RUNNING
    assert not np.allclose(cell.answers[-1].q_ref, held, atol=1e-6)


def test_a_restart_during_another_stop_does_not_lift_it(cell: Cell) -> None:
    cell.here.loop.stop(StopCategory.CONTROLLED_AND_HELD, "operator")
    cell.run(100)
    cell.irc5.restart()
    cell.run(300)
    assert cell.state is State.STOPPED
    assert cell.here.loop.session.phase is Phase.STOPPED


@pytest.mark.parametrize(("share", "state"), [(1, State.DEGRADED), (20, State.STOPPED)])
def test_sick_sensors_degrade_or_stop_until_acknowledged(cell: Cell, share: int, state: State) -> None:
    cell.distances[:share] = np.nan
    cell.run(200)
    assert cell.state is state
    assert "controller" in cell.causes()
    cell.distances[:] = np.inf
    cell.run(100)
    assert cell.state is state  # not by itself
    assert cell.here.loop.acknowledge()
    cell.run(300)
    assert cell.state is State.RUNNING
    assert cell.here.loop.controller.sensing is not None
    assert cell.here.loop.controller.sensing.health.severity == "clear"


def test_acknowledging_what_is_still_wrong_stops_again(cell: Cell) -> None:
    cell.distances[:] = np.nan
    cell.run(200)
    stopped_at = cell.irc5.body.q.copy()
    for _ in range(3):
        assert cell.here.loop.acknowledge()
        cell.run(100)
        assert cell.state is State.STOPPED
    assert np.abs(cell.irc5.body.q - stopped_at).max() < 1e-3


def test_a_silent_robot_stops_the_stream_until_it_starts_anew(cell: Cell) -> None:
    now = cell.here.loop
    for _ in range(30):
        cell.here.receive([], None)
    assert cell.state is State.STOPPING  # it cannot be braked before it listens again
    assert "silent" in cell.causes()
    cell.run(100)  # back on the line, as if nothing had been: that is no start
    assert cell.state is State.STOPPED
    cell.irc5.restart()
    cell.run(300)
    assert now.supervisor.state is State.RUNNING


@pytest.mark.parametrize("category", StopCategory)
def test_leaving_brakes_first_and_is_silent_then(category: StopCategory) -> None:
    cell = Cell(shift=0.3)
    cell.run(150)
    limits = cell.here.loop.session.limits
    assert np.abs(cell.answers[-1].qd_ref).max() > 0.05  # on the way
    before = len(cell.answers)
    cell.here.loop.stop(category, "leaving")
    cell.run(400)
    tail = cell.answers[before - 1 :]
    steps = np.diff([a.qd_ref for a in tail], axis=0)
    assert (np.abs(steps) <= limits.max_acceleration * limits.dt * (1.0 + 1e-6)).all()
    if category is StopCategory.IMMEDIATE:
        assert len(tail) == 1
    else:
        assert (tail[-1].qd_ref == 0.0).all()
        assert cell.state is State.STOPPED
        assert cell.here.loop.over == (category is StopCategory.CONTROLLED_THEN_SILENT)
        assert (len(tail) == 401) == (category is StopCategory.CONTROLLED_AND_HELD)


class OnFire(qpsafe.HierarchicalLaw):
    """A law that fails; being no built-in one, it is asked itself, not compiled code that was made of it."""

    def solve(self, *_: object, **__: object) -> NoReturn:
        raise RuntimeError("law on fire")


def test_a_controller_that_fails_stops_the_robot(cell: Cell) -> None:
    cell.here.loop.controller.law = OnFire()
    cell.run(100)
    assert cell.state is State.STOPPED
    assert "law on fire" in cell.causes()


def test_a_robot_that_slides_is_not_streamed_as_angles(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(cell.robot.__dict__, "sliding", np.array([True, False, False, False, False, False]))
    with pytest.raises(qpsafe.ConfigurationError, match=r"joint_1.*angles"):
        StreamLoop(cell.here.loop.controller, cell.here.loop.session)


def test_the_gate_names_what_is_closed() -> None:
    packet = RobotPacket(0, 0, np.zeros(6), motors_on=False, mci="error", rapid="stopped")
    assert gate(packet) == ["motors off", "motion control error", "RAPID stopped"]
    assert gate(RobotPacket(0, 0, np.zeros(6))) == []


def test_wrong_rules_are_named() -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="silence"):
        LoopRules(silence=float("nan"))
