"""No link approaches what is seen faster than v_max of its distance: rows against differences, theorems of the tick."""

from functools import cache

import numpy as np
import pytest
from amounts import crossed, first, some
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import qpsafe
from qpsafe.danger.link_parts import LinkParts
from qpsafe.danger.separation import Separation
from qpsafe.danger.separation_limit import MOST, SeparationLimit, kept_apart, nearest_first, oldest
from qpsafe.errors import ConfigurationError
from qpsafe.gate.pack import robot_capsules
from qpsafe.limits import JointLimits

ROBOTS = {name: qpsafe.load_robot(name) for name in ("irb140", "iiwa14", "irb14000")}
ROBOT = ROBOTS["irb140"]
LAWS = {
    "strict": qpsafe.HierarchicalLaw(),
    "paper": qpsafe.HierarchicalLaw(projection="paper"),
    "weighted": qpsafe.WeightedLaw(),
    "nullspace": qpsafe.NullspaceLaw(),
}
DT = 0.004


@cache
def parts_of(name):
    capsules = robot_capsules(ROBOTS[name])
    return LinkParts(capsules.names, np.repeat(capsules.bodies, 2), capsules.ends, capsules.radii)


def some_state(robot, rng, share=0.6):
    q = robot.home + rng.uniform(-1.0, 1.0, robot.nq)
    return np.clip(q, robot.lower + 0.05, robot.upper - 0.05), share * rng.uniform(-1, 1, robot.nq) * robot.max_velocity


def controller_with(robot, law=None, figures=None, **parts):
    tool = robot.tool_frames[0]
    here = qpsafe.FixedPose(robot.pose(tool, robot.home))
    limit = SeparationLimit(Separation(2.0) if figures is None else figures)
    tasks = [qpsafe.PositionTask(tool, here), qpsafe.OrientationTask(tool, here)]
    return qpsafe.SafetyController(robot, tasks, law, separation=limit, **parts)


@pytest.mark.parametrize("name", ROBOTS)
@given(st.integers(0, 10**6))
@settings(max_examples=some(8, of=20))
def test_rows_are_the_rates_at_which_distances_shrink(name, seed):
    robot, rng = ROBOTS[name], np.random.default_rng(seed)
    q, qd = some_state(robot, rng)
    points = rng.uniform(-1.0, 1.0, (3, 3)) + np.array([0.2, 0.0, 0.5])
    for parts in (parts_of(name), LinkParts.wire(robot)):
        here, rows = parts.approaches(robot.at(q), points)
        h = 1e-6
        before, after = (parts.approaches(robot.at(q + sign * h * qd), points)[0] for sign in (-1.0, 1.0))
        rates = (after - before) / (2.0 * h)
        smooth = np.abs(after - 2.0 * here + before) < 1e-9  # else the nearest point leaves an end
        assert rows[smooth] @ qd == pytest.approx(-rates[smooth], abs=1e-4)
        assert smooth.mean() > 0.9
        places, jacobians = parts.motion(robot.at(q))
        if parts is not parts_of(name):
            for (start, _), place, J in zip(robot.wire_frames, places, jacobians, strict=True):
                assert place[0] == pytest.approx(robot.pose(start, q)[:3, 3], abs=1e-12)
                assert J[0] == pytest.approx(robot.jacobian(start, q)[:3], abs=1e-12)


@given(st.floats(0.3, 9.0), st.floats(0.0, 2.5), st.floats(0.0, 0.2), st.floats(1e-3, 4.0), st.floats(0.0, 0.02))
def test_the_speed_is_the_exact_inverse_also_where_it_is_held_for_a_tick(a_s, v_h, T_r, speed, held):
    """S_p(v_max(d)) + v_max held = d, and without holding S_p(v_max(d)) = d."""
    figures = Separation(a_s, person_speed=v_h, reaction_time=T_r)
    d = figures.distance(speed) + speed * held
    assert float(figures.speed(d, held)) == pytest.approx(speed, rel=1e-6, abs=1e-9)
    v = figures.speed(d, held)
    assert float(figures.distance(v) + v * held) == pytest.approx(float(d), rel=1e-9)


