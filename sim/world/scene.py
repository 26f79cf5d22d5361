"""The world in MuJoCo: the robot on its pedestal, the floor, people with or without a board, light and camera.

The robot's own file holds the robot only; it is attached here. People and boards are mocap bodies, one per segment:
they are put where the choreography or the story says and push nothing. Geometry groups: 0 floor and pedestal, 1 people
and boards (what the distance sensors see), 2 and 3 the robot as seen and as it collides, whatever its file says of
groups. Names of the robot's file have the prefix "robot/".

World frame = robot base frame; the floor lies a pedestal's height below it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.robot.models.mjcf import held_positions
from qpsafe.sim.people.anatomy import CARDBOARD
from qpsafe.sim.people.person import Board, Person, PersonPose
from qpsafe.sim.world.robot_spec import ROBOT_COLLISION, ROBOT_VISUAL, robot_spec
from qpsafe.sim.world.surroundings import CAMERA, SCENERY, add_surroundings

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

__all__ = ["CAMERA", "PERSON", "ROBOT_COLLISION", "ROBOT_VISUAL", "SCENERY", "Scene", "build_scene"]

PERSON = 1  # geometry group


@dataclass(frozen=True)
class Scene:
    """A compiled world and the addresses of what is in it.

    Attributes:
        model: The MuJoCo model; share it, make one `MjData` a run with `make_data`.
        robot: The robot that was built in.
        people: Kinematics of everybody, with this scene's floor.
        q_addresses: Of the robot's joints in `qpos`, in `robot.joint_names` order, (n,).
        v_addresses: The same in `qvel`, (n,).
        actuators: Actuator of each joint, (n,).
        robot_geoms: Collision geoms of the robot (group 3).
        person_geoms: Geom of each segment of everybody, person by person in the order of `SEGMENTS`, (17 p,).
        board_geoms: Geom of each board, (b,).
        tcp_site: Site at the tip of the (first) tool, z pointing out of it, -1 if the robot has none.
        pedestal: Height of the robot's base above the floor [m].
        said: What the robot's model lacked and was given, in words.
    """

    model: Any
    robot: Robot
    people: tuple[Person, ...]
    q_addresses: NDArray[np.intp]
    v_addresses: NDArray[np.intp]
    actuators: NDArray[np.intp]
    robot_geoms: NDArray[np.intp]
    person_geoms: NDArray[np.intp]
    board_geoms: NDArray[np.intp]
    tcp_site: int
    pedestal: float
    said: tuple[str, ...] = ()

    def make_data(self, q: NDArray[np.float64] | None = None) -> Any:
        """Fresh MjData: the robot at rest at q (default its home), the person far away, kinematics computed."""
        data = mujoco.MjData(self.model)
        addresses, values = held_positions(self.model, self.robot.held, "robot/")
        data.qpos[addresses] = values
        data.qpos[self.q_addresses] = self.robot.home if q is None else q
        mujoco.mj_forward(self.model, data)
        return data

    @property
    def person(self) -> Person:
        """The first person."""
        return self.people[0]

    @property
    def board_geom(self) -> int:
        """Geom of the first board, -1 if there is none."""
        return int(self.board_geoms[0]) if len(self.board_geoms) else -1

    def place_people(self, data: Any, poses: Sequence[PersonPose]) -> None:
        """Put everybody, in the order of `people`, and their boards where the poses say; all geom poses are updated."""
        at = self._mocap
        for pose in poses:
            data.mocap_pos[at : at + 17], data.mocap_quat[at : at + 17] = pose.positions, pose.quaternions
            at += 17
            if pose.board_position is not None:
                data.mocap_pos[at], data.mocap_quat[at] = pose.board_position, pose.board_quaternion
                at += 1
        mujoco.mj_kinematics(self.model, data)

    def place_person(self, data: Any, pose: PersonPose) -> None:
        """Put the first person and the board where `pose` says and bring all geom poses up to date."""
        self.place_people(data, (pose,))

    @property
    def _mocap(self) -> int:
        """First mocap body of the people; theirs follow one another."""
        return int(self.model.body_mocapid[self.model.geom_bodyid[self.person_geoms[0]]]) if self.people else 0


def build_scene(
    robot: Robot,
    *,
    timestep: float = 0.001,
    pedestal: float = 0.55,
    board: Board | None = None,
    contacts: bool = False,
    furnish: Callable[[Any], None] | None = None,
    people: Sequence[Person] | None = None,
) -> Scene:
    """Build the world around a robot.

    Args:
        robot: From `load_robot`. What its model lacks, motors for example, is added; `Scene.said` names it.
        timestep: Of the physics [s].
        pedestal: Height of the robot's base above the floor [m].
        board: Size of the card board and how it is held, for the one person of the paper's experiments.
        contacts: Whether the robot can touch itself and the floor. Off by default: a run that relies on touching has
            failed anyway. People never touch anything.
        furnish: Adds more to the `mujoco.MjSpec` before it is compiled, e.g. `Cell.furnish`.
        people: Who is there, each with a board or without; by default one person with `board`. Floors are set here.

    Returns:
        The scene.

    Raises:
        ConfigurationError: A value is out of range, or the robot's model lacks a joint or a motor.
    """
    if not (math.isfinite(timestep) and 0.0 < timestep <= 0.004):
        raise ConfigurationError("build_scene", "timestep", timestep, "0 to 0.004 s")
    if not (math.isfinite(pedestal) and 0.0 < pedestal <= 2.0):
        raise ConfigurationError("build_scene", "pedestal", pedestal, "0 to 2 m")
    everybody = (Person(board=board or Board()),) if people is None else people
    everybody = tuple(replace(person, floor=-pedestal) for person in everybody)
    spec = mujoco.MjSpec()
    spec.modelname = f"{robot.name} and a person"
    _set_options(spec, timestep, contacts)
    add_surroundings(spec, pedestal)
    names = [_add_person(spec, person, k) for k, person in enumerate(everybody)]
    body, said = robot_spec(robot)
    spec.attach(body, prefix="robot/", frame=spec.worldbody.add_frame())
    if furnish is not None:
        furnish(spec)
    model = spec.compile()

    joints = [_find(model, mujoco.mjtObj.mjOBJ_JOINT, name, robot) for name in robot.joint_names]
    return Scene(
        model=model,
        robot=robot,
        people=everybody,
        q_addresses=model.jnt_qposadr[joints].astype(np.intp),
        v_addresses=model.jnt_dofadr[joints].astype(np.intp),
        actuators=np.array([_find(model, mujoco.mjtObj.mjOBJ_ACTUATOR, n, robot) for n in robot.joint_names], np.intp),
        robot_geoms=np.flatnonzero(model.geom_group == ROBOT_COLLISION),
        person_geoms=np.array([model.geom(n).id for some in names for n in some if "/board" not in n], np.intp),
        board_geoms=np.array([model.geom(n).id for some in names for n in some if "/board" in n], np.intp),
        tcp_site=int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "robot/tcp")),
        pedestal=pedestal,
        said=said,
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


def _add_person(spec: Any, person: Person, number: int) -> list[str]:
    """One mocap body per segment, then the board, all far away until they are placed; returns the geoms' names."""
    looks = {"group": PERSON, "contype": 0, "conaffinity": 0}
    prefix, far = f"person{number + 1 if number else ''}/", 50.0 + 20.0 * number
    names = []
    for i, segment in enumerate(person.body.segments):
        names.append(prefix + segment.name)
        body = spec.worldbody.add_body(name=names[-1], mocap=True, pos=[far + i, 0.0, 0.0])
        body.add_geom(
            name=names[-1],
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[segment.radius, segment.length / 2, 0.0],
            rgba=segment.colour,
            **looks,
        )
    board = person.board
    if board is not None:
        names.append(prefix + "board")
        body = spec.worldbody.add_body(name=names[-1], mocap=True, pos=[far - 1.0, 0.0, 0.0])
        body.add_geom(
            name=names[-1],
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[board.thickness / 2, board.width / 2, board.height / 2],
            rgba=CARDBOARD,
            **looks,
        )
    return names
