"""Danger-aware limits inside `mink.solve_ik` and `pink.solve_ik`, and what happens to mistakes and bad data."""

from __future__ import annotations

import mink
import mujoco
import numpy as np
import pytest
from amounts import first, some
from ik_engines import DT, Mink, Pink, near, watch

import qpsafe
from qpsafe.plugins.monitor import DangerMonitor


def test_without_horizon_the_danger_limit_cuts_off_nothing_that_is_allowed(engine, robot):
    """A tangent of a convex function lies below it, and touches it along the present velocity."""
    rng, kept = np.random.default_rng(3), 0
    for _ in range(12):
        q, qd = robot.home + rng.uniform(-0.4, 0.4, 6), rng.uniform(-1.0, 1.0, 6)
        point = near(robot, q, rng.uniform(0.3, 0.6))
        danger = watch(robot, q, [point], qd)
        still = danger.field.value([point], robot.wire(q, np.zeros(6)))[0]
        cap = still + rng.uniform(0.2, 2.0)
        limit = engine.plugin.DangerLimit(danger, cap, horizon=0.0)
        rows = limit.compute_qp_inequalities(engine.at(q), DT)
        G, h = rows[0], rows[1]
        # κ q̇ at the cap meets the row with equality: exact along the present velocity
        kappa = (cap - still) / (danger.field.value([point], robot.wire(q, qd))[0] - still)
        np.testing.assert_allclose(G @ (kappa * qd * DT), h, rtol=1e-5)
        for trial in rng.uniform(0.0, 1.0, (60, 1)) ** 2 * rng.uniform(-0.6, 0.6, (60, 6)):
            if danger.field.value([point], robot.wire(q, trial))[0] <= cap:
                kept += 1
                assert np.all(G @ (trial * DT) <= h + 1e-7)
    assert kept > 50


def test_guarded_velocities_meet_the_cap_exactly(engine, robot):
    rng, scaled = np.random.default_rng(4), 0
    for _ in range(40):
        q, qd = robot.home + rng.uniform(-0.4, 0.4, 6), rng.uniform(-2.0, 2.0, 6)
        points = [near(robot, q, gap) for gap in rng.uniform(0.35, 0.8, 3)]
        danger = watch(robot, q, points)
        cap = float(danger.danger.max()) + 0.5
        velocity = engine.plugin.DangerLimit(danger, cap).guard(engine.at(q), qd)
        assert np.all(danger.field.value(points, robot.wire(q, velocity)) <= cap + 1e-9)
        np.testing.assert_allclose(velocity * (qd @ qd), qd * (velocity @ qd), atol=1e-9)  # the same direction
        scaled += bool(np.any(velocity != qd))
    assert scaled > 10


def test_a_point_that_is_too_near_already_makes_no_call_fail(engine, robot):
    for gap in (0.5, 0.2, 0.05, 0.0):
        danger = watch(robot, robot.home, [near(robot, robot.home, gap)], 0.1 * np.ones(6))
        limit = engine.plugin.DangerLimit(danger, delta_max=5.0, points=3)
        hold = engine.frame(robot.pose("tcp", robot.home + 0.3), 1.0, 1.0, gain=1.0)
        configuration = engine.at(robot.home)
        qd = engine.solve(configuration, [hold, engine.plugin.EvasiveTask(danger)], [*engine.limits(), limit])
        assert np.all(np.isfinite(qd))
        rows = limit.compute_qp_inequalities(configuration, DT)
        assert np.all(rows[0] @ (qd * DT) <= rows[1] + 1e-9)


def test_within_the_joint_limits_no_call_fails_whatever_the_danger(engine, robot):
    """Wild targets, points that jump onto the robot: each tick is solved, and inside the box."""
    rng = np.random.default_rng(6)
    danger, q, qd = DangerMonitor(robot, DT), np.array(robot.home), np.zeros(6)
    limits = [engine.plugin.JointLimit(danger), engine.plugin.DangerLimit(danger, delta_max=8.0)]
    evasive, configuration, point = engine.plugin.EvasiveTask(danger), engine.at(q), np.ones(3)
    for k in range(some(200, of=400)):
        if k % 40 == 0:
            hold = engine.frame(robot.pose("tcp", rng.uniform(robot.lower, robot.upper)), 1.0, 0.3, gain=0.2)
            point = near(robot, q, rng.uniform(0.0, 0.8))
        danger.update(q, qd, [point])
        last, qd = qd, engine.solve(configuration, [hold, evasive, engine.posture(q, 1e-3, 0.1)], limits)
        assert np.all(qd >= danger.box.lower - 1e-6)
        assert np.all(qd <= danger.box.upper + 1e-6)
        assert np.all(np.abs(qd - last) <= robot.max_acceleration * DT + 1e-6)
        q = q + qd * DT
        configuration.update(q)
    assert np.all(q >= robot.lower - 1e-6)
    assert np.all(q <= robot.upper + 1e-6)


