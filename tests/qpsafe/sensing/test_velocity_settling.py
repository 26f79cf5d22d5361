"""What a spot has only just seen: nobody knows whether it comes, so the evasion has no friction until that is known."""

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.evasion import Evasion
from qpsafe.sensing.velocity import SETTLING, ApproachVelocity, unsettled

DT = 0.004


@given(seen=st.lists(st.tuples(st.booleans(), st.floats(0.0, 0.3)), min_size=1, max_size=30))
@settings(deadline=None, max_examples=some(30, of=200))
def test_one_spot_that_has_only_just_seen_something_is_enough(seen: list[tuple[bool, float]]) -> None:
    track = ApproachVelocity(len(seen), DT).track
    assert not unsettled(track)  # nothing in sight
    for row, (sees, time) in zip(track, seen, strict=True):
        row[0], row[-1] = 0.5 if sees else np.nan, time
    assert unsettled(track) == any(sees and time < SETTLING for sees, time in seen)


@pytest.mark.parametrize("seed", range(3))
def test_friction_counts_when_the_estimate_has_settled(seed: int) -> None:
    """Beside an evasion without friction: the same to the bit until `SETTLING`, at rest or slower from then on."""
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(seed)
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    own = Evasion.for_robot(robot, DT)
    plain = Evasion(own.mass, own.damping, robot.nq, DT)
    rubbed, free = (qpsafe.SafetyController(robot, tasks, evasion=evasion) for evasion in (None, plain))
    q, qd = robot.home, np.zeros(robot.nq)

    def ticks(distances: np.ndarray) -> tuple[Any, Any]:
        return tuple(controller.step(q, qd, distances) for controller in (rubbed, free))  # type: ignore[return-value]

    nobody, somebody = np.full(20, np.inf), np.full(20, np.inf)
    somebody[rng.integers(20)] = rng.uniform(0.25, 0.5)
    ticks(nobody)
    known = round(SETTLING / DT)  # the first sight is tick 0 and tells nothing yet
    for k in range(2 * known):
        a, b = ticks(somebody)
        if k < known:
            assert (a.qd0 == b.qd0).all()
        elif k > known:
            assert (np.abs(a.qd0) <= np.abs(b.qd0)).all()
            assert (a.qd0 != b.qd0).any()
