"""Seven joints, low danger: the elbow makes way and the tool stays. Run: python examples/redundant_elbow.py."""

import numpy as np

import qpsafe

robot = qpsafe.load_robot("iiwa14")
here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]  # six rows of seven
evasion = qpsafe.Evasion(mass=0.4, damping=2.0, n=robot.nq)  # lighter than the default: it answers to little danger
controller = qpsafe.SafetyController(robot, tasks, evasion=evasion)

q, qd, worst = robot.home, np.zeros(robot.nq), np.zeros(2)
print("time [s]  danger  CDF_n  person to elbow [m]  tool off [mm]  turned [mrad]")
for k in range(3000):  # 12 s
    side = np.interp(k * controller.dt, (1.0, 4.0), (2.0, 1.15))  # somebody comes near the elbow, from the left
    person = np.array([0.177, side, 0.741])
    tick = controller.step(q, qd, points=[person])
    q, qd = tick.reference.q, tick.reference.qd  # a robot that follows perfectly
    errors = [np.linalg.norm(task.error(robot.pose("tcp", q), here.sample(0.0))) for task in tasks]
    worst = np.maximum(worst, errors)
    if k % 250 == 0:
        elbow = np.linalg.norm(robot.pose("dh3", q)[:3, 3] - person)
        print(
            f"{tick.reference.time:8.1f}  {tick.regime:6}  {tick.cdf_n:5.2f}  {elbow:19.3f}"
            f"  {1e3 * errors[0]:13.4f}  {1e3 * errors[1]:13.4f}"
        )
print(f"tool never off by more than {1e3 * worst[0]:.3f} mm and {worst[1]:.6f} rad")