@pytest.mark.parametrize("name", first(1, qpsafe.bundled_robots()))
def test_every_bundled_robot_makes_way_in_a_loop_of_mink(name):
    robot = qpsafe.load_robot(name)
    model = mujoco.MjModel.from_xml_path(str(robot.model_path))
    tool = robot.tool_frames[0]
    start = robot.pose(tool, robot.home)
    frame = mink.FrameTask(tool, "site", 1.0, 0.3, gain=0.05)
    frame.set_target(mink.SE3.from_matrix(start))
    danger, qd, configuration = DangerMonitor(robot, DT), np.zeros(robot.nq), mink.Configuration(model, q=robot.home)
    limits = [Mink.plugin.JointLimit(danger), Mink.plugin.DangerLimit(danger, delta_max=30.0)]
    tasks = [frame, mink.DampingTask(model, 0.01), Mink.plugin.EvasiveTask(danger)]
    hand = start[:3, 3] + [0.2, 0.0, 0.1]
    for _ in range(250):
        danger.update(configuration.q, qd, [hand])
        qd = mink.solve_ik(configuration, tasks, DT, "daqp", limits=limits)
        configuration.integrate_inplace(qd, DT)
    assert danger.status == "ok"
    assert np.linalg.norm(robot.pose(tool, configuration.q)[:3, 3] - hand) > np.linalg.norm(start[:3, 3] - hand) + 0.02


def test_at_singular_poses_speeds_stay_within_the_box(engine, robot):
    """Wrist and elbow stretched, with targets that cannot be reached."""
    for q in (np.array([0.3, 0.2, 0.1, 0.5, 0.0, 0.2]), np.array([0.3, 0.2, -np.pi / 2, 0.0, 0.0, 0.0])):
        danger, qd, configuration = DangerMonitor(robot, DT), np.zeros(6), engine.at(q)
        target = robot.pose("tcp", q)
        target[:3, 3] *= 2.0
        tasks, limits = [engine.frame(target, 1.0, 1.0, gain=1.0)], [engine.plugin.JointLimit(danger)]
        for _ in range(100):
            danger.update(q, qd, [])
            last, qd = qd, engine.solve(configuration, [*tasks, engine.plugin.EvasiveTask(danger)], limits)
            assert np.all(np.abs(qd) <= robot.max_velocity + 1e-6)
            assert np.all(np.abs(qd - last) <= robot.max_acceleration * DT + 1e-6)
            q = q + qd * DT
            configuration.update(q)


@pytest.mark.parametrize("bad", ["points", "q", "shape"])
def test_bad_data_are_reported_and_brake(engine, robot, bad):
    danger = watch(robot, robot.home, [near(robot, robot.home, 0.3)])
    data = {
        "points": (robot.home, np.zeros(6), [[np.nan, 0.0, 0.0]]),
        "q": (np.full(6, np.nan), np.zeros(6), []),
        "shape": (robot.home, np.zeros(6), [1.0, 2.0]),
    }[bad]
    hold = engine.frame(robot.pose("tcp", robot.home + 0.1), 1.0, 1.0, gain=0.05)
    limit, evasive = engine.plugin.DangerLimit(danger, 11.0), engine.plugin.EvasiveTask(danger)
    for _ in range(1500):
        danger.update(*data)
    assert danger.status == "bad_input"
    assert danger.message
    assert np.isnan(danger.cdf_n)
    qd = engine.solve(engine.at(robot.home), [hold, evasive], [*engine.limits(), limit])
    np.testing.assert_allclose(qd, 0.0, atol=1e-2)  # the evasive velocity has faded, and costs 1000 times as much
    np.testing.assert_array_equal(limit.guard(engine.at(robot.home), qd), qd)
    danger.update(robot.home, np.zeros(6), [])
    assert (danger.status, danger.message) == ("ok", "")


def test_after_bad_data_the_joint_limit_brakes_within_the_accelerations(engine, robot):
    danger, q = DangerMonitor(robot, DT), np.array(robot.home)
    qd = 0.5 * np.ones(6)
    limit, configuration = engine.plugin.JointLimit(danger), engine.at(q)
    hold = engine.frame(robot.pose("tcp", robot.home + 0.4), 1.0, 1.0, gain=0.5)
    danger.update(q, qd, [])
    qd = engine.solve(configuration, [hold], [limit])
    danger.update(q, qd, [])
    for _ in range(60):
        danger.update(q, np.full(6, np.nan), [])
        last, qd = qd, engine.solve(configuration, [hold], [limit])
        assert np.all(np.abs(qd) <= np.abs(last) + 1e-6)
        assert np.all(np.abs(qd - last) <= robot.max_acceleration * DT + 1e-6)
    np.testing.assert_allclose(qd, 0.0, atol=1e-6)


