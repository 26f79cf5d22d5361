"""What comes from another process is as good as what was made here: the same bits, tick by tick.

The type of an array that was unpickled is equal to that of others but is another object.
"""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import qpsafe

WAYS: dict[str, Any] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
    "both": lambda thing: pickle.loads(pickle.dumps(copy.deepcopy(thing))),
}
LAWS: dict[str, Any] = {"own solver": None, "null space": qpsafe.NullspaceLaw(), "weighted": qpsafe.WeightedLaw()}


def drive(controller: Any, first: int, last: int, q: Any, qd: Any, way: Any = lambda thing: thing) -> list[Any]:
    """A hand that comes and goes, in points and in distances."""
    ticks, tip = [], controller.robot.pose("tcp", controller.robot.home)[:3, 3]
    for k in range(first, last):
        near = 0.08 + 0.004 * (k % 60)
        hand, readings = tip + np.array([[near, 0.02, 0.0]]), np.where(np.arange(20) % 7 == 3, near + 0.6, np.inf)
        seen = {"points": way(hand)} if 10 <= k % 60 < 25 else {"distances": way(readings)}
        ticks.append(controller.step(way(q), way(qd), **seen))
        q, qd = ticks[-1].reference.q, ticks[-1].reference.qd
    return ticks


def made(robot: Any, law: Any, way: Any = lambda thing: thing) -> Any:
    here = qpsafe.FixedPose(way(robot.pose("tcp", robot.home)))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    limits = qpsafe.JointLimits(*map(way, (robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration)))
    return qpsafe.SafetyController(robot, tasks, law, limits=limits, barrier=qpsafe.DangerBarrier(10.5))


def same(ones: list[Any], others: list[Any]) -> None:
    for one, other in zip(ones, others, strict=True):
        assert one.reference == other.reference
        assert (one.status, one.messages, one.phase) == (other.status, other.messages, other.phase)
        assert np.array_equal(one.cdf_n, other.cdf_n, equal_nan=True)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("cut", [7, 45, 65])
def test_a_controller_that_travels_goes_on_to_the_last_bit(irb140: Any, law: str, way: str, cut: int) -> None:
    whole, part = made(irb140, LAWS[law]), made(irb140, LAWS[law])
    expected = drive(whole, 0, cut + 60, irb140.home, np.zeros(6))
    last = drive(part, 0, cut, irb140.home, np.zeros(6))[-1].reference
    same(drive(WAYS[way](part), cut, cut + 60, last.q, last.qd), expected[cut:])


@pytest.mark.parametrize("law", LAWS)
def test_measurements_and_references_may_come_from_another_process(irb140: Any, law: str) -> None:
    here, there = made(irb140, LAWS[law]), made(irb140, LAWS[law], WAYS["pickle"])
    expected = drive(here, 0, 90, irb140.home, np.zeros(6))
    assert {tick.phase for tick in expected} == {"following", "suspended", "recovering"}
    same(drive(there, 0, 90, irb140.home, np.zeros(6), WAYS["pickle"]), expected)
