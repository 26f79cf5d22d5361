"""Rows that keep shapes apart: what they are made of, what has none, and that a joint obeying them stops in time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.geometry.clearance import ClearanceLimit
from qpsafe.geometry.measure import nearest_of, pairs_of
from qpsafe.geometry.never import never_nearer
from qpsafe.geometry.reach import braking_way
from qpsafe.geometry.solids import Solids
from qpsafe.limits import JointLimits, stopping_speed
from qpsafe.sensing.hulls import Obstacle

FLOOR = Obstacle.box("floor", (6.0, 6.0, 0.5), (0.0, 0.0, -0.25))
POST = Obstacle.box("post", (0.1, 0.1, 0.6), (0.5, 0.3, 0.3))


@pytest.fixture(scope="module", params=qpsafe.bundled_robots())
def made(request: pytest.FixtureRequest) -> Any:
    robot = qpsafe.load_robot(request.param)
    return robot, Solids.of(robot, [FLOOR, POST])


def number(solids: Solids, names: tuple[str, str]) -> Any:
    return pairs_of([(solids.names.index(names[0]), solids.names.index(names[1]))])


def test_rows_are_the_rate_of_the_distance(made: Any) -> None:
    """g = -∂d/∂q, by differences of the distance of the whole shapes; and no row is nearer than these."""
    robot, solids = made
    limit, limits = ClearanceLimit(robot, solids, margin=0.08), JointLimits.of(robot)
    rng, h, compared = np.random.default_rng(0), 1e-6, 0
    for _ in range(12):
        q = robot.home + rng.uniform(-0.7, 0.7, robot.nq)
        level = limit.level(robot.at(q), np.zeros(robot.nq), limits)
        if level is None:
            continue
        for names in set(level.pairs):
            pair = number(solids, names)
            rows = [k for k, other in enumerate(level.pairs) if other == names]
            nearest = min(rows, key=lambda k: level.gaps[k])
            here = nearest_of(solids.solid, robot.at(q).body_poses(), pair)
            assert (level.gaps[rows] >= here.distance - 1e-9).all()
            if level.gaps[nearest] > here.distance + 1e-9 or here.distance < 1e-3:
                continue  # overlapping, or there was no room for this one
            for j in range(robot.nq):
                e = h * np.eye(robot.nq)[j]
                before, after = (nearest_of(solids.solid, robot.at(q + s * e).body_poses(), pair) for s in (-1.0, 1.0))
                if abs(after.distance + before.distance - 2.0 * here.distance) < 1e-10:  # no corner in between
                    rate = (after.distance - before.distance) / (2.0 * h)
                    assert level.A[nearest, j] == pytest.approx(-rate, abs=2e-4)
                    compared += 1
    assert compared > 20


def test_at_rest_at_home_there_is_no_row(made: Any) -> None:
    robot, solids = made
    limit, limits = ClearanceLimit(robot, solids), JointLimits.of(robot)
    assert limit.level(robot.at(robot.home), np.zeros(robot.nq), limits) is None


def test_what_has_no_row_stays_clear_when_the_robot_brakes(made: Any) -> None:
    """From any command of the next tick; up to what levers grow by while joints turn."""
    robot, solids = made
    limit, limits = ClearanceLimit(robot, solids), JointLimits.of(robot)
    rng, dt, looked = np.random.default_rng(1), limits.dt, 0
    pairs = np.vstack((solids.furniture, solids.own))
    for _ in range(60):
        q, qd = (
            robot.home + rng.uniform(-1.0, 1.0, robot.nq),
            0.4 * rng.uniform(-1.0, 1.0, robot.nq) * robot.max_velocity,
        )
        if nearest_of(solids.solid, robot.at(q).body_poses(), pairs, 0.1).distance < limit.margin:
            continue
        level = limit.level(robot.at(q), qd, limits)
        with_row = set() if level is None else set(level.pairs)
        free = pairs_of(
            p for p in map(tuple, pairs.tolist()) if (solids.names[p[0]], solids.names[p[1]]) not in with_row
        )
        v = qd + rng.uniform(-1.0, 1.0, robot.nq) * robot.max_acceleration * dt
        while np.abs(v).max() > 0.0:
            q = q + v * dt
            v = np.sign(v) * np.maximum(np.abs(v) - robot.max_acceleration * dt, 0.0)
        assert nearest_of(solids.solid, robot.at(q).body_poses(), free, 0.1).distance > limit.margin - 1e-3
        looked += 1
    assert looked > 20


def test_a_joint_that_obeys_stops_at_the_margin() -> None:
    """The shoulder, driven at the post as fast as its rows let it, from any posture of the others. Up to what the row
    turns by while the arm brakes: half a millimetre at 0.4 of the joint's velocity."""
    robot = qpsafe.load_robot("irb140")
    solids = Solids.of(robot, [POST])
    limit, limits = ClearanceLimit(robot, solids), JointLimits.of(robot)
    rng, arrived = np.random.default_rng(3), 0
    for _ in range(8):
        q, qd = robot.home.copy(), np.zeros(6)
        q[0], q[1], q[2] = -0.5, *rng.uniform((0.1, -0.4), (0.6, 0.3))
        for _ in range(500):
            level = limit.level(robot.at(q), qd, limits)
            v = min(qd[0] + robot.max_acceleration[0] * limits.dt, 0.4 * robot.max_velocity[0])
            if level is not None:
                ahead = level.A[:, 0] > 1e-9
                v = min(v, (level.upper[ahead] / level.A[ahead, 0]).min(initial=np.inf))
            qd[0] = max(v, qd[0] - robot.max_acceleration[0] * limits.dt)  # rows turn while the arm does
            q = q + qd * limits.dt
            gap = nearest_of(solids.solid, robot.at(q).body_poses(), solids.furniture).distance
            assert gap > limit.margin - 1e-3
        arrived += qd[0] < 1e-3 and gap < limit.margin + 1e-3
    assert arrived >= 5