@given(st.integers(0, 10**6), st.floats(0.0, 0.1))
def test_rows_that_are_left_out_can_be_reached_by_no_command_of_the_tick(seed, age):
    rng = np.random.default_rng(seed)
    q, qd = some_state(ROBOT, rng)
    points = rng.uniform(-0.8, 0.8, (4, 3)) + np.array([0.3, 0.0, 0.4])
    limit, limits = SeparationLimit(Separation(rng.uniform(0.5, 8.0))), JointLimits.of(ROBOT, DT)
    few = limit.level(ROBOT.at(q), parts_of("irb140"), points, age, qd=qd, limits=limits)
    kept = np.zeros((0, 2)) if few is None else np.column_stack((few.points, few.gaps))
    box = limits.box(q, qd)
    distances, A = parts_of("irb140").approaches(ROBOT.at(q), points)
    upper = limit.separation.speed(distances - 1.6 * age, DT)
    fastest = np.maximum(A * box.lower, A * box.upper).sum(axis=1)
    must = fastest > upper
    for k in np.flatnonzero(must):
        assert (np.abs(kept - [k % len(points), distances[k]]).max(axis=1) < 1e-12).any()


def reachable(level, box):
    """Whether all rows can be met in a box, with room; by linear programming, which the solver knows nothing of."""
    rows, n = level.A.shape
    found = linprog(
        np.r_[np.zeros(n), 1.0],
        A_ub=np.column_stack((level.A, -np.ones(rows))),
        b_ub=level.upper,
        bounds=[*zip(box.lower, box.upper, strict=True), (-1.0, None)],
    )
    return found.x[-1]


@pytest.mark.parametrize(("name", "law"), crossed(ROBOTS, LAWS))
def test_a_command_obeys_every_row_that_can_be_obeyed_within_the_joint_limits(name, law):
    """Random states in motion, random points and figures, every law; where not all can be obeyed, no more is broken."""
    robot, rng = ROBOTS[name], np.random.default_rng(sum(map(ord, name + law)))
    tool, obeyed, binding, impossible = robot.tool_frames[0], 0, 0, 0
    for _ in range(some(8, of=20)):
        figures = Separation(rng.uniform(0.5, 6.0), reaction_time=rng.uniform(0.0, 0.1))
        controller = controller_with(robot, LAWS[law], figures, gate="off", clearance="off")
        q, qd = some_state(robot, rng, share=0.1)
        controller.step(q, np.zeros(robot.nq), points=[])
        for _ in range(4):
            if rng.random() < 0.5:
                controller._qd = qd * rng.uniform(-1.0, 1.0)  # in motion
            state = controller._q, controller._qd
            # where some speed up to 0.6 m/s is still allowed, or none
            away = rng.normal(size=(3, 3))
            away *= ((figures.distance(rng.uniform(0.0, 0.6, 3)) + 0.03) / np.linalg.norm(away, axis=1))[:, None]
            points = robot.pose(tool, state[0])[:3, 3] + away
            tick = controller.step(*state, points=points)
            assert tick.box is not None
            limits = JointLimits.of(robot, DT)
            level = controller.separation.level(robot.at(state[0]), parts_of(name), points, qd=state[1], limits=limits)
            if level is None:
                continue
            values = level.A @ tick.reference.qd - level.upper
            excess, least = float(values.max()), reachable(level, tick.box)
            if least <= -1e-6:
                assert excess <= 1e-7, (law, excess, least)
                obeyed, binding = obeyed + 1, binding + (excess > -1e-6)
            else:
                impossible += 1
                again = kept_apart([level], tick.reference.qd, tick.box)
                broken = [float((np.maximum(level.A @ v - level.upper, 0.0) ** 2).sum()) for v in
                          (tick.reference.qd, again)]  # fmt: skip
                assert broken[0] <= broken[1] + 1e-9
    assert obeyed > some(3, of=10)
    assert binding > some(0, of=2)


