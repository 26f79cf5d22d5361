"""References that never jump: braking, giving way and following, within the limits from any seed."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5.shaper import Shaper
from qpsafe.limits import JointLimits

DT, N = 0.004, 2
V_MAX, A_MAX = np.array([3.0, 1.0]), np.array([10.0, 6.0])
LIMITS = JointLimits(np.full(N, -1.0), np.full(N, 1.0), V_MAX, A_MAX, DT)


def shaper(q: float = 0.0) -> Shaper:
    made = Shaper(LIMITS, ramp_in=0.02, ramp_out=0.05, catch_up=0.5)
    made.seed(np.full(N, q))
    return made


ORDERS = st.tuples(
    st.sampled_from(["follow", "brake", "settle"]), st.floats(-2.0, 2.0), st.floats(-9.0, 9.0), st.integers(1, 30)
)


@settings(max_examples=some(25, of=150))
@given(seed=st.floats(-1.3, 1.3), orders=st.lists(ORDERS, max_size=12))
def test_no_step_leaves_the_limits_whatever_is_asked(seed: float, orders: list) -> None:
    made = shaper(seed)
    inside = abs(seed) <= 1.0
    for order, q, qd, times in orders:
        for _ in range(times):
            before, speed = made.q, made.qd
            if order == "follow":
                made.follow(np.full(N, q), np.full(N, qd))
            elif order == "settle":
                made.settle(np.full(N, q))
            else:
                made.brake()
            assert (np.abs(made.qd) <= V_MAX * (1 + 1e-12)).all()
            assert (np.abs(made.qd - speed) <= A_MAX * DT * (1 + 1e-9)).all()
            assert np.array_equal(made.q, before + made.qd * DT)
            assert not inside or (np.abs(made.q) <= 1.0 + 1e-9).all()


def test_braking_again_after_going_on_takes_its_time_again() -> None:
    made = shaper()
    q = np.zeros(N)
    for _ in range(2):
        for _ in range(60):
            q = q + np.array([0.4, 0.2]) * DT
            made.follow(made.q + np.array([0.4, 0.2]) * DT, np.array([0.4, 0.2]))
        speed = made.qd.copy()
        for k in range(1, 7):  # of 13 ticks
            assert not made.brake()
            assert np.allclose(made.qd, speed * (1 - k / 13.0), rtol=1e-12)


def test_braking_ends_at_rest_and_stays() -> None:
    made = shaper()
    for _ in range(100):
        made.follow(made.q + 0.8 * DT, np.full(N, 0.8))
    ticks = 0
    while not made.brake():
        ticks += 1
    assert ticks + 1 == np.ceil(max(0.05 / DT, (np.abs([0.8, 0.8]) / (A_MAX * DT)).max()))
    at = made.q
    assert made.brake()
    assert np.array_equal(made.q, at)


@pytest.mark.parametrize("seed", [1.2, -1.2])
def test_a_robot_found_outside_its_limits_is_not_moved_by_braking(seed: float) -> None:
    made = shaper(seed)
    for _ in range(10):
        assert made.brake()
    assert np.array_equal(made.q, np.full(N, seed))


@pytest.mark.parametrize("goal", [0.9, -0.3, 0.001, 1e-7])
def test_giving_way_arrives_without_overshoot(goal: float) -> None:
    made = shaper()
    target = np.array([goal, -goal])
    distances = []
    for _ in range(1500):
        made.settle(target)
        distances.append(target - made.q)
    left = np.array(distances) * np.sign(target)
    assert (left >= -1e-12).all()
    assert (np.diff(left, axis=0) <= 1e-12).all()
    assert np.allclose(made.q, target, rtol=0, atol=1e-12)
    assert not made.qd.any()


@pytest.mark.parametrize("speed", [0.05, -0.2])
def test_ramping_in_is_exact_without_catching_up(speed: float) -> None:
    made = Shaper(LIMITS, ramp_in=0.4, ramp_out=0.05, catch_up=1e-9)
    made.seed(np.zeros(N))
    q, qd = np.zeros(N), np.full(N, speed)
    for _ in range(150):
        q = q + qd * DT
        made.follow(q, qd)
        assert not made.clipped
        assert np.allclose(made.q, made.weight * q, rtol=0, atol=1e-12)  # seed + w (q - seed)
    assert made.weight == 1.0


def test_giving_way_keeps_half_the_acceleration_for_braking() -> None:
    made = shaper()
    speeds = [np.zeros(N)]
    for _ in range(1500):
        made.settle(np.array([0.9, -0.9]))
        speeds.append(np.abs(made.qd))
    slower = -np.diff(speeds, axis=0)
    assert (slower <= 0.5 * A_MAX * DT * (1.0 + 1e-9)).all()
    assert (slower.max(axis=0) > 0.4 * A_MAX * DT).all()  # and no less than it may


def test_a_source_that_was_left_behind_is_caught_up_with() -> None:
    made = shaper()
    q, qd = np.zeros(N), np.full(N, 0.1)
    behind = []
    for k in range(900):
        q = q + qd * DT
        if 100 <= k < 150:
            made.brake()
        else:
            made.follow(q, qd)
        behind.append(q - made.q)
    assert np.max(behind) > 0.01
    assert np.allclose(made.q, q, rtol=0, atol=1e-12)
    assert np.min(behind) >= -1e-12
