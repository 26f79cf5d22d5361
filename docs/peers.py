"""The same troubles given to mink, pink, placo and qpsafe: python docs/peers.py [--placo PYTHON].

Writes docs/data/peers.json. placo pins a pinocchio of its own, so it runs in another environment's Python (pip install
placo there); without `--placo` its last figures stay.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

DT = 0.004
FILE = Path(__file__).resolve().parent / "data" / "peers.json"
Array = np.ndarray

#: What is tried: name -> (how far joint 2 starts beyond its limit [rad], how the target is changed, ticks).
OUTSIDE, JUMP, BEYOND, UNREADABLE = "outside", "jump", "beyond", "unreadable"
TICKS = {OUTSIDE: 500, JUMP: 750, BEYOND: 3000, UNREADABLE: 20}
#: Tick of the jump, and of the unreadable measurement.
WHEN = 10


class Mink:
    """A frame task under mink's limits of position and velocity."""

    def __init__(self, robot: Any, q: Array, target: Array) -> None:
        import mink
        import mujoco

        self.mink, self.model = mink, mujoco.MjModel.from_xml_path(str(robot.model_path))
        self.configuration = mink.Configuration(self.model, q=np.array(q))
        self.task = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=1.0, gain=0.1)
        speeds = dict(zip(robot.joint_names, robot.max_velocity, strict=True))
        self.limits = [mink.ConfigurationLimit(self.model), mink.VelocityLimit(self.model, speeds)]

    def step(self, q: Array, qd: Array, target: Array) -> Array:
        """Joint velocity for a measured position."""
        self.task.set_target(self.mink.SE3.from_matrix(target))
        self.configuration.update(q)
        return self.mink.solve_ik(self.configuration, [self.task], DT, "daqp", limits=self.limits)


class Pink:
    """The same in pink."""

    def __init__(self, robot: Any, q: Array, target: Array) -> None:
        import pink
        import pinocchio as pin

        self.pink, self.pin, model = pink, pin, pin.Model(robot.model)
        model.velocityLimit = robot.max_velocity.copy()
        model.lowerPositionLimit, model.upperPositionLimit = robot.lower.copy(), robot.upper.copy()
        self.configuration = pink.Configuration(model, model.createData(), np.array(q))
        self.task = pink.tasks.FrameTask("tcp", position_cost=1.0, orientation_cost=1.0, gain=0.1)

    def step(self, q: Array, qd: Array, target: Array) -> Array:
        """Joint velocity for a measured position."""
        self.task.set_target(self.pin.SE3(target))
        self.configuration.update(np.array(q))
        return self.pink.solve_ik(self.configuration, [self.task], DT, "daqp", safety_break=False)


class PinkAccelerated(Pink):
    """Pink with its acceleration limit beside the other two."""

    def __init__(self, robot: Any, q: Array, target: Array) -> None:
        super().__init__(robot, q, target)
        model = self.configuration.model
        self.acceleration = self.pink.limits.AccelerationLimit(model, robot.max_acceleration.copy())
        self.limits = [
            self.pink.limits.ConfigurationLimit(model),
            self.pink.limits.VelocityLimit(model),
            self.acceleration,
        ]

    def step(self, q: Array, qd: Array, target: Array) -> Array:
        """Joint velocity for a measured position."""
        self.task.set_target(self.pin.SE3(target))
        self.configuration.update(np.array(q))
        self.acceleration.set_last_integration(qd, DT)
        tasks = [self.task]
        return self.pink.solve_ik(self.configuration, tasks, DT, "daqp", limits=self.limits, safety_break=False)


class Qpsafe:
    """The controller, nobody in sight; position before orientation, each with the others' gain."""

    def __init__(self, robot: Any, q: Array, target: Array) -> None:
        self.robot, self.target = robot, np.array(target)
        import qpsafe

        self.qpsafe = qpsafe
        self.controller = qpsafe.SafetyController(robot, self.tasks(target))

    def tasks(self, target: Array) -> list[Any]:
        """A task for a pose."""
        goal = self.qpsafe.FixedPose(target)
        gain = 0.1 / DT
        return [self.qpsafe.PositionTask("tcp", goal, gain=gain), self.qpsafe.OrientationTask("tcp", goal, gain=gain)]

    def step(self, q: Array, qd: Array, target: Array) -> Array:
        """Joint velocity for a measured position."""
        if not np.array_equal(target, self.target):
            self.controller.set_tasks(self.tasks(target))
            self.target = np.array(target)
        return self.controller.step(q, qd, points=[]).reference.qd