@pytest.mark.parametrize("law", first(2, LAWS))
def test_going_towards_a_standing_point_never_breaks_a_row(law):
    """The tool is sent through a point that stands there: at every tick every part keeps S_p of its own approach."""
    robot = ROBOT
    goal = robot.pose("tcp", robot.home)
    goal[:3, 3] += [0.25, 0.1, 0.05]
    target = qpsafe.FixedPose(goal)
    figures = Separation(3.0)
    controller = qpsafe.SafetyController(
        robot, [qpsafe.PositionTask("tcp", target, gain=4.0), qpsafe.OrientationTask("tcp", target)], LAWS[law],
        field=qpsafe.DangerField(static=0.0, kinetic=0.0), separation=SeparationLimit(figures), gate="off",
    )  # fmt: skip
    q, qd, start, fastest = robot.home, np.zeros(6), robot.pose("tcp", robot.home)[:3, 3], 0.0
    point = start + 0.85 * (goal[:3, 3] - start)
    for _ in range(300):
        tick = controller.step(q, qd, points=[point])
        q, qd = tick.reference.q, tick.reference.qd
        distances, A = parts_of("irb140").approaches(robot.at(q), point[None])
        approach = A @ qd
        assert (figures.distance(approach)[approach > 1e-9] <= distances[approach > 1e-9] + 1e-6).all()
        fastest = max(fastest, float(approach.max()))
    assert fastest > 0.1  # it did go there
    free = np.linalg.norm(goal[:3, 3] - robot.pose("tcp", q)[:3, 3])
    assert free > 0.01  # and was held back
    assert distances.min() >= figures.standing - 1e-6


def test_a_tick_says_which_link_is_held_apart_from_what():
    goal = ROBOT.pose("tcp", ROBOT.home)
    goal[:3, 3] += [0.2, 0.0, 0.0]
    target = qpsafe.FixedPose(goal)
    controller = qpsafe.SafetyController(
        ROBOT, [qpsafe.PositionTask("tcp", target), qpsafe.OrientationTask("tcp", target)],
        field=qpsafe.DangerField(static=0.0, kinetic=0.0), separation=SeparationLimit(Separation(3.0)), gate="off",
    )  # fmt: skip
    far, q, qd, held = [5.0, 0.0, 0.0], ROBOT.home, np.zeros(6), set()
    assert controller.step(q, qd, points=[far, far]).separation == ()
    for _ in range(250):
        tick = controller.step(q, qd, points=[far, goal[:3, 3]])
        q, qd = tick.reference.q, tick.reference.qd
        held |= {part for part, _, _ in tick.separation}
        for part, number, gap in tick.separation:
            assert number == 1
            assert gap > Separation(3.0).standing - 1e-6
            assert part in parts_of("irb140").names
            assert f"held apart: {part} and point 1, " in tick.explain()
    assert any(part.startswith("tool") for part in held)


def test_moving_away_is_always_allowed():
    """Inside S_p(0) nothing may come nearer, and the evasion goes on."""
    point = ROBOT.pose("tcp", ROBOT.home)[:3, 3] + [0.1, 0.0, 0.0]
    controller, q, qd = controller_with(ROBOT, figures=Separation(2.0, intrusion=0.5)), ROBOT.home, np.zeros(6)
    near, _ = parts_of("irb140").approaches(ROBOT.at(q), point[None])
    for _ in range(60):
        tick = controller.step(q, qd, points=[point])
        q, qd = tick.reference.q, tick.reference.qd
        distances, A = parts_of("irb140").approaches(ROBOT.at(q), point[None])
        assert (A @ qd)[near < 0.4].max() <= 1e-4  # the next tick's rows, nearly
    assert np.linalg.norm(ROBOT.pose("tcp", q)[:3, 3] - point) > 0.102
    assert (distances - near)[near < 0.4].min() > -1e-4


