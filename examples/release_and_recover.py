"""Something comes close and goes again: tasks are released one by one, and taken up again in reverse order."""

import numpy as np

import qpsafe

robot = qpsafe.load_robot("irb140")
here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
controller = qpsafe.SafetyController(robot, tasks)

times = (0.0, 0.5, 3.0, 4.5, 7.0)  # [s]
gaps = (1.1, 1.1, 0.2, 0.2, 1.1)  # [m] between the obstacle and the place of the tool's tip

q, qd, last = robot.home, np.zeros(6), ""
print("time [s]  danger  CDF_n   position error [mm]  orientation error [rad]  phase")
for k in range(2500):  # 10 s
    gap = np.interp(k * controller.dt, times, gaps)
    tick = controller.step(q, qd, points=[here.pose[:3, 3] + [gap, 0.0, 0.1]])
    q, qd = tick.reference.q, tick.reference.qd  # a robot that follows perfectly
    if (tick.regime, tick.phase) != last:
        last = (tick.regime, tick.phase)
        position, orientation = (np.linalg.norm(error) for error in tick.errors)
        print(
            f"{tick.reference.time:8.2f}  {tick.regime:6}  {tick.cdf_n:5.2f}   {1e3 * position:19.2f}"
            f"  {orientation:23.4f}  {tick.phase}"
        )
position, orientation = (np.linalg.norm(error) for error in tick.errors)
print(f"at the end: {1e3 * position:.3f} mm, {orientation:.5f} rad")
