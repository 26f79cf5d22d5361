"""A loop of pink makes way for a hand: two tasks, one limit more. Run: python examples/pink_evasion.py."""

import numpy as np
import pink
import pinocchio as pin

import qpsafe
from qpsafe.plugins.pink import DangerLimit, DangerMonitor, EvasiveTask, JointLimit, ReleasableTask

DT, robot = 0.004, qpsafe.load_robot("irb140")
model, home = robot.model, robot.pose("tcp", robot.home)  # pink works on the same pinocchio model
configuration, qd = pink.Configuration(model, model.createData(), robot.home), np.zeros(6)

position = pink.tasks.FrameTask("tcp", position_cost=1.0, orientation_cost=0.0, gain=0.02)
orientation = pink.tasks.FrameTask("tcp", position_cost=0.0, orientation_cost=0.3, gain=0.02)
for task in (position, orientation):
    task.set_target(pin.SE3(home))
danger = DangerMonitor(robot, DT)
tasks = [position, ReleasableTask(orientation, danger), EvasiveTask(danger)]  # the orientation gives way first
limits = [JointLimit(danger), DangerLimit(danger, delta_max=12.0)]

print("time [s]  hand [m]  danger CDF_n  m     f     tool off [mm]  turned [mrad]")
for k in range(2500):  # 10 s
    gap = np.interp(k * DT, (1.0, 3.0, 5.0, 6.5), (1.4, 0.3, 0.3, 1.4))
    danger.update(configuration.q, qd, [home[:3, 3] + [gap, 0.0, 0.1]])
    qd = pink.solve_ik(configuration, tasks, DT, solver="daqp", limits=limits)
    configuration.integrate_inplace(qd, DT)
    if k % 125 == 0:
        off = pin.SE3(home).actInv(configuration.get_transform_frame_to_world("tcp"))
        m, f = danger.switches
        print(
            f"{k * DT:8.2f}  {gap:8.2f}  {danger.cdf_n:12.2f}  {m:.2f}  {f:.2f}"
            f"  {1e3 * np.linalg.norm(off.translation):13.1f}  {1e3 * np.linalg.norm(pin.log3(off.rotation)):13.1f}"
        )
