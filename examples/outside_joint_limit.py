"""Joint 2 starts 0.05 rad outside: mink raises, qpsafe comes back. Run: python examples/outside_joint_limit.py"""

import mink
import mujoco
import numpy as np

import qpsafe
from qpsafe.plugins.mink import DangerMonitor, JointLimit

DT, robot = 0.004, qpsafe.load_robot("irb140")
model = mujoco.MjModel.from_xml_path(str(robot.model_path))
q = robot.home + (robot.upper[1] + 0.05 - robot.home[1]) * np.eye(6)[1]
stay = mink.PostureTask(model, cost=1.0, gain=0.1)
stay.set_target(q)
speeds = dict(zip(robot.joint_names, robot.max_velocity, strict=True))
theirs = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
try:
    mink.solve_ik(mink.Configuration(model, q), [stay], DT, "daqp", limits=theirs)
except mink.NoSolutionFound as error:
    print(f"mink's own limits: NoSolutionFound ({error})")


def report(name: str, speed: list[float], end: float) -> None:
    most = f"{-min(speed):.3f} rad/s and {np.abs(np.diff(speed)).max() / DT:.1f} rad/s²"
    print(f"{name}: ends {1e3 * (robot.upper[1] - end):.2f} mrad inside, with at most {most}")


configuration, danger, qd, speed = mink.Configuration(model, q), DangerMonitor(robot, DT), np.zeros(6), [0.0]
for _ in range(250):
    danger.update(configuration.q, qd, points=[])
    qd = mink.solve_ik(configuration, [stay], DT, "daqp", limits=[JointLimit(danger)])
    configuration.integrate_inplace(qd, DT)
    speed.append(qd[1])
report("JointLimit in mink", speed, configuration.q[1])
controller, qd, speed = qpsafe.SafetyController(robot, [qpsafe.PostureTask(q)]), np.zeros(6), [0.0]
for _ in range(250):
    tick = controller.step(q, qd, points=[])
    q, qd = tick.reference.q, tick.reference.qd
    speed.append(qd[1])
report("SafetyController", speed, q[1])