def test_old_sight_is_no_room():
    """Somebody seen a while ago may have come nearer since; what is stale is the sensor's matter."""
    limit, point = SeparationLimit(Separation(2.0)), ROBOT.pose("tcp", ROBOT.home)[None, :3, 3] + [0.4, 0.0, 0.0]
    fresh, aged = (limit.level(ROBOT.at(ROBOT.home), parts_of("irb140"), point, age) for age in (0.0, 0.03))
    assert (aged.upper <= fresh.upper).all()
    assert aged.upper.min() == pytest.approx(float(limit.separation.speed(fresh.gaps.min() - 1.6 * 0.03)))
    assert oldest(np.array([0.0, 0.02, np.nan, -1.0, 9.0]), 0.04) == 0.02
    controller = controller_with(ROBOT)
    count = len(controller.spots)
    moving = controller.step(ROBOT.home, np.zeros(6), np.full(count, np.inf))
    assert moving.status == "ok"
    for _ in range(12):  # nothing has come for long: too many are stale
        tick = controller.step(ROBOT.home, np.zeros(6), np.full(count, np.inf), ages=1.0)
    assert not tick.reference.qd.any()
    assert tick.status != "ok"


def test_robots_without_geometry_are_held_apart_by_their_wire():
    wire = LinkParts.wire(ROBOT)
    assert (wire.radii == 0.0).all()
    assert len(wire.names) == len(ROBOT.wire_frames)
    with pytest.raises(ConfigurationError):
        wire.radii = np.ones(6)


def test_a_point_on_an_axis_lets_nothing_through_the_numbers():
    places, _ = parts_of("irb140").motion(ROBOT.at(ROBOT.home))
    distances, rows = parts_of("irb140").approaches(ROBOT.at(ROBOT.home), places.mean(axis=1))
    assert np.isfinite(rows).all()
    assert np.isfinite(distances).all()
    tick = controller_with(ROBOT).step(ROBOT.home, np.zeros(6), points=places.mean(axis=1)[-3:])
    assert np.isfinite(tick.reference.qd).all()


def test_mistakes_are_named():
    with pytest.raises(ConfigurationError, match="separation"):
        SeparationLimit(2.0)  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="separation"):
        qpsafe.SafetyController(ROBOT, [qpsafe.PositionTask("tcp", qpsafe.FixedPose(np.eye(4)))], separation=1.6)


def test_a_batch_keeps_links_apart_as_single_controllers_do():
    """It says that it is not compiled, and gives the same references."""
    controller = controller_with(ROBOT)
    batch = qpsafe.BatchController(controller, 2)
    assert not batch.compiled
    assert "separation" in batch.why
    point = ROBOT.pose("tcp", ROBOT.home)[:3, 3] + [0.2, 0.0, 0.0]
    q, qd = np.tile(ROBOT.home, (2, 1)), np.zeros((2, 6))
    for _ in range(10):
        ticks = batch.step(q, qd, points=np.tile(point, (2, 1, 1)))
        tick = controller.step(q[0], qd[0], points=[point])
        q, qd = ticks.q, ticks.qd
        assert (ticks.qd == tick.reference.qd).all()


