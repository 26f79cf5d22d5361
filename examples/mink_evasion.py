"""A swinging tool in mink makes way for a hand. Run: python examples/mink_evasion.py [--steps 3000, for no viewer]."""

import sys
import time
from itertools import count, takewhile

import mink
import mujoco.viewer
import numpy as np

import qpsafe
from qpsafe.plugins.mink import DangerLimit, DangerMonitor, EvasiveTask, JointLimit

DT, robot = 0.004, qpsafe.load_robot("irb140")
spec = mujoco.MjSpec.from_file(str(robot.model_path))
spec.worldbody.add_body(name="hand", mocap=True).add_geom(size=[0.05, 0, 0], rgba=[0.8, 0.3, 0.2, 1])
configuration, start = mink.Configuration(spec.compile(), q=robot.home), robot.pose("tcp", robot.home)

frame = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=0.3, gain=0.05)
danger = DangerMonitor(robot, DT)
tasks = [frame, mink.DampingTask(configuration.model, 0.01), EvasiveTask(danger)]
limits, qd = [JointLimit(danger), DangerLimit(danger, delta_max=12.0)], np.zeros(6)

steps = int(sys.argv[2]) if sys.argv[1:2] == ["--steps"] else None
viewer = None if steps else mujoco.viewer.launch_passive(configuration.model, configuration.data)
for k in takewhile(lambda k: viewer.is_running() if viewer else k < steps, count()):
    target = start[:3, 3] + [0.0, 0.2 * np.sin(0.5 * np.pi * k * DT), 0.0]
    gap = np.interp(k * DT % 14.0, (4.0, 6.0, 10.0, 12.0), (1.2, 0.25, 0.25, 1.2))
    hand = configuration.data.mocap_pos[0] = start[:3, 3] + [0.05, gap, 0.05]
    frame.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(start[:3, :3]), target))
    danger.update(configuration.q, qd, [hand])
    qd = mink.solve_ik(configuration, tasks, DT, "daqp", limits=limits)
    configuration.integrate_inplace(qd, DT)
    if k % 250 == 0:
        tool = configuration.get_transform_frame_to_world("tcp", "site").translation()
        off, near = np.linalg.norm(tool - target), np.linalg.norm(tool - hand)
        print(f"{k * DT:5.1f} s: hand at {near:.2f} m, danger {danger.cdf_n:5.2f}, tool {1e3 * off:3.0f} mm off")
    if viewer:
        viewer.sync()
        time.sleep(DT)
