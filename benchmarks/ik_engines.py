"""The IRB 140 in mink and in pink, asked alike, for tests of the plug-ins."""

from __future__ import annotations

import importlib

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin

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
        """A configuration of the engine at q (n,) [rad]."""
        return mink.Configuration(self.model, q=np.array(q))

    def frame(self, target, position, orientation, gain):
        """A task on the tool's pose."""
        task = mink.FrameTask("tcp", "site", position, orientation, gain=gain)
        task.set_target(mink.SE3.from_matrix(target))
        return task

    def posture(self, target, cost, gain):
        """A task on all joints."""
        task = mink.PostureTask(self.model, cost, gain=gain)
        task.set_target(target)
        return task

    def limits(self):
        """Of position and velocity."""
        speeds = dict(zip(self.robot.joint_names, self.robot.max_velocity, strict=True))
        return [mink.ConfigurationLimit(self.model), mink.VelocityLimit(self.model, speeds)]

    def solve(self, configuration, tasks, limits):
        """q̇ (n,) [rad/s]."""
        return mink.solve_ik(configuration, tasks, DT, "daqp", limits=limits, **TIGHT)

    def convert(self, task):
        """A task of the engine as one of ours."""
        return from_engine("mink")(task, self.robot, self.model, DT)

    def back(self, task, cost=1.0):
        """One of ours as the engine's."""
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
        """A configuration of the engine at q (n,) [rad]."""
        return pink.Configuration(self.model, self.model.createData(), np.array(q))

    def frame(self, target, position, orientation, gain):
        """A task on the tool's pose."""
        task = pink.tasks.FrameTask("tcp", position, orientation, gain=gain)
        task.set_target(pin.SE3(target))
        return task

    def posture(self, target, cost, gain):
        """A task on all joints."""
        task = pink.tasks.PostureTask(cost=cost, gain=gain)
        task.set_target(np.array(target))
        return task

    def limits(self):
        """Of position and velocity."""
        return [self.model.configuration_limit, self.model.velocity_limit]

    def solve(self, configuration, tasks, limits):
        """q̇ (n,) [rad/s]."""
        return pink.solve_ik(configuration, tasks, DT, solver="daqp", limits=limits, safety_break=False, **TIGHT)

    def convert(self, task):
        """A task of the engine as one of ours."""
        return from_engine("pink")(task, self.robot, self.model, DT)

    def back(self, task, cost=1.0):
        """One of ours as the engine's."""
        return to_engine("pink")(task, self.robot, self.model, DT, cost)


def from_engine(name):
    """What makes tasks of an engine ours."""
    return getattr(importlib.import_module(f"qpsafe.plugins.{name}_convert"), f"from_{name}")


def to_engine(name):
    """What makes our tasks an engine's."""
    return getattr(importlib.import_module(f"qpsafe.plugins.{name}_convert"), f"to_{name}")


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
    """A monitor that has been told for a while of points at a configuration at rest."""
    danger = DangerMonitor(robot, DT, ramp=0.0, limits="off")
    for _ in range(40):
        danger.update(q, np.zeros(6) if qd is None else qd, points)
    return danger
