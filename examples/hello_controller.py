"""One tick of the controller: a hand is 25 cm in front of the tool. Run: python examples/hello_controller.py."""

import numpy as np

import qpsafe

robot = qpsafe.load_robot("irb140")
q, qd = robot.home, np.zeros(6)  # measured joint positions [rad] and speeds [rad/s]

here = qpsafe.FixedPose(robot.pose("tcp", q))  # the task: keep the tool's tip where it is,
tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]  # position before orientation
controller = qpsafe.SafetyController(robot, tasks)

hand = here.pose[:3, 3] + [0.25, 0.0, 0.0]  # world frame [m]
for _ in range(50):  # 0.2 s at 250 Hz
    tick = controller.step(q, qd, points=[hand])
    q, qd = tick.reference.q, tick.reference.qd  # a robot that follows perfectly

print(tick.explain())
print("tool moved [mm]:", np.round(1e3 * (robot.pose("tcp", q) - here.pose)[:3, 3], 2))
