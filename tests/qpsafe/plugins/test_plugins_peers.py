"""Danger-aware tasks and limits inside `mink.solve_ik` and `pink.solve_ik`: the same theorems for both."""

from __future__ import annotations

import importlib
import subprocess
import sys

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin
import pytest

import qpsafe
from qpsafe.laws.problem import LawProblem, TaskVelocity
from qpsafe.plugins.convert import task_velocity
from qpsafe.plugins.monitor import DangerMonitor

DT = 0.004
TIGHT = {"primal_tol": 1e-12, "dual_tol": 1e-12}  # of Δq, which is q̇ dt


class Mink:
    """The IRB 140 in mink."""

    plugin = importlib.import_module("qpsafe.plugins.mink")
    no_solution = mink.NoSolutionFound
    step_gain = 0.95  # of the distance to a joint limit, in one tick

    def __init__(self, robot):
        self.robot, self.model = robot, mujoco.MjModel.from_xml_path(str(robot.model_path))

    def at(self, q):
        return mink.Configuration(self.model, q=np.array(q))

    def frame(self, target, position, orientation, gain):
        task = mink.FrameTask("tcp", "site", position, orientation, gain=gain)
        task.set_target(mink.SE3.from_matrix(target))
        return task

    def posture(self, target, cost, gain):
        task = mink.PostureTask(self.model, cost, gain=gain)
        task.set_target(target)
        return task

    def limits(self):
        speeds = dict(zip(self.robot.joint_names, self.robot.max_velocity, strict=True))
        return [mink.ConfigurationLimit(self.model), mink.VelocityLimit(self.model, speeds)]

    def solve(self, configuration, tasks, limits):
        return mink.solve_ik(configuration, tasks, DT, "daqp", limits=limits, **TIGHT)

    def convert(self, task):
        return from_engine("mink")(task, self.robot, self.model, DT)

    def back(self, task, cost=1.0):
        return to_engine("mink")(task, self.robot, self.model, DT, cost)


class Pink(Mink):
    """The IRB 140 in pink."""

    plugin = importlib.import_module("qpsafe.plugins.pink")
    no_solution = pink.exceptions.NoSolutionFound
    step_gain = 0.5

    def __init__(self, robot):
        self.robot, self.model = robot, pin.Model(robot.model)
        self.model.velocityLimit = robot.max_velocity.copy()
        self.model.lowerPositionLimit, self.model.upperPositionLimit = robot.lower.copy(), robot.upper.copy()

    def at(self, q):
        return pink.Configuration(self.model, self.model.createData(), np.array(q))

    def frame(self, target, position, orientation, gain):
        task = pink.tasks.FrameTask("tcp", position, orientation, gain=gain)
        task.set_target(pin.SE3(target))
        return task

    def posture(self, target, cost, gain):
        task = pink.tasks.PostureTask(cost=cost, gain=gain)
        task.set_target(np.array(target))
        return task

    def limits(self):
        return [self.model.configuration_limit, self.model.velocity_limit]

    def solve(self, configuration, tasks, limits):
        return pink.solve_ik(configuration, tasks, DT, solver="daqp", limits=limits, safety_break=False, **TIGHT)

    def convert(self, task):
        return from_engine("pink")(task, self.robot, self.model, DT)

    def back(self, task, cost=1.0):
        return to_engine("pink")(task, self.robot, self.model, DT, cost)


def from_engine(name):
    return getattr(importlib.import_module(f"qpsafe.plugins.{name}_convert"), f"from_{name}")


def to_engine(name):
    return getattr(importlib.import_module(f"qpsafe.plugins.{name}_convert"), f"to_{name}")


@pytest.fixture(scope="module")
def robot():
    return qpsafe.load_robot("irb140")


@pytest.fixture(scope="module", params=[Mink, Pink], ids=["mink", "pink"])
def engine(request, robot):
    return request.param(robot)


def box(engine, q):
    """What the engine's configuration and velocity limits say of q̇."""
    r, gain = engine.robot, engine.step_gain / DT
    return np.maximum(-r.max_velocity, gain * (r.lower - q)), np.minimum(r.max_velocity, gain * (r.upper - q))


