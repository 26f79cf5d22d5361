"""Danger-aware tasks inside `mink.solve_ik` and `pink.solve_ik`: the same theorems for both."""

from __future__ import annotations

import subprocess
import sys

import mink
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from amounts import some
from ik_engines import DT, TIGHT, Mink, box, near, states, watch

import qpsafe
from qpsafe.laws.problem import LawProblem, TaskVelocity
from qpsafe.plugins.convert import task_velocity
from qpsafe.plugins.monitor import DangerMonitor

pytestmark = pytest.mark.long


def test_the_weighted_law_and_solve_ik_agree_on_the_same_tasks_costs_and_limits(engine, robot):
    active = 0
    for rng, q, target in states(robot, some(30, of=60)):
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
    assert active > some(4, of=10)  # limits decided some of them


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
    for _ in range(some(500, of=750)):  # it is gone: the tool comes back
        danger.update(q, qd, [])
        qd = engine.solve(configuration, [hold, evasive], engine.limits())
        q = q + qd * DT
        configuration.update(q)
    np.testing.assert_allclose(robot.pose("tcp", q), robot.pose("tcp", robot.home), atol=1e-3)


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


@pytest.mark.slow
def test_pink_is_optional():
    code = (
        "import sys; sys.modules['pink'] = None\n"
        "import qpsafe.plugins.mink, qpsafe.plugins.mink_convert\n"
        "try:\n    import qpsafe.plugins.pink_convert\nexcept ImportError as error:\n    print(error)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert "pip install 'qpsafe[pink]'" in run.stdout