@pytest.mark.parametrize("name", ROBOTS)
@given(st.integers(0, 10**6))
@settings(max_examples=some(3, of=8))
def test_however_much_is_seen_a_robot_at_rest_approaches_none_of_it_too_fast(name, seed):
    """With a row for every part and point, a tick took gigabytes."""
    robot, rng = ROBOTS[name], np.random.default_rng(seed)
    controller = controller_with(robot, figures=Separation(2.0, reaction_time=rng.uniform(0.0, 0.3)))
    wire = robot.wire(robot.home, np.zeros(robot.nq))
    count = int(rng.choice([1, 30, 300, 900]))
    link, share = rng.integers(0, len(wire.starts), count), rng.random((count, 1))
    away = rng.normal(size=(count, 3))
    away *= rng.uniform(0.1, 0.6, (count, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
    points = wire.starts[link] + share * (wire.ends[link] - wire.starts[link]) + away
    tick = controller.step(robot.home, np.zeros(robot.nq), points=points)
    # so many rows may be ill-conditioned for the law, which says so: they are kept all the same
    assert tick.status == "ok" or tick.messages == ("law: ill-conditioned",)
    level = controller.separation.level(
        robot.at(robot.home), parts_of(name), points, qd=np.zeros(robot.nq), limits=controller.limits
    )
    assert level is None or len(level.upper) <= MOST
    distances, A = parts_of(name).approaches(robot.at(robot.home), points)
    most = controller.separation.separation.speed(distances, controller.dt)
    assert (A @ tick.reference.qd <= most + 1e-8).all()


@given(st.integers(0, 10**6), st.integers(1, 40))
def test_the_nearest_of_every_part_come_first(seed, most):
    rng = np.random.default_rng(seed)
    rows = np.flatnonzero(rng.random(60) < 0.7)
    parts, gaps = rows // 12, rng.random(len(rows))
    kept, left = nearest_first(rows, parts, gaps, most)
    assert np.array_equal(np.sort(np.concatenate((kept, left))), rows)
    assert len(kept) == min(most, len(rows))
    assert (np.diff(kept) > 0).all()
    for part in range(5):
        mine = parts == part
        inside, outside = np.isin(rows, kept) & mine, np.isin(rows, left) & mine
        assert not outside.any() or gaps[inside].max(initial=0.0) <= gaps[outside].min()
    counts = [np.isin(rows[parts == part], kept).sum() for part in range(5)]
    assert all(counts[part] == (parts == part).sum() for part in range(5) if counts[part] < max(counts) - 1)


@given(st.integers(0, 10**6), st.floats(0.0, 0.3))
@settings(max_examples=some(8, of=20))
def test_what_somebody_may_have_come_counts_as_distance(seed, come):
    """However fast people are: errors of places are no times."""
    rng = np.random.default_rng(seed)
    q, _ = some_state(ROBOT, rng)
    points, age = rng.uniform(-0.5, 0.5, (4, 3)) + np.array([0.3, 0.0, 0.6]), rng.uniform(0.0, 0.2)
    for v_h in (0.0, 0.3, 1.6):
        figures = Separation(2.0, person_speed=v_h)
        level = SeparationLimit(figures).level(ROBOT.at(q), parts_of("irb140"), points, age, come=come)
        assert np.allclose(level.upper, figures.speed(level.gaps - max(v_h * age, come)), atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
@settings(max_examples=some(5, of=60))
@given(st.integers(0, 10**6), st.sampled_from((0.05, 0.3, 2.0, 1e3, 1e7)))
def test_of_many_points_no_row_that_can_bind_is_left_out(name, seed, spread):
    """Pairs are left out early only where they are far from binding, wherever a cloud is."""
    robot, parts, rng = ROBOTS[name], parts_of(name), np.random.default_rng(seed)
    q, qd = some_state(robot, rng, share=rng.choice([0.0, 0.1, 1.0]))
    points = robot.pose(robot.tool_frames[0], q)[:3, 3] + spread * rng.normal(size=(60, 3))
    points[0], points[1] = np.inf, np.nan
    here, limits, come = robot.at(q), JointLimits.of(robot, DT), float(rng.choice([0.0, 0.1]))
    with np.errstate(invalid="ignore"):
        distances, A = parts.approaches(here, points)
        level = SeparationLimit(Separation(2.0)).level(here, parts, points, come=come, qd=qd, limits=limits)
        upper = Separation(2.0).speed(distances - come, DT)
        can = A @ qd + np.abs(A) @ (limits.max_acceleration * DT) > upper
    chosen = np.flatnonzero(can & np.isfinite(upper))
    assert (level is None) == (not len(chosen))
    if level is not None:
        left = np.empty(0) if level.beyond is None else level.beyond[1]
        np.testing.assert_allclose(np.sort(np.append(level.upper, left)), np.sort(upper[chosen]), atol=1e-9)
        if level.beyond is None:
            np.testing.assert_allclose(level.A, A[chosen], atol=1e-12)
            assert level.points.tolist() == (chosen % 60).tolist()