def states(robot, count, seed=0):
    """Configurations, some of them near a joint limit, with a target pose near or far."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        q = robot.home + rng.uniform(-0.6, 0.6, 6)
        q = np.clip(q, robot.lower + 0.01, robot.upper - 0.01)
        if k % 3 == 0:
            q[k % 6] = robot.upper[k % 6] - 1e-3
        yield rng, q, robot.pose("tcp", q + rng.uniform(-1.0, 1.0, 6) * (0.02 if k % 2 else 1.2))


def near(robot, q, gap):
    """A point beside the tool."""
    return robot.pose("tcp", q)[:3, 3] + gap * np.array([0.0, 0.6, 0.8])


def watch(robot, q, points, qd=None):
    danger = DangerMonitor(robot, DT, ramp=0.0, limits="off")
    for _ in range(40):
        danger.update(q, np.zeros(6) if qd is None else qd, points)
    return danger


def test_the_weighted_law_and_solve_ik_agree_on_the_same_tasks_costs_and_limits(engine, robot):
    active = 0
    for rng, q, target in states(robot, 60):
        configuration, (lower, upper) = engine.at(q), box(engine, q)
        danger = watch(robot, q, [])
        danger.qd0 = rng.uniform(-0.5, 0.5, 6)
        tasks = [engine.frame(target, 1.0, 0.3, gain=0.04), engine.posture(robot.home, 0.1, gain=0.02)]
        theirs = engine.solve(configuration, [*tasks, engine.plugin.EvasiveTask(danger, 0.05)], engine.limits())
        rows = tuple(task_velocity(task, configuration, DT) for task in tasks)
        law = qpsafe.WeightedLaw(weights=(1.0, 1.0, 0.05**2))
        ours = law.solve(LawProblem(rows, danger.qd0, (1.0, 1.0), lower, upper)).qd
        np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=1e-6)
        active += int(np.any((ours <= lower + 1e-9) | (ours >= upper - 1e-9)))
    assert active > 10  # limits decided some of them


def test_qpsafes_tasks_in_solve_ik_are_the_weighted_law(engine, robot):
    for rng, q, target in states(robot, 30, seed=1):
        configuration, (lower, upper) = engine.at(q), box(engine, q)
        danger = watch(robot, q, [])
        danger.qd0 = rng.uniform(-0.5, 0.5, 6)
        goal = qpsafe.FixedPose(target)
        tasks = [
            qpsafe.PositionTask("tcp", goal, gain=3.0),
            qpsafe.OrientationTask("tcp", goal, gain=10.0),
            qpsafe.PostureTask(robot.home, gain=2.0),
        ]
        costs = (3.0, 1.0, 0.2)
        theirs = [engine.back(task, cost) for task, cost in zip(tasks, costs, strict=True)]
        qd = engine.solve(configuration, [*theirs, engine.plugin.EvasiveTask(danger, 0.05)], engine.limits())
        rows = tuple(clik(task, robot.at(q)) for task in tasks)
        law = qpsafe.WeightedLaw(weights=(*np.square(costs), 0.05**2))
        ours = law.solve(LawProblem(rows, danger.qd0, (1.0, 1.0, 1.0), lower, upper)).qd
        np.testing.assert_allclose(qd, ours, rtol=0.0, atol=1e-6)


def clik(task, state):
    sample = task.trajectory.sample(0.0)
    return TaskVelocity(task.jacobian(state), task.velocity(task.error(task.value(state), sample), sample))


def test_in_danger_tasks_are_released_as_the_weighted_law_releases_them(engine, robot):
    """With against = cost; and Table I's low-priority task before the first one."""
    released = set()
    for gap in (1.6, 1.0, 0.62, 0.55, 0.5, 0.4, 0.33, 0.31):
        q = robot.home + 0.05
        danger = watch(robot, q, [near(robot, q, gap)])
        m, f = danger.switches
        if not m > 1e-5:
            continue
        released.add((m == 1.0, f in (0.0, 1.0)))
        configuration, target = engine.at(q), robot.pose("tcp", robot.home)
        first, second = engine.frame(target, 1.0, 0.0, gain=0.04), engine.frame(target, 0.0, 0.5, gain=0.04)
        evasive = engine.plugin.EvasiveTask(danger, 0.05, against=0.05)
        qd = engine.solve(
            configuration, [first, engine.plugin.ReleasableTask(second, danger), evasive], engine.limits()
        )
        rows = (task_velocity(first, configuration, DT), task_velocity(second, configuration, DT))
        law = qpsafe.WeightedLaw(weights=(1.0, 1.0, 0.05**2))
        ours = law.solve(LawProblem(rows, danger.qd0, (m, m * f), *box(engine, q))).qd
        np.testing.assert_allclose(qd, ours, rtol=0.0, atol=1e-6)
    assert {(True, True), (True, False), (False, True)} <= released


def test_the_monitor_sees_what_the_controller_sees(robot):
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    controller = qpsafe.SafetyController(robot, [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)])
    danger = DangerMonitor(robot, controller.dt, ramp=0.0)
    q, qd = robot.home, np.zeros(6)
    for k in range(50):
        points = [near(robot, robot.home, 0.6 - 0.005 * k), [0.3, -0.5, 0.6]]
        tick = controller.step(q, qd, points=points)
        danger.update(q, qd, points)
        assert danger.cdf_n == pytest.approx(tick.cdf_n, rel=1e-12)
        assert danger.switches == pytest.approx((tick.m, tick.f), rel=1e-9)
        np.testing.assert_allclose(danger.qd0, tick.qd0, rtol=1e-12, atol=1e-15)
        q, qd = tick.reference.q, tick.reference.qd


def test_where_the_robot_stands_does_not_matter(robot):
    base = np.eye(4)
    base[:3, :3] = pin.exp3(np.array([0.2, -0.4, 1.1]))
    base[:3, 3] = 1.0, -2.0, 0.5
    points = np.array([near(robot, robot.home, 0.3), [0.5, 0.5, 0.5]])
    here, there = DangerMonitor(robot), DangerMonitor(robot, base=base)
    here.update(robot.home, np.ones(6), points)
    there.update(robot.home, np.ones(6), points @ base[:3, :3].T + base[:3, 3])
    np.testing.assert_allclose(there.qd0, here.qd0, rtol=1e-9)
    assert there.cdf_n == pytest.approx(here.cdf_n, rel=1e-12)


