"""A robot asks over EGM, a controller answers: both on this computer. Run: python examples/stream_over_egm.py."""

import socket
import threading

import numpy as np

import qpsafe
from qpsafe.irc5.messages import RobotPacket, decode_sensor, encode_robot
from qpsafe.irc5.streamer import EgmStreamer

robot = qpsafe.load_robot("irb140")
limits = qpsafe.JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, dt=0.004)
goal = robot.pose("tcp", robot.home).copy()
goal[2, 3] -= 0.05  # 5 cm down
controller = qpsafe.SafetyController(robot, [qpsafe.PositionTask("tcp", qpsafe.FixedPose(goal))])


def simulated_robot(address: tuple[str, int], cycles: int) -> None:
    """Says where it is, hears where to go, and is there at the next cycle."""
    wire, q = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), robot.home
    for k in range(cycles):
        wire.sendto(encode_robot(RobotPacket(seq=k, time_ms=4 * k, q=q, clock=0.004 * k)), address)
        q = decode_sensor(wire.recv(4096), robot.nq).q_ref
    print("the robot's tool is at [m]:", np.round(robot.pose("tcp", q)[:3, 3], 4))


with EgmStreamer(limits, port=0) as streamer:  # a real robot: host="its network", port=6510
    threading.Thread(target=simulated_robot, args=(streamer.address, 750)).start()
    while (cycle := streamer.wait(1.0)) is not None:
        if cycle.seeded:
            controller.reset()  # from where the robot is
        tick = controller.step(cycle.packet.q, cycle.qd, points=[])
        streamer.answer(tick.reference)
print("it was sent to [m]:        ", np.round(goal[:3, 3], 4))
print(dict(streamer.counts))
