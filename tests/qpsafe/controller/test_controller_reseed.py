"""`reseed`: the commanded configuration is the next measured one; the path waits where it was, and is returned to."""

import numpy as np

import qpsafe
from qpsafe.sim.experiments.path.experiment import PROGRAM
from qpsafe.tasks.reach import joints_for


def test_it_starts_at_the_measured_pose_and_the_path_goes_on_from_where_it_was() -> None:
    robot = qpsafe.load_robot("irb140")
    program = qpsafe.load_program(PROGRAM, robot)
    task = qpsafe.PositionTask("tcp", program)
    controller = qpsafe.SafetyController(robot, [task])
    q = joints_for(robot, "tcp", program.sample(0.0).pose, robot.home)
    qd, free = np.zeros(6), np.full(20, np.inf)
    for _ in range(250):
        tick = controller.step(q, qd, free)
        q, qd = tick.reference.q, tick.reference.qd
    before = tick.path_time
    assert before > 0.5

    controller.reseed()
    moved = q + 0.05  # somebody jogged the robot
    tick = controller.step(moved, np.zeros(6), free)
    assert np.abs(tick.reference.q - moved).max() <= (robot.max_acceleration * 0.004**2).max()
    assert abs(tick.path_time - before) <= 0.004
    assert tick.phase != "following"
    last = tick.reference
    for _ in range(1500):
        tick = controller.step(last.q, last.qd, free)
        change = np.abs(tick.reference.qd - last.qd)
        assert (change <= robot.max_acceleration * 0.004 * (1.0 + 1e-9)).all()
        last = tick.reference
        if tick.phase == "following":
            break
        assert abs(tick.path_time - before) <= 0.004  # the path waits for the robot
    assert tick.phase == "following"
    goal = program.sample(tick.path_time).pose[:3, 3]
    assert np.linalg.norm(robot.pose("tcp", last.q)[:3, 3] - goal) < 1e-3
