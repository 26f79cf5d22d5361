"""Others' EGM code in a process of its own, since their modules collide: python egm_peer.py NAME pc|robot N [PORT].

As a PC it lets the package's own client receive and answer N packets, echoing what it read; it prints its port first.
As a robot it builds N packets with the package's message module, sends them to a port, and reads the answers with it.
"""

from __future__ import annotations

import importlib
import json
import socket
import sys
from typing import Any

#: Name -> modules of the client and of its messages.
PEERS = {
    "ABBRobotEGM": ("ABBRobotEGM", "ABBRobotEGM._egm_protobuf.egm_pb2"),
    "abb-robot-client": ("abb_robot_client.egm", "abb_robot_client._egm_protobuf.egm_pb2"),
}


def act_as_pc(client_module: Any, exchanges: int) -> None:
    client = client_module.EGM(port=0)
    print(client.socket.getsockname()[1], flush=True)
    for _ in range(exchanges):
        received, state = client.receive_from_robot(timeout=20)
        assert received
        said = state.robot_message
        echo = [
            float(state.motors_on),
            float(state.rapid_running),
            float(said.mciState.state),
            float(said.header.seqno % 1000),
            float(said.feedBack.time.usec),
            float(said.mciConvergenceMet),
        ]
        assert list(state.joint_angles_planned) == list(state.joint_angles)
        assert client.send_to_robot(state.joint_angles, speed_ref=echo)


def act_as_robot(wire: Any, exchanges: int, port: int) -> None:
    robot = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    robot.settimeout(20)
    joints = [0.0, -5.0, 0.0, 0.0, 85.0, 0.0]
    for k in range(exchanges):
        said = wire.EgmRobot()
        said.header.seqno, said.header.tm = k, 4 * k
        said.header.mtype = wire.EgmHeader.MSGTYPE_DATA
        said.feedBack.joints.joints.extend(joints)
        pose = said.feedBack.cartesian
        pose.pos.x, pose.pos.y, pose.pos.z = 450.0, 0.0, 540.0
        pose.orient.u0, pose.orient.u1, pose.orient.u2, pose.orient.u3 = 0.0, 0.0, 1.0, 0.0
        said.feedBack.time.sec, said.feedBack.time.usec = divmod(1_700_000_000_000_000 + 4000 * k, 1_000_000)
        said.planned.joints.joints.extend(joints)
        said.motorState.state = wire.EgmMotorState.MOTORS_ON
        said.mciState.state = wire.EgmMCIState.MCI_RUNNING
        said.rapidExecState.state = wire.EgmRapidCtrlExecState.RAPID_RUNNING
        said.mciConvergenceMet = True
        said.testSignals.signals.extend([1.0, 2.0])
        said.measuredForce.force.extend([0.0] * 6)
        said.utilizationRate = 12.5
        said.moveIndex = 3
        said.RAPIDfromRobot.dnum.extend([float(k)])
        robot.sendto(said.SerializeToString(), ("127.0.0.1", port))
        heard = wire.EgmSensor.FromString(robot.recv(65536))
        assert heard.header.mtype == wire.EgmHeader.MSGTYPE_CORRECTION
        assert heard.header.seqno == k
        assert len(heard.planned.joints.joints) == len(heard.speedRef.joints.joints) == 6
        joints = list(heard.planned.joints.joints)
    print(json.dumps(joints))


if __name__ == "__main__":
    name, role, count, *rest = sys.argv[1:]
    client_name, wire_name = PEERS[name]
    if role == "pc":
        act_as_pc(importlib.import_module(client_name), int(count))
    else:
        act_as_robot(importlib.import_module(wire_name), int(count), int(rest[0]))
