"""One robot's compiled tick against `SafetyController.step`, tick by tick."""

from typing import Any

import numpy as np

import qpsafe
from qpsafe.batch import code
from qpsafe.batch.pack import new_state, new_work, own_of, pack
from qpsafe.batch.tick_kernel import tick
from qpsafe.recovery.steps import PHASES


def test_points_that_come_and_go_give_the_same_bits(irb140: Any) -> None:
    """Approach, suspension, recovery, bad joints in between: the same command, danger, phase and status."""
    goal = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    controller = qpsafe.SafetyController(
        irb140, [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    )
    packed = pack(controller)
    state, work = new_state(packed, 1), new_work(packed, points=1)
    own = own_of(packed, state.floats[0], state.integers[0])
    place = irb140.pose("tcp", irb140.home)[:3, 3]
    q, qd, phases, statuses = np.array(irb140.home), np.zeros(6), set(), set()
    for k in range(500):
        away = 0.9 - 0.004 * k if k < 180 else 0.18 + 0.02 * (k - 180)
        points = place + np.array([[away, 0.02, 0.05]]) if away < 0.9 else np.zeros((0, 3))
        measured = q if k not in (150, 151, 300) else q * np.nan
        told = controller.step(measured, qd, points=points)
        none = np.zeros(0)
        status = tick(
            *packed.blocks, state.floats[0], state.integers[0], state.spots[0], *work, measured, qd, none, none, points,
            code.POINTS,
        )  # fmt: skip
        q, qd = told.reference.q, told.reference.qd
        assert own.q.tobytes() == q.tobytes()
        assert own.qd.tobytes() == qd.tobytes()
        assert own.qd0.tobytes() == told.qd0.tobytes()
        assert own.result.tobytes() == np.array((told.cdf_n, told.m, told.f)).tobytes()
        assert (PHASES[own.marks[code.PHASE]], ("ok", "degraded", "bad_input", "fault")[status]) == (
            told.phase,
            told.status,
        )
        phases.add(told.phase)
        statuses.add(told.status)
    assert phases == {"following", "suspended", "recovering"}
    assert statuses == {"ok", "bad_input"}


def test_what_does_not_fit_the_blocks_is_refused(irb140: Any) -> None:
    """More points than there is room for, or another number of distances: nothing is written elsewhere."""
    goal = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    packed = pack(qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", goal)]))
    state, work = new_state(packed, 1), new_work(packed, points=2)
    own, room, none = own_of(packed, state.floats[0], state.integers[0]), work[1][0], np.zeros(0)
    row, rest = (state.floats[0], state.integers[0], state.spots[0]), np.zeros(6)
    for points, distances, ages, how in (
        (np.ones((room + 1, 3)), none, none, code.POINTS),
        (np.zeros((0, 3)), np.full(21, np.inf), np.zeros(20), code.DISTANCES),
        (np.zeros((0, 3)), np.full(20, np.inf), np.zeros(1), code.DISTANCES),
    ):
        assert tick(*packed.blocks, *row, *work, irb140.home, rest, distances, ages, points, how) == code.BAD_INPUT
        assert own.marks[code.REASON] == code.WRONG_SIZE
        assert not own.qd.any()
