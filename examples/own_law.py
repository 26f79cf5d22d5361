"""A law of your own: anything with `solve(problem)`. This one never evades: it slows down with danger, and stops."""

import numpy as np

import qpsafe


class SlowDownLaw:
    """q̇ = a_N q̇_task: full speed in low danger, standstill from where the lowest task is released completely."""

    def solve(self, problem: qpsafe.LawProblem) -> qpsafe.LawResult:
        """Scale the task's joint velocity, all joints by one factor so that the tool stays on its line."""
        J = np.vstack([task.jacobian for task in problem.tasks])
        xd = np.concatenate([task.velocity for task in problem.tasks])
        qd = problem.activations[-1] * (np.linalg.pinv(J) @ xd)
        if problem.lower is not None and problem.upper is not None:
            room = np.where(qd > 0.0, problem.upper, -problem.lower)  # towards where each joint moves
            qd = qd * np.clip(room / np.maximum(np.abs(qd), 1e-12), 0.0, 1.0).min()
            qd = np.clip(qd, problem.lower, problem.upper)  # where a joint has to brake at once
        return qpsafe.LawResult(qd)


robot = qpsafe.load_robot("irb140")
goal = robot.pose("tcp", robot.home)
goal[0, 3] += 0.1  # 10 cm forward
tasks = [kind("tcp", qpsafe.FixedPose(goal)) for kind in (qpsafe.PositionTask, qpsafe.OrientationTask)]

for gap in (1.2, 0.6, 0.5):
    controller = qpsafe.SafetyController(robot, tasks, law=SlowDownLaw())
    q, qd = robot.home, np.zeros(6)
    for _ in range(250):  # 1 s
        tick = controller.step(q, qd, points=[goal[:3, 3] + [gap, 0.0, 0.0]])
        q, qd = tick.reference.q, tick.reference.qd
    moved = 1e3 * (robot.pose("tcp", q) - robot.pose("tcp", robot.home))[0, 3]
    print(f"obstacle {gap:.2f} m beyond the goal: {tick.regime:6} danger, moved {moved:4.1f} mm in 1 s, {tick.status}")