def test_pairs_that_never_meet_never_meet(made: Any) -> None:
    robot, solids = made
    never = never_nearer(solids, robot, 0.004)
    assert len(never) > 20
    rng, pairs = np.random.default_rng(2), pairs_of(sorted(never))
    low, high = (np.where(np.isfinite(x), x, s * np.pi) for x, s in ((robot.lower, -1.0), (robot.upper, 1.0)))
    for _ in range(400):
        poses = robot.at(rng.uniform(low, high)).body_poses()
        assert nearest_of(solids.solid, poses, pairs, 0.05).distance > 0.004


@given(st.floats(1e-9, 10.0), st.floats(0.01, 100.0), st.floats(1e-3, 0.05))
def test_braking_takes_the_way_that_the_stopping_speed_is_for(s: float, a: float, dt: float) -> None:
    way = braking_way.py_func
    v = stopping_speed(s, a, dt)
    assert way(v, a, dt, np.inf) == pytest.approx(s, rel=1e-9)
    by_ticks = [way(v, a, dt, float(m)) for m in range(1, 12)]
    assert by_ticks[0] == pytest.approx(v * dt)
    assert (np.diff(by_ticks) >= -1e-12 * s).all()
    assert by_ticks[-1] <= s * (1.0 + 1e-9)


def test_shapes_that_overlap_are_led_apart(made: Any) -> None:
    """From inside a thing, at the rows' own speed, with whatever the rows ask for and no more."""
    robot, _ = made
    place = robot.pose(robot.tool_frames[0], robot.home)[:3, 3]
    solids = Solids.of(robot, [Obstacle.box("thing", (0.05, 0.05, 0.05), place + np.array([0.0, 0.0, 10.0]))])
    inside = Solids.of(robot, [Obstacle.box("thing", (0.05, 0.05, 0.05), place)])
    # the same shapes, the thing where the tool is: such a pair would be left out as mounted so
    moved = Solids(**{**inside.__dict__, "furniture": solids.furniture})
    limit, limits = ClearanceLimit(robot, moved), JointLimits.of(robot)
    q, qd = robot.home.copy(), np.zeros(robot.nq)
    before = nearest_of(moved.solid, robot.at(q).body_poses(), moved.furniture).distance
    for _ in range(400):
        level = limit.level(robot.at(q), qd, limits)
        box = limits.box(q, qd)
        qd = qpsafe.solve_hierarchy([] if level is None else [level], box.lower, box.upper).qd
        q = q + qd * limits.dt
        assert np.isfinite(q).all()
    after = nearest_of(moved.solid, robot.at(q).body_poses(), moved.furniture).distance
    assert before < 0.0
    assert after > before + 0.01