def test_the_evasive_task_moves_the_robot_away(engine, robot):
    q, point = np.array(robot.home), near(robot, robot.home, 0.3)
    danger, hold = DangerMonitor(robot, DT), engine.frame(robot.pose("tcp", robot.home), 1.0, 0.3, gain=0.04)
    evasive, qd = engine.plugin.EvasiveTask(danger), np.zeros(6)
    before, configuration = watch(robot, q, [point]).cdf_n, engine.at(q)
    for _ in range(250):
        danger.update(q, qd, [point])
        qd = engine.solve(configuration, [hold, evasive], engine.limits())
        q = q + qd * DT
        configuration.update(q)
    assert np.linalg.norm(robot.pose("tcp", q)[:3, 3] - point) > 0.35
    assert danger.cdf_n < before
    for _ in range(750):  # it is gone: the tool comes back
        danger.update(q, qd, [])
        qd = engine.solve(configuration, [hold, evasive], engine.limits())
        q = q + qd * DT
        configuration.update(q)
    np.testing.assert_allclose(robot.pose("tcp", q), robot.pose("tcp", robot.home), atol=1e-3)


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
    for k in range(400):
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


@pytest.mark.parametrize("name", qpsafe.bundled_robots())
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


def test_a_task_comes_back_no_sooner_than_the_ramp_and_is_released_within_a_tenth_of_it(robot):
    danger, here = DangerMonitor(robot, DT, ramp=0.5), near(robot, robot.home, 0.2)
    danger.update(robot.home, np.zeros(6), [])
    assert danger.switches == (1.0, 1.0)
    for _ in range(round(0.05 / DT)):
        danger.update(robot.home, np.zeros(6), [here])
    assert max(danger.switches) < 0.15
    for _ in range(500):
        danger.update(robot.home, np.zeros(6), [here])
    assert danger.m < 1e-9
    ticks = 0
    while danger.m < 1.0:
        danger.update(robot.home, np.zeros(6), [])
        ticks += 1
    assert ticks == pytest.approx(0.5 / DT, abs=1)


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
    for _ in range(3000):
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


def test_a_model_with_more_than_the_robot_gives_the_robot_the_same_velocity(robot):
    """The robot attached with a prefix beside a free body: only its own joints move."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="crate").add_freejoint()
    spec.body("crate").add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    spec.attach(mujoco.MjSpec.from_file(str(robot.model_path)), prefix="arm_", frame=spec.worldbody.add_frame())
    model = spec.compile()
    configuration = mink.Configuration(model)
    q = np.array(configuration.q)
    q[7:] = robot.home
    configuration.update(q)
    danger = watch(robot, robot.home, [near(robot, robot.home, 0.3)], 0.1 * np.ones(6))
    plugin = Mink.plugin
    limit = plugin.DangerLimit(danger, 9.0, prefix="arm_")
    damping = mink.DampingTask(model, cost=1e-3)
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home + 0.1))
    tasks = [plugin.EvasiveTask(danger, prefix="arm_"), plugin.ClikTask(qpsafe.PositionTask("tcp", goal), robot, DT)]
    tasks[1].prefix = "arm_"
    whole = mink.solve_ik(configuration, [*tasks, damping], DT, "daqp", limits=[limit], **TIGHT)
    np.testing.assert_allclose(whole[:6], 0.0, atol=1e-12)
    alone = Mink(robot)
    tasks = [plugin.EvasiveTask(danger), plugin.ClikTask(qpsafe.PositionTask("tcp", goal), robot, DT)]
    limit = plugin.DangerLimit(danger, 9.0)
    damping = mink.DampingTask(alone.model, cost=1e-3)
    np.testing.assert_allclose(whole[6:], alone.solve(alone.at(robot.home), [*tasks, damping], [limit]), atol=1e-9)


def test_outside_a_joint_limit_solve_ik_raises_and_qpsafe_comes_back(engine, robot):
    raised, joints = 0, (0, 1, 4)
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
    assert raised >= (3 if type(engine) is Mink else 2)


def back_inside(robot, joint, q, speeds):
    """Inside, at a bounded speed, and no farther than necessary."""
    assert robot.upper[joint] - 1e-3 < q[joint] <= robot.upper[joint] + 1e-7
    assert min(speeds) >= -0.1 - 1e-6
    assert np.all(np.abs(np.diff([0.0, *speeds])) <= robot.max_acceleration[joint] * DT + 1e-6)


def test_pink_is_optional():
    code = (
        "import sys; sys.modules['pink'] = None\n"
        "import qpsafe.plugins.mink, qpsafe.plugins.mink_convert\n"
        "try:\n    import qpsafe.plugins.pink_convert\nexcept ImportError as error:\n    print(error)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert "pip install 'qpsafe[pink]'" in run.stdout