def test_mistakes_are_named(engine, robot):
    danger = DangerMonitor(robot, DT)
    plugin, home = engine.plugin, engine.at(robot.home)
    with pytest.raises(qpsafe.ConfigurationError, match=r"danger\.update"):
        plugin.EvasiveTask(danger).compute_error(home)
    danger.update(robot.home, np.zeros(6), [])
    with pytest.raises(qpsafe.ConfigurationError, match=r"dt = 0\.01"):
        plugin.DangerLimit(danger, 11.0).compute_qp_inequalities(home, 0.01)
    with pytest.raises(qpsafe.ConfigurationError, match="other_joint_1"):
        plugin.EvasiveTask(danger, prefix="other_").compute_jacobian(home)
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    for make, word in (
        (lambda: plugin.EvasiveTask(danger, cost=-1.0), "cost"),
        (lambda: plugin.EvasiveTask(danger, against=np.nan), "against"),
        (lambda: plugin.EvasiveTask(robot), "danger"),
        (lambda: plugin.DangerLimit(danger, 0.0), "delta_max"),
        (lambda: plugin.ReleasableTask(engine.posture(robot.home, 1.0, 0.1), danger, 3), "priority"),
        (lambda: plugin.ClikTask(qpsafe.PositionTask("hand", goal), robot, DT), "frame"),
        (lambda: plugin.ClikTask(qpsafe.PositionTask("tcp", goal, gain=300.0), robot, DT), "gain"),
        (lambda: DangerMonitor(robot, 0.0), "dt"),
        (lambda: DangerMonitor(robot, ramp=-1.0), "ramp"),
        (lambda: DangerMonitor(robot, base=np.eye(3)), "base"),
        (lambda: plugin.JointLimit(DangerMonitor(robot, limits="off")), "limits"),
        (lambda: DangerMonitor(robot, evasion=qpsafe.Evasion(1.0, 1.0, 7)), "evasion"),
        (lambda: qpsafe.WeightedLaw(weights=(1.0, 0.0)), "weights"),
    ):
        with pytest.raises(qpsafe.ConfigurationError, match=word):
            make()


def test_outside_a_joint_limit_solve_ik_raises_and_qpsafe_comes_back(engine, robot):
    raised, joints = 0, (4, 0, 1)[: some(2, of=3)]
    for joint in joints:
        q = np.array(robot.home)
        q[joint] = robot.upper[joint] + 0.05
        hold = engine.posture(q, 1.0, gain=0.1)
        try:  # pink takes half the way in one tick if the speed limit allows it: whatever the acceleration
            jump = engine.solve(engine.at(q), [hold], engine.limits())[joint]
            assert abs(jump) > 50.0 * robot.max_acceleration[joint] * DT
            assert isinstance(engine, Pink)
        except engine.no_solution:
            raised += 1
        start = q.copy()
        # beyond its limit joint 5 brings the flange within the margin of the tube, which leads it out more quickly
        controller = qpsafe.SafetyController(robot, [qpsafe.PostureTask(start)], clearance="off")
        qd, speeds = np.zeros(6), []
        for _ in range(200):
            tick = controller.step(q, qd, points=[])
            q, qd = tick.reference.q, tick.reference.qd
            speeds.append(qd[joint])
        back_inside(robot, joint, q, speeds)
        danger, q, qd, speeds = DangerMonitor(robot, DT), start.copy(), np.zeros(6), []  # JointLimit in their call
        configuration, limit = engine.at(q), engine.plugin.JointLimit(danger)
        for _ in range(200):
            danger.update(q, qd, [])
            qd = engine.solve(configuration, [hold], [limit])
            q = q + qd * DT
            configuration.update(q)
            speeds.append(qd[joint])
        back_inside(robot, joint, q, speeds)
    assert raised >= len(joints) - (type(engine) is not Mink)


def back_inside(robot, joint, q, speeds):
    """Inside, at a bounded speed, and no farther than necessary."""
    assert robot.upper[joint] - 1e-3 < q[joint] <= robot.upper[joint] + 1e-7
    assert min(speeds) >= -0.1 - 1e-6
    assert np.all(np.abs(np.diff([0.0, *speeds])) <= robot.max_acceleration[joint] * DT + 1e-6)