def test_rounding_does_not_decide_what_a_row_allows(made: Any) -> None:
    """Speeds that are whole ticks of braking, joints that stand, ways that are as far after many times: where what is
    chosen from a list would jump."""
    robot, solids = made
    limit, limits = ClearanceLimit(robot, solids, margin=0.02), JointLimits.of(robot)
    rng, steps, compared = np.random.default_rng(5), robot.max_acceleration * limits.dt, 0
    for _ in range(150):
        q = robot.home + rng.uniform(-0.7, 0.7, robot.nq)
        qd = steps * rng.integers(-8, 9, robot.nq) * rng.integers(0, 2, robot.nq)
        rows = limit.level(robot.at(q), qd, limits)
        if rows is None:
            continue
        near = limit.level(robot.at(q), qd + 1e-15 * rng.uniform(-1.0, 1.0, robot.nq), limits)
        assert near is not None
        for k, (pair, gap) in enumerate(zip(rows.pairs, rows.gaps, strict=True)):
            if gap < 1e-6:
                continue
            same = [
                j for j, other in enumerate(near.pairs) if other == pair and np.allclose(near.A[j], rows.A[k], 0, 1e-9)
            ]
            assert same, (pair, gap)
            assert np.abs(near.upper[same] - rows.upper[k]).min() < 1e-9
            compared += 1
    assert compared > 30


@given(st.floats(0.0, 5.0), st.floats(0.01, 100.0), st.floats(0.0, 200.0))
def test_the_way_of_braking_does_not_jump(v: float, a: float, ticks: float) -> None:
    way, dt = braking_way.py_func, 0.004
    for tick in (ticks, np.floor(ticks)):
        for speed in (v, np.floor(v / (a * dt)) * a * dt):
            here = way(speed, a, dt, tick)
            most = 1e-9 * (speed * dt + dt * tick)
            assert way(speed, a, dt, tick + 1e-9) == pytest.approx(here, abs=2.0 * most + 1e-12)
            assert way(speed + 1e-9, a, dt, tick) == pytest.approx(here, abs=2.0 * most + 1e-12)


@pytest.mark.parametrize("margin", [-0.001, np.nan, np.inf, "wide"])
def test_a_margin_that_is_none_is_refused(made: Any, margin: Any) -> None:
    robot, solids = made
    with pytest.raises(qpsafe.ConfigurationError, match="margin"):
        ClearanceLimit(robot, solids, margin=margin)
    with pytest.raises(qpsafe.ConfigurationError, match="solids"):
        ClearanceLimit(robot, [FLOOR])  # type: ignore[arg-type]


def test_what_is_near_at_home_may_come_half_as_near(made: Any) -> None:
    """Two links 10 to 33 mm apart at home, and a margin of 50 mm: the robot at home is left alone."""
    robot, solids = made
    limit = ClearanceLimit(robot, solids, margin=0.05)
    home = nearest_of(solids.solid, robot.at(robot.home).body_poses(), solids.own).distance
    assert home < 0.05
    level = limit.level(robot.at(robot.home), np.zeros(robot.nq), JointLimits.of(robot))
    assert level is None or (level.upper >= 0.0).all()


def test_controllers_of_a_cell_share_its_tables_and_nobody_gets_anothers(made: Any) -> None:
    robot, solids = made
    other = qpsafe.load_robot(robot.name)
    for margin in (0.004, 0.1, 0.004):
        limit, again = ClearanceLimit(robot, solids, margin), ClearanceLimit(robot, solids, margin)
        assert again.blocks is limit.blocks
        fresh = ClearanceLimit(other, Solids.of(other, [FLOOR, POST]), margin)
        assert all(np.array_equal(a, b) for a, b in zip(limit.blocks, fresh.blocks, strict=True))
