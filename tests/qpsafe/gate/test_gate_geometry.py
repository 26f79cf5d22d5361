"""What the gate measures by: the braking path, capsules around hulls, levers of joints."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

import qpsafe
from qpsafe.gate.braking_path import braked, covered, ticks_of
from qpsafe.gate.capsules import capsules_of
from qpsafe.gate.levers import levers
from qpsafe.gate.pack import robot_capsules
from qpsafe.gate.people_kernel import measure_all
from qpsafe.sensing.body import body_hulls

DT = 0.004
_covered = njit(lambda v, a, dt, t: covered(v, a, dt, t))
_braked = njit(lambda v, a, dt, k: braked(v, a, dt, k))
_ticks = njit(lambda v, a, dt: ticks_of(v, a, dt))

speeds = st.one_of(st.floats(-7.0, 7.0), st.integers(-40, 40).map(float))


@given(v=speeds, a=st.floats(2.0, 60.0), whole=st.booleans(), share=st.floats(0.0, 1.3))
def test_the_way_in_closed_form_is_that_of_braking_tick_by_tick(v: float, a: float, whole: bool, share: float) -> None:
    v = v * a * DT if whole else v  # a whole number of decrements, too
    ticks, speed, ways = _ticks(v, a, DT), v, [0.0]
    for k in range(ticks + 3):
        assert _braked(v, a, DT, float(k)) == pytest.approx(speed, abs=1e-9)
        ways.append(ways[-1] + speed * DT)
        speed -= min(max(speed, -a * DT), a * DT)
    assert abs(speed) < 1e-9
    time = share * (ticks + 3) * DT
    expected = np.interp(time, np.arange(len(ways)) * DT, ways)
    assert _covered(v, a, DT, time) == pytest.approx(float(expected), abs=1e-9)
    assert _covered(v, a, DT, 1e9) == pytest.approx(ways[-1], abs=1e-9)


@pytest.mark.parametrize("name", ["irb140", "iiwa14", "irb14000"])
def test_capsules_contain_the_collision_geometry(name: str, plays: Any) -> None:
    robot = qpsafe.load_robot(name)
    hulls, capsules = body_hulls(robot), robot_capsules(robot)
    assert set(capsules.bodies.tolist()) == {body for body, _, _ in hulls if body > 0}
    rng = np.random.default_rng(0)
    q = rng.uniform(np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0))
    poses = robot.at(q).body_poses()
    for body, hull_name, vertices in hulls:
        if body == 0:
            continue
        shares = rng.dirichlet(np.full(len(vertices), 0.3), 200)
        points = np.vstack((vertices, shares @ vertices)) @ poses[body][:3, :3].T + poses[body][:3, 3]
        mine = np.array([n == hull_name for n in capsules.names]) & (capsules.bodies == body)
        inside = plays.to_axes(robot, q, points)[mine] - capsules.radii[mine, None]
        assert inside.min(axis=0).max() < 1e-9, hull_name


@given(seed=st.integers(0, 2**31), long=st.floats(0.02, 1.0))
def test_what_a_capsule_adds_is_told_and_it_is_in_few_pieces(seed: int, long: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (30, 3)) * (long, 0.1, 0.06)
    made = capsules_of([(1, "hull", points), (0, "base", points)])
    assert set(made.bodies.tolist()) == {1}
    middle = 0.5 * (made.ends[:, 0] + made.ends[:, 1])
    assert (made.adds > -1e-9).all()
    assert len(made.radii) <= 4
    assert (np.linalg.norm(middle, axis=1) < long + 0.1).all()


@pytest.mark.parametrize("name", ["irb140", "iiwa14", "irb14000"])
def test_no_joint_moves_a_point_faster_than_its_lever(name: str) -> None:
    robot, rng = qpsafe.load_robot(name), np.random.default_rng(1)
    used = np.zeros(robot.nq)
    for _ in range(60):
        body = int(rng.integers(1, robot.nq + 1))
        point = rng.uniform(-0.3, 0.3, 3)
        bound = levers(robot, body, point[None])
        q, step = rng.uniform(robot.lower, robot.upper), 1e-6
        here = robot.at(q).body_poses()[body]
        for j in range(robot.nq):
            moved = q.copy()
            moved[j] += step
            there = robot.at(moved).body_poses()[body]
            speed = float(np.linalg.norm((there - here)[:3, :3] @ point + (there - here)[:3, 3])) / step
            assert speed <= bound[j] + 1e-5
            used[j] = max(used[j], speed / bound[j] if bound[j] > 0.0 else 0.0)
    assert (used > 0.3).all()  # no bound is a mere large number


_distances = njit(lambda axes, points, away: measure_all(axes, points, away))
_coordinate = st.one_of(st.floats(-3.0, 3.0), st.sampled_from([np.nan, np.inf, -np.inf, 0.0]))
_place = st.tuples(_coordinate, _coordinate, _coordinate)


@given(
    points=st.lists(_place, min_size=1, max_size=20),
    ends=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=2, max_size=2),
)
def test_distances_are_those_of_single_points_and_what_is_nowhere_is_not_near_and_not_far(
    points: list[Any], ends: list[Any]
) -> None:
    axes, seen = np.array([ends, [ends[0], ends[0]]]), np.array(points)
    away = np.full(len(axes) * len(seen) + 3, -1.0)
    _distances(axes, seen, away)
    assert (away[len(axes) * len(seen) :] == -1.0).all()
    for axis, found in zip(axes, away[:-3].reshape(len(axes), -1), strict=True):
        d = axis[1] - axis[0]
        for p, distance in zip(seen, found, strict=True):
            if np.isfinite(p).all():
                s = np.clip((p - axis[0]) @ d / (d @ d), 0.0, 1.0) if d @ d > 0.0 else 0.0
                assert distance == pytest.approx(float(np.linalg.norm(p - axis[0] - s * d)), abs=1e-12)
                continue
            assert not distance < np.inf
            with np.errstate(invalid="ignore"):
                along = (p - axis[0]) * d
                nowhere = np.isnan(p).any() or (d @ d > 0.0 and np.isnan(along.sum()))
            assert np.isnan(distance) or not nowhere
