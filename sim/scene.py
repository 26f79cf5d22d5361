"""The world in MuJoCo: the robot on its pedestal, the floor, the person and the board, light and camera.

The robot's own file holds the robot only; it is attached here. The person and the board are mocap bodies, one per
segment: they are put where the choreography says and push nothing. Geometry groups: 0 floor and pedestal, 1 person and
board (what the distance sensors see), 2 and 3 the robot as seen and as it collides. Names of the robot's file have the
prefix "robot/".

World frame = robot base frame; the floor lies a pedestal's height below it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.anatomy import CARDBOARD, SEGMENTS
from qpsafe.sim.person import Board, Person, PersonPose
from qpsafe.sim.surroundings import CAMERA, SCENERY, add_surroundings

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

__all__ = ["CAMERA", "PERSON", "ROBOT_COLLISION", "ROBOT_VISUAL", "SCENERY", "Scene", "build_scene"]

PERSON, ROBOT_VISUAL, ROBOT_COLLISION = 1, 2, 3  # geometry groups


@dataclass(frozen=True)
class Scene:
    """A compiled world and the addresses of what is in it.

    Attributes:
        model: The MuJoCo model; share it, make one `MjData` a run with `make_data`.
        robot: The robot that was built in.
        person: Kinematics of the person, with this scene's floor and board.
        q_addresses: Of the robot's joints in `qpos`, in `robot.joint_names` order, (n,).
        v_addresses: The same in `qvel`, (n,).
        actuators: Actuator of each joint, (n,).
        robot_geoms: Collision geoms of the robot (group 3).
        person_geoms: Geom of each segment, in the order of `SEGMENTS`, (17,).
        board_geom: Geom of the board.
        tcp_site: Site at the tip of the tool, -1 if the robot has none.
        pedestal: Height of the robot's base above the floor [m].
    """

    model: Any
    robot: Robot
    person: Person
    q_addresses: NDArray[np.intp]
    v_addresses: NDArray[np.intp]
    actuators: NDArray[np.intp]
    robot_geoms: NDArray[np.intp]
    person_geoms: NDArray[np.intp]
    board_geom: int
    tcp_site: int
    pedestal: float

    def make_data(self, q: NDArray[np.float64] | None = None) -> Any:
        """Fresh MjData: the robot at rest at q (default its home), the person far away, kinematics computed."""
        data = mujoco.MjData(self.model)
        data.qpos[self.q_addresses] = self.robot.home if q is None else q
        mujoco.mj_forward(self.model, data)
        return data

    def place_person(self, data: Any, pose: PersonPose) -> None:
        """Put the person and the board where `pose` says and bring all geom poses up to date."""
        data.mocap_pos[:-1], data.mocap_quat[:-1] = pose.positions, pose.quaternions
        data.mocap_pos[-1], data.mocap_quat[-1] = pose.board_position, pose.board_quaternion
        mujoco.mj_kinematics(self.model, data)


def build_scene(
    robot: Robot,
    *,
    timestep: float = 0.001,
    pedestal: float = 0.55,
    board: Board | None = None,
    contacts: bool = False,
    furnish: Callable[[Any], None] | None = None,
) -> Scene:
    """Build the world around a robot.

    Args:
        robot: From `load_robot`; its model needs one motor per joint, named like the joint.
        timestep: Of the physics [s].
        pedestal: Height of the robot's base above the floor [m].
        board: Size of the card board and how it is held.
        contacts: Whether the robot can touch itself and the floor. Off by default: a run that relies on touching has
            failed anyway. The person never touches anything.
        furnish: Adds more to the `mujoco.MjSpec` before it is compiled, e.g. `Cell.furnish`.

    Returns:
        The scene.

    Raises:
        ConfigurationError: A value is out of range, or the robot's model lacks a joint or a motor.
    """
    if not (math.isfinite(timestep) and 0.0 < timestep <= 0.004):
        raise ConfigurationError("build_scene", "timestep", timestep, "0 to 0.004 s")
    if not (math.isfinite(pedestal) and 0.0 < pedestal <= 2.0):
        raise ConfigurationError("build_scene", "pedestal", pedestal, "0 to 2 m")
    person = Person(floor=-pedestal, board=board or Board())
    spec = mujoco.MjSpec()
    spec.modelname = f"{robot.name} and a person"
    _set_options(spec, timestep, contacts)
    add_surroundings(spec, pedestal)
    _add_person(spec, person)
    spec.attach(mujoco.MjSpec.from_file(str(robot.model_path)), prefix="robot/", frame=spec.worldbody.add_frame())
    if furnish is not None:
        furnish(spec)
    model = spec.compile()

    joints = [_find(model, mujoco.mjtObj.mjOBJ_JOINT, name, robot) for name in robot.joint_names]
    return Scene(
        model=model,
        robot=robot,
        person=person,
        q_addresses=model.jnt_qposadr[joints].astype(np.intp),
        v_addresses=model.jnt_dofadr[joints].astype(np.intp),
        actuators=np.array([_find(model, mujoco.mjtObj.mjOBJ_ACTUATOR, n, robot) for n in robot.joint_names], np.intp),
        robot_geoms=np.flatnonzero(model.geom_group == ROBOT_COLLISION),
        person_geoms=np.array([model.geom(f"person/{segment.name}").id for segment in SEGMENTS], np.intp),
        board_geom=int(model.geom("person/board").id),
        tcp_site=int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "robot/tcp")),
        pedestal=pedestal,
    )


def _find(model: Any, kind: Any, name: str, robot: Robot) -> int:
    index = mujoco.mj_name2id(model, kind, f"robot/{name}")
    if index < 0:
        what = "a joint" if kind == mujoco.mjtObj.mjOBJ_JOINT else "a motor"
        raise ConfigurationError(robot.model_path, name, None, f"{what} of this name in the robot's model")
    return int(index)


def _set_options(spec: Any, timestep: float, contacts: bool) -> None:
    option = spec.option
    option.timestep = timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # MuJoCo 4.0.0 can compute wrong Newton accelerations with a sparse constraint Jacobian; 4.0.1 does not.
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # Bad values shall fail the run, not reset it silently.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if not contacts:
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT


def _add_person(spec: Any, person: Person) -> None:
    """One mocap body per segment, then the board, all far away until they are placed."""
    looks = {"group": PERSON, "contype": 0, "conaffinity": 0}
    for i, segment in enumerate(SEGMENTS):
        body = spec.worldbody.add_body(name=f"person/{segment.name}", mocap=True, pos=[50.0 + i, 0.0, 0.0])
        body.add_geom(
            name=f"person/{segment.name}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[segment.radius, segment.length / 2, 0.0],
            rgba=segment.colour,
            **looks,
        )
    body = spec.worldbody.add_body(name="person/board", mocap=True, pos=[49.0, 0.0, 0.0])
    board = person.board
    body.add_geom(
        name="person/board",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[board.thickness / 2, board.width / 2, board.height / 2],
        rgba=CARDBOARD,
        **looks,
    )
