"""One robot's compiled tick with the laws beside the strict one, against `SafetyController.step`."""

from typing import Any

import numpy as np
import pytest
from amounts import crossed

import qpsafe
from qpsafe.batch import blocks, code, cuts
from qpsafe.batch.pack import new_state, new_work, pack, why_not
from qpsafe.batch.tick_kernel import tick
from qpsafe.danger.thresholds import robot_activation

LAWS = {
    "paper": qpsafe.HierarchicalLaw("paper", damping=0.02, damping_time=0.04),
    "null space": qpsafe.NullspaceLaw(),
    "weighted": qpsafe.WeightedLaw(200.0),
    "weights": qpsafe.WeightedLaw(weights=(1e4, 1e3, 1.0)),
}


def tasks_of(robot: Any) -> list[Any]:
    """All tools stay where they are, over how they are turned."""
    goals = {frame: qpsafe.FixedPose(robot.pose(frame, robot.home)) for frame in robot.tool_frames}
    return [kind(*goal) for kind in (qpsafe.PositionTask, qpsafe.OrientationTask) for goal in goals.items()]


@pytest.mark.parametrize(("name", "law"), crossed(["irb140", "iiwa14"], LAWS))
def test_every_law_gives_the_same_bits(name: str, law: str) -> None:
    """Approach, suspension, recovery, a stand, bad joints in between: commands, danger, errors and status."""
    robot = qpsafe.load_robot(name)
    controller = qpsafe.SafetyController(robot, tasks_of(robot), LAWS[law])
    packed = pack(controller)
    state, work = new_state(packed, 1), new_work(packed, points=1)
    integers = packed.blocks[1]
    own = cuts.own(state.floats[0], state.integers[0], integers[code.HEADS + blocks.SHARED :][: blocks.OWN], integers)
    place = robot.pose(robot.tool_frames[0], robot.home)[:3, 3]
    q, qd, statuses, none, moved = np.array(robot.home), np.zeros(robot.nq), set(), np.zeros(0), 0.0
    for k in range(260):
        away = abs(0.9 - 0.006 * k) + 0.12
        points = place + np.array([[away, 0.02, 0.05]]) if away < 0.9 else np.zeros((0, 3))
        measured = q if k not in (90, 91, 200) else q * np.nan
        told = controller.step(measured, qd, points=points)
        status = tick(
            *packed.blocks, state.floats[0], state.integers[0], state.spots[0], *work, measured, qd, none, none, points,
            code.POINTS,
        )  # fmt: skip
        q, qd = told.reference.q, told.reference.qd
        assert own.qd.tobytes() == qd.tobytes()
        assert own.q.tobytes() == q.tobytes()
        assert own.qd0.tobytes() == told.qd0.tobytes()
        assert ("ok", "degraded", "bad_input", "fault")[status] == told.status
        statuses.add(told.status)
        moved = max(moved, np.abs(qd).max())
    assert moved > 0.05
    assert statuses >= {"ok", "bad_input"}


def test_what_a_law_exceeds_is_clipped_and_said_alike(irb140: Any) -> None:
    """The null-space law in narrow limits: degraded in the same ticks."""
    slow = qpsafe.JointLimits(irb140.lower, irb140.upper, np.full(6, 0.05), np.full(6, 1.0))
    controller = qpsafe.SafetyController(irb140, tasks_of(irb140), qpsafe.NullspaceLaw(), limits=slow)
    packed = pack(controller)
    state, work = new_state(packed, 1), new_work(packed, points=1)
    q, qd, none, clipped = np.array(irb140.home), np.zeros(6), np.zeros(0), 0
    points = irb140.pose("tcp", irb140.home)[:3, 3] + np.array([[0.2, 0.02, 0.05]])
    for _ in range(60):
        told = controller.step(q, qd, points=points)
        status = tick(
            *packed.blocks, state.floats[0], state.integers[0], state.spots[0], *work, q, qd, none, none, points,
            code.POINTS,
        )  # fmt: skip
        assert (status == code.DEGRADED) == (told.status == "degraded")
        clipped += any("clipped" in message for message in told.messages)
        q, qd = told.reference.q, told.reference.qd
    assert clipped > 5


def test_both_arms_in_one_weighted_level() -> None:
    """More rows in one level than joints: memory of the solver is large enough for it."""
    robot = qpsafe.load_robot("irb14000")
    count = len(robot.tool_frames)
    for law in (qpsafe.WeightedLaw(20.0), qpsafe.HierarchicalLaw("paper"), qpsafe.NullspaceLaw()):
        controller = qpsafe.SafetyController(
            robot, tasks_of(robot), law, activation=robot_activation(robot, count, count)
        )
        packed = pack(controller)
        state, work = new_state(packed, 1), new_work(packed, points=1)
        q, qd, none = np.array(robot.home), np.zeros(robot.nq), np.zeros(0)
        for k in range(40):
            points = robot.pose(robot.tool_frames[0], q)[:3, 3] + np.array([[0.5 - 0.01 * k, 0.1, 0.0]])
            told = controller.step(q, qd, points=points)
            tick(
                *packed.blocks, state.floats[0], state.integers[0], state.spots[0], *work, q, qd, none, none, points,
                code.POINTS,
            )  # fmt: skip
            q, qd = told.reference.q, told.reference.qd
            assert state.floats[0][packed.own.q].tobytes() == q.tobytes()


def test_laws_that_cannot_be_compiled_are_named(irb140: Any) -> None:
    class Own(qpsafe.NullspaceLaw):
        pass

    reasons = {
        "the law is of another making": [Own()],
        "the law has another solver than the own one": [
            qpsafe.WeightedLaw(solver="daqp"), qpsafe.HierarchicalLaw("paper", solver="daqp"),
        ],
        "": [*LAWS.values(), qpsafe.HierarchicalLaw()],
    }  # fmt: skip
    for reason, laws in reasons.items():
        for law in laws:
            assert why_not(qpsafe.SafetyController(irb140, tasks_of(irb140), law)) == reason
