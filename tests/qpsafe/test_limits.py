"""Joint limits that can always be met (derivations, section 4)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.limits import JointLimits, stopping_speed

DT = 0.004


def way_to_stop(v: float, a: float, dt: float) -> float:
    """Distance covered when v is reduced by a dt every tick: simulated, not by formula."""
    way = 0.0
    while v > 0.0:
        way += v * dt
        v -= a * dt
    return way


@given(st.floats(1e-9, 10.0), st.floats(0.5, 50.0))
def test_stopping_speed_is_exact(s: float, a: float) -> None:
    v = stopping_speed(s, a, DT)
    assert way_to_stop(v, a, DT) == pytest.approx(s, rel=1e-9, abs=1e-12)


@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.5, 50.0))
def test_stopping_speed_rises_with_the_distance(s1: float, s2: float, a: float) -> None:
    near, far = sorted((s1, s2))
    assert stopping_speed(near, a, DT) <= stopping_speed(far, a, DT) + 1e-12


def random_limits(rng: np.random.Generator, n: int) -> JointLimits:
    lower = rng.uniform(-3.0, 0.0, n)
    upper = lower + rng.uniform(0.01, 4.0, n)
    return JointLimits(lower, upper, rng.uniform(0.2, 8.0, n), rng.uniform(1.0, 60.0, n), DT)


def test_no_limit_is_ever_passed_in_a_million_random_ticks() -> None:
    """1,000 joints of random limits, 1,000 ticks of wild commands; a tenth of the joints start outside."""
    rng, n = np.random.default_rng(1), 1000
    limits = random_limits(rng, n)
    q = rng.uniform(limits.lower, limits.upper)
    outside = rng.random(n) < 0.1
    q[outside] = limits.upper[outside] + rng.uniform(1e-6, 0.5, outside.sum())
    qd, passed_before = np.zeros(n), outside.copy()
    for tick in range(1000):
        if tick % 17 == 0:
            push = rng.normal(size=n) * rng.choice((0.1, 5.0, 100.0), n)
        box = limits.box(q, qd)
        assert (box.lower <= box.upper).all()
        assert not box.sacrificed[~passed_before].any()
        command = box.clip(push)
        assert (np.abs(command - qd) <= limits.max_acceleration * DT + 1e-12).all()
        assert (np.abs(command) <= limits.max_velocity).all()
        q, qd = q + command * DT, command
        inside = (q >= limits.lower - 1e-12) & (q <= limits.upper + 1e-12)
        assert inside[~passed_before].all()  # whoever was inside once stays inside
        passed_before &= ~inside
    assert passed_before.mean() < outside.mean()  # and those outside come back


def test_jerk_is_limited_wherever_the_other_limits_leave_room() -> None:
    rng, n = np.random.default_rng(2), 200
    base = random_limits(rng, n)
    jerk = base.max_acceleration / 0.05
    limits = JointLimits(base.lower, base.upper, base.max_velocity, base.max_acceleration, DT, max_jerk=jerk)
    q, qd, qdd = rng.uniform(limits.lower, limits.upper), np.zeros(n), np.zeros(n)
    kept = 0
    for tick in range(400):
        if tick % 29 == 0:
            push = rng.normal(size=n)
        box, plain = limits.box(q, qd, qdd), base.box(q, qd)
        assert (box.lower <= box.upper).all()
        assert (box.lower >= plain.lower).all()  # it only narrows
        assert (box.upper <= plain.upper).all()
        command = box.clip(push)
        new = (command - qd) / DT
        smooth = np.abs(new - qdd) <= jerk * DT * (1 + 1e-9) + 1e-9
        assert (smooth | (box.sacrificed == 4)).all()
        kept += smooth.sum()
        q, qd, qdd = q + command * DT, command, new
        assert (q >= limits.lower - 1e-12).all()
        assert (q <= limits.upper + 1e-12).all()
    assert kept > 0.9 * 400 * n


def test_a_start_outside_comes_back_at_bounded_speed() -> None:
    """200 joints, from just outside to 1 rad, at any speed, pushed outwards by the law all the time."""
    rng, n = np.random.default_rng(5), 200
    limits = JointLimits(*(np.full(n, x) for x in (-1.0, 1.0, 3.0, 20.0)), DT, return_speed=0.1)
    side = rng.choice((-1.0, 1.0), n)
    q, qd = side * (1.0 + 10.0 ** rng.uniform(-3.0, 0.0, n)), rng.uniform(-6.0, 6.0, n)
    settled = np.zeros(n, dtype=bool)
    for _ in range(6000):
        box = limits.box(q, qd)
        assert (box.lower <= box.upper).all()
        command = box.clip(side * 100.0)
        assert (np.abs(command - qd) <= 20.0 * DT + 1e-12).all()
        q, qd = q + command * DT, command
        settled = np.abs(q) <= 1.0 + 1e-9
        slow = (np.abs(qd) <= 0.1 + 1e-12) & ~settled
        assert ((qd * side <= 1e-12) | (box.sacrificed == 1))[slow].all()
    assert settled.all()


def test_sacrifice_goes_position_first_then_velocity_and_is_named() -> None:
    limits = JointLimits([-1.0, -1.0], [1.0, 1.0], [1.0, 1.0], [10.0, 10.0], DT)
    box = limits.box(np.array([0.999, 0.0]), np.array([0.9, 1.5]))
    assert box.notes(("a", "b")) == ("a: position limit sacrificed", "b: velocity limit sacrificed")
    assert box.upper == pytest.approx([0.86, 1.46])  # both brake as hard as the acceleration limit allows


def test_binding_limits_are_named() -> None:
    limits = JointLimits([-1.0, -np.inf, -1.0], [1.0, np.inf, 1.0], [1.0, 1.0, 5.0], [10.0, 1000.0, 10.0], DT)
    box = limits.box(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    found = box.binding(box.upper, ("a", "b", "c"))
    assert found == ("a: upper position", "b: upper velocity", "c: upper acceleration")


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"lower": [2.0]}, "lower"),
        ({"upper": [np.nan]}, "lower"),
        ({"max_velocity": [0.0]}, "max_velocity"),
        ({"max_velocity": [1.0, 1.0]}, "max_velocity"),
        ({"max_acceleration": [np.inf]}, "max_acceleration"),
        ({"dt": 0.0}, "dt"),
        ({"max_jerk": [-1.0]}, "max_jerk"),
    ],
)
def test_wrong_limits_are_refused_by_name(change: dict, key: str) -> None:
    values = {"lower": [-1.0], "upper": [1.0], "max_velocity": [1.0], "max_acceleration": [1.0]} | change
    with pytest.raises(ConfigurationError) as caught:
        JointLimits(**values)
    assert caught.value.key == key


def test_a_jerk_limit_never_hides_what_else_gave_way() -> None:
    """Of all limits that cannot be met the most important one is named: jerk only where nothing else gave way."""
    rng, n = np.random.default_rng(8), 2000
    base = random_limits(rng, n)
    v, a = base.max_velocity, base.max_acceleration
    limits = JointLimits(base.lower, base.upper, v, a, DT, max_jerk=rng.uniform(1.0, 100.0, n) * a)
    q, qd, qdd = rng.uniform(base.lower - 0.1, base.upper + 0.1), rng.uniform(-2.0, 2.0, n) * v, rng.normal(size=n) * a
    plain, smooth = base.box(q, qd).sacrificed, limits.box(q, qd, qdd).sacrificed
    assert (smooth[plain > 0] == plain[plain > 0]).all()
    assert set(smooth[plain == 0]) == {0, 4}


def test_controller_gives_the_jerk_limit_the_last_acceleration() -> None:
    """A point appears before the tool: the commanded acceleration rises by at most jerk dt from tick to tick."""
    import qpsafe

    robot = qpsafe.load_robot("irb140")
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    jerk = robot.max_acceleration / 0.02
    limits = JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, DT, max_jerk=jerk)
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    controller = qpsafe.SafetyController(robot, tasks, limits=limits)
    q, qd = robot.home, [np.zeros(6)]
    for _ in range(60):
        tick = controller.step(q, qd[-1], points=[here.pose[:3, 3] + [0.25, 0.0, 0.0]])
        q, qd = tick.reference.q, [*qd, tick.reference.qd]
    qdd = np.diff(np.array(qd), axis=0) / DT
    assert np.abs(qdd).max() > 1.0  # it does move
    assert (np.abs(np.diff(qdd, axis=0)) <= jerk * DT * (1.0 + 1e-9) + 1e-6).all()
