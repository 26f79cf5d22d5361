"""On the way back the joints use a share of their acceleration, unless a position limit asks for more."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.limits import JointLimits
from qpsafe.recovery.recovery import RECOVERING, SUSPENDED, RecoveryRules
from qpsafe.recovery.returns import GentleLimits

LAWS = {
    "strict": qpsafe.HierarchicalLaw,
    "paper": lambda: qpsafe.HierarchicalLaw("paper"),
    "weighted": qpsafe.WeightedLaw,
    "nullspace": qpsafe.NullspaceLaw,
}
OTHERS = [key for key in LAWS if key != "strict"]


def braked_way(speed: float, deceleration: float, dt: float) -> float:
    """How far a joint goes that is braked as hard as allowed in every tick."""
    way = 0.0
    while speed > 0.0:
        way += speed * dt
        speed -= deceleration * dt
    return way


def near_a_limit(robot: Any, q: np.ndarray, qd: np.ndarray, share: float, dt: float) -> bool:
    """Whether a joint could not stop before its position limit with the share."""
    room = np.where(qd > 0.0, robot.upper - q, q - robot.lower)
    ways = [braked_way(abs(v), share * a, dt) for v, a in zip(qd, robot.max_acceleration, strict=True)]
    return bool((np.array(ways) > room + 1e-12).any())


@pytest.mark.parametrize(
    ("key", "share"),
    first(
        2,
        [("strict", 0.2), ("weighted", 0.5), *((k, 0.5) for k in LAWS if k != "weighted"), *((k, 0.2) for k in OTHERS)],
    ),
)
def test_accelerations_stay_under_their_share_whatever_danger_does(
    run: Any, irb140: Any, key: str, share: float
) -> None:
    """People who come and go at once, so that danger jumps while the robot is on its way back, too.

    Gate and clearance are off: where these hold the robot all there is is used.
    """
    loop = run(LAWS[key](), recovery=replace(RecoveryRules.paper(), acceleration=share), gate="off", clearance="off")
    rng, dt, largest, hardest = np.random.default_rng(3), loop.controller.dt, 0.0, 0.0
    tip = irb140.pose("tcp", irb140.home)[:3, 3]
    points: np.ndarray = np.zeros((0, 3))
    for tick in range(some(600, of=1500)):
        if tick % 50 == 0:  # near, in between, or gone
            far = rng.choice((0.15, 0.3, 0.45))
            points = tip + far * rng.uniform(0.3, 1.0, (rng.integers(0, 3), 3)) * (1.0, 1.0, 0.5)
        q, qd = loop.q, loop.qd
        done = loop.step(points)
        phase, gated = done.phase, bool(done.gate.cause)  # the gate brakes with all there is
        step = float((np.abs(loop.qd - qd) / (irb140.max_acceleration * dt)).max())
        if phase == RECOVERING and not gated and not near_a_limit(irb140, q, qd, share, dt):
            largest = max(largest, step)
        elif phase == SUSPENDED:
            hardest = max(hardest, step)
    assert 0.9 * share < largest <= share + 1e-9  # it was needed, and it held
    assert hardest > share + 0.1  # while danger is high nothing is held back


def test_no_limit_is_passed_when_limits_turn_gentle_at_any_moment() -> None:
    """Many joints, wild commands, gentle and whole limits in turn: position limits are obeyed as with whole ones."""
    rng, n, dt = np.random.default_rng(1), some(200, of=1000), 0.004
    lower = rng.uniform(-3.0, 0.0, n)
    upper = lower + rng.uniform(0.01, 4.0, n)
    velocity, acceleration = rng.uniform(0.2, 8.0, n), rng.uniform(1.0, 60.0, n)
    joints = [JointLimits(*(x[k : k + 1] for x in (lower, upper, velocity, acceleration)), dt) for k in range(n)]
    q, qd, gentle = rng.uniform(lower, upper), np.zeros(n), [GentleLimits(0.3) for _ in joints]
    exceptions, push = 0, np.zeros(n)
    for tick in range(120):
        if tick % 17 == 0:
            push = rng.normal(size=n) * 10.0
        soft = rng.random() < 0.5
        for k, limits in enumerate(joints):
            here, speed = q[k : k + 1], qd[k : k + 1]
            now = gentle[k].choose(limits, here, speed, np.zeros(1)) if soft else limits
            exceptions += soft and now is limits
            box = now.box(here, speed)
            assert not box.sacrificed.any()
            qd[k] = box.clip(push[k : k + 1])[0]
        q = q + qd * dt
        assert (q >= lower - 1e-12).all()
        assert (q <= upper + 1e-12).all()
    assert exceptions > 0.1 * n  # joints that had to be braked harder than the share allows


def test_the_whole_share_changes_nothing(run: Any, irb140: Any) -> None:
    tip = irb140.pose("tcp", irb140.home)[:3, 3]
    loops = [run(recovery=RecoveryRules(acceleration=1.0)) for _ in range(2)]
    loops[1].controller._gentle.choose = lambda limits, *state: limits
    for tick in range(300):
        points = tip[None] + [0.15, 0.02, 0.05] if tick % 100 < 40 else np.zeros((0, 3))
        assert np.array_equal(loops[0].step(points).reference.qd, loops[1].step(points).reference.qd)


def test_limits_of_somebodys_own_are_left_alone(irb140: Any) -> None:
    class Own(JointLimits):
        """Knows something that scaling would not respect."""

    own = Own(irb140.lower, irb140.upper, irb140.max_velocity, irb140.max_acceleration)
    assert GentleLimits(0.5).choose(own, irb140.home, np.zeros(6), np.zeros(6)) is own


def test_more_than_the_whole_acceleration_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="acceleration") as caught:
        RecoveryRules(acceleration=1.5)
    assert caught.value.value == 1.5