def run(peer: Any, trouble: str, q: Array, pose: Array, a_max: Array) -> dict[str, Any]:
    """One trouble: what comes of it, in plain figures; a robot that follows perfectly.

    Args:
        peer: Made for this run.
        trouble: A key of `TICKS`.
        q: Start (n,) [rad].
        pose: First target (4, 4).
        a_max: Largest accelerations (n,) [rad/s²].
    """
    q, qd, speeds, target = q.copy(), np.zeros(len(q)), [np.zeros(len(q))], pose
    for k in range(TICKS[trouble]):
        if trouble == BEYOND or (trouble == JUMP and k == WHEN):
            target = pose.copy()
            target[0, 3] += {BEYOND: 1.0, JUMP: 0.15}[trouble]
        measured = q * np.nan if trouble == UNREADABLE and k == WHEN else q
        try:
            qd = np.asarray(peer.step(measured, qd, target), dtype=float)
        except Exception as error:  # whatever it is: this is what is asked
            return {"raises": type(error).__name__, "tick": k}
        speeds.append(qd)
        if not np.isfinite(qd).all():
            return {"sends": "NaN", "tick": k}
        q = q + qd * DT
    v = np.array(speeds)
    last = v[-round(1.0 / DT) :]
    return {
        "fastest": round(float(np.abs(v).max()), 3),
        "acceleration": round(float(np.abs(np.diff(v, axis=0) / DT / a_max).max()), 2),
        "last": round(float(np.abs(last).max()), 3),
        "reversals": int(((last[1:] * last[:-1] < 0.0) & (np.abs(last[1:]) > 0.01)).sum()),
    }


def troubles(make: Callable[[Array, Array], Any], given: dict[str, Any]) -> dict[str, Any]:
    """Every trouble for one library.

    Args:
        make: The library from a start and a target.
        given: Plain figures of the robot, see `given_of`.
    """
    a_max, home, out = np.array(given["a_max"]), np.array(given["home"]), np.array(given["out"])
    found = {}
    for trouble in TICKS:
        q, pose = (out, np.array(given["out_pose"])) if trouble == OUTSIDE else (home, np.array(given["pose"]))
        found[trouble] = run(make(q, pose), trouble, q, pose, a_max)
    return found


def given_of(robot: Any) -> dict[str, Any]:
    """What every library is given: home, a start 20 mrad beyond joint 2's limit, their poses, limits, a URDF."""
    from peers_placo import urdf_of

    out = robot.home.copy()
    out[1] = robot.upper[1] + 0.02
    return {
        "home": robot.home.tolist(),
        "out": out.tolist(),
        "pose": robot.pose("tcp", robot.home).tolist(),
        "out_pose": robot.pose("tcp", out).tolist(),
        "a_max": robot.max_acceleration.tolist(),
        "urdf": urdf_of(robot),
    }


def damped(robot: Any, given: dict[str, Any]) -> dict[str, float]:
    """mink's largest joint speed in the last second beyond reach, by Levenberg-Marquardt damping [rad/s].

    Args:
        robot: The robot.
        given: See `given_of`.
    """
    found, home, pose = {}, np.array(given["home"]), np.array(given["pose"])
    for damping in (0.1, 1.0):
        peer = Mink(robot, home, pose)
        peer.task.lm_damping = damping
        found[f"{damping:g}"] = run(peer, BEYOND, home, pose, np.array(given["a_max"]))["last"]
    return found


def main() -> None:
    """Run them all."""
    import qpsafe

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--placo", help="a Python that has placo")
    python = parser.parse_args().placo
    robot = qpsafe.load_robot("irb140")
    given = given_of(robot)
    before = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    found = {"placo": before["placo"]} if "placo" in before and not python else {}
    for name, kind, package in (
        ("mink", Mink, "mink"),
        ("pink", Pink, "pin-pink"),
        ("pink, `AccelerationLimit`", PinkAccelerated, "pin-pink"),
        ("qpsafe", Qpsafe, "qpsafe"),
    ):
        done = troubles(lambda q, pose, kind=kind: kind(robot, q, pose), given)
        found[name] = {"version": version(package), **done}
    found["mink"]["damped"] = damped(robot, given)
    from qpsafe.text.json_text import json_text

    if python:
        script = Path(__file__).with_name("peers_placo.py")
        done = subprocess.run([python, script], input=json_text(given), capture_output=True, text=True, check=True)
        found["placo"] = json.loads(done.stdout.splitlines()[-1])
    FILE.write_text(json_text(found) + "\n", encoding="utf-8")
    print(json_text(found))


if __name__ == "__main__":
    sys.exit(main())
