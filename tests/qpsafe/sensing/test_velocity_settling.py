"""What a spot has only just seen: nobody knows whether it comes, so the evasion has no friction until that is known."""

from typing import Any

import numpy as np
import pytest
from amounts import first, some
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


def controllers(robot: Any, dt: float = DT, hold: float = 0.15) -> tuple[Any, Any]:
    """One with the default evasion, one without friction."""
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    own = Evasion.for_robot(robot, dt)
    plain = Evasion(own.mass, own.damping, robot.nq, dt)
    sensing = qpsafe.SensingRules(hold_time=hold)
    made = [qpsafe.SafetyController(robot, tasks, evasion=e, sensing=sensing, dt=dt) for e in (None, plain)]
    return made[0], made[1]


def alike(pair: tuple[Any, Any], distances: np.ndarray) -> bool:
    """One tick at home of both: whether friction changes nothing; what it changes is less, never more."""
    robot = pair[0].robot
    a, b = (one.step(robot.home, np.zeros(robot.nq), distances).qd0 for one in pair)
    assert (np.abs(a) <= np.abs(b)).all()
    return bool((a == b).all())


@pytest.mark.parametrize("dt", [0.001, 0.002, 0.004, 0.005, 0.01, 0.02])
@pytest.mark.parametrize("seed", first(1, range(3)))
def test_friction_counts_when_the_estimate_has_settled(seed: int, dt: float) -> None:
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(seed)
    pair, seen = controllers(robot, dt), np.full(20, np.inf)
    assert alike(pair, seen)
    seen[rng.integers(20)] = rng.uniform(0.25, 0.5)
    known = round(SETTLING / dt)  # the first sight is tick 0 and tells nothing yet
    assert [alike(pair, seen) for _ in range(known + 5)] == [True] * known + [False] * 5


@pytest.mark.parametrize("seed", first(1, range(4)))
def test_somebody_who_comes_before_somebody_else_is_new(seed: int) -> None:
    """A hand before a torso: the reading jumps, and nobody knows how fast the hand is."""
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(seed)
    pair, seen, spot = controllers(robot), np.full(20, np.inf), rng.integers(20)
    seen[spot] = rng.uniform(0.5, 0.7)
    assert not all(alike(pair, seen) for _ in range(2 * round(SETTLING / DT)))  # until friction counts
    for one in pair:  # friction stops both alike
        one.evasion.reset()
    seen[spot] -= rng.uniform(0.06, 0.2)
    assert all(alike(pair, seen) for _ in range(round(SETTLING / DT)))
    assert not alike(pair, seen)


@pytest.mark.parametrize("seed", first(1, range(4)))
def test_what_is_lost_for_a_moment_is_not_new_when_it_is_back(seed: int) -> None:
    """Something at the end of the range flickers; somebody who was forgotten is new."""
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(seed)
    pair, seen, nobody = controllers(robot), np.full(20, np.inf), np.full(20, np.inf)
    seen[rng.integers(20)] = rng.uniform(0.3, 0.6)
    assert not all(alike(pair, seen) for _ in range(2 * round(SETTLING / DT)))  # until friction counts
    for lost, new in ((5, False), (60, True)):  # held for 0.15 s, 38 ticks
        for _ in range(lost):
            alike(pair, nobody)
        for one in pair:
            one.evasion.reset()
        assert alike(pair, seen) == new
