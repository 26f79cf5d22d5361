"""What comes from another process is as good as what was made here: the same bits, tick by tick.

The type of an array that was unpickled is equal to that of others but is another object.
"""

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe

pytestmark = pytest.mark.long

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


PAPER: Any = {"evasion": "paper", "recovery": qpsafe.RecoveryRules.paper()}  # it is soon on its way back


def made(robot: Any, law: Any, way: Any = lambda thing: thing) -> Any:
    here = qpsafe.FixedPose(way(robot.pose("tcp", robot.home)))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    limits = qpsafe.JointLimits(*map(way, (robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration)))
    return qpsafe.SafetyController(robot, tasks, law, limits=limits, barrier=qpsafe.DangerBarrier(10.5), **PAPER)


def same(ones: list[Any], others: list[Any]) -> None:
    for one, other in zip(ones, others, strict=True):
        assert one.reference == other.reference
        assert (one.status, one.messages, one.phase) == (other.status, other.messages, other.phase)
        assert np.array_equal(one.cdf_n, other.cdf_n, equal_nan=True)


@pytest.fixture(scope="module", params=LAWS)
def law(request: pytest.FixtureRequest) -> Any:
    return LAWS[request.param]


@pytest.fixture(scope="module")
def whole(irb140: Any, law: Any) -> list[Any]:
    """All ticks of a controller that stays."""
    return drive(made(irb140, law), 0, 125, irb140.home, np.zeros(6))


@pytest.fixture(scope="module", params=first(1, [45, 7, 65]))
def part(irb140: Any, law: Any, request: pytest.FixtureRequest) -> tuple[Any, int, Any]:
    """A controller that is about to leave: nobody may drive it on; after how many ticks; its last reference."""
    controller = made(irb140, law)
    return controller, request.param, drive(controller, 0, request.param, irb140.home, np.zeros(6))[-1].reference


@pytest.mark.parametrize("way", WAYS)
def test_a_controller_that_travels_goes_on_to_the_last_bit(
    whole: list[Any], part: tuple[Any, int, Any], way: str
) -> None:
    controller, cut, last = part
    same(drive(WAYS[way](controller), cut, cut + 60, last.q, last.qd), whole[cut : cut + 60])


def test_measurements_and_references_may_come_from_another_process(irb140: Any, law: Any, whole: list[Any]) -> None:
    there, expected = made(irb140, law, WAYS["pickle"]), whole[:90]
    assert {tick.phase for tick in expected} == {"following", "suspended", "recovering"}
    same(drive(there, 0, 90, irb140.home, np.zeros(6), WAYS["pickle"]), expected)
