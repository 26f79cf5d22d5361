"""The world of the Monte Carlo simulation, section V-C: robot, pedestal, floor and dummy, for contacts and for rays.

The dummy's capsules are free bodies here, not mocap ones as in the experiments: MuJoCo does not test mocap bodies
against the robot's fixed base. Nothing is ever stepped.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.robot.models.mjcf import held_positions
from qpsafe.sim.people.anatomy import SEGMENTS
from qpsafe.sim.people.limbs import axis_quaternions
from qpsafe.sim.world.robot_spec import ROBOT_COLLISION, robot_spec
from qpsafe.sim.world.surroundings import SCENERY, add_surroundings

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.skin.spots import SpotArray

Array = NDArray[np.float64]

DUMMY = 1  # geometry group
_FAR = 10.0  # no two shapes that matter are farther from each other [m]
_FREE = 7  # numbers of a free body's pose
_DUMMY_BIT, _GROUND_BIT = 1 << 20, 1 << 21  # contact bits that no robot's model is likely to use


class PlacementWorld:
    """A compiled world and what is needed to ask it.

    Args:
        robot: Any robot whose model MuJoCo can read.
        pedestal: Height of the robot's base above the floor [m].

    Attributes:
        model: The MuJoCo model.
        robot: The robot.
        pedestal: Height of the robot's base above the floor [m].

    Raises:
        RobotFileError: MuJoCo cannot read the robot's model.
    """

    def __init__(self, robot: Robot, pedestal: float = 0.55) -> None:
        self.robot, self.pedestal = robot, pedestal
        spec = mujoco.MjSpec()
        add_surroundings(spec, pedestal)
        # The dummy and the ground touch what collides of the robot, not each other; the robot itself as its file says.
        # Before compiling: MuJoCo sorts geoms by what they can touch.
        for geom in spec.worldbody.geoms:
            stands_on = geom.type == mujoco.mjtGeom.mjGEOM_PLANE
            geom.contype, geom.conaffinity = _GROUND_BIT, 0 if stands_on else _DUMMY_BIT
        for segment in SEGMENTS:
            body = spec.worldbody.add_body(name=f"dummy/{segment.name}", pos=[50.0, 0.0, 0.0])
            body.add_freejoint()
            size = [segment.radius, segment.length / 2, 0.0]
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=size, group=DUMMY, contype=_DUMMY_BIT, conaffinity=0)
        try:
            own = robot_spec(robot)[0]
            for geom in own.geoms:  # what collides of the robot touches the dummy and the ground
                if geom.group == ROBOT_COLLISION:
                    geom.conaffinity = int(geom.conaffinity) | _DUMMY_BIT | _GROUND_BIT
            spec.attach(own, prefix="robot/", frame=spec.worldbody.add_frame())
            model = spec.compile()
        except ValueError as error:
            expected = f"a model that MuJoCo can read ({error})"
            raise RobotFileError(robot.model_path, "model", robot.model_path.name, expected) from None
        self.model: Any = model
        self.data: Any = mujoco.MjData(model)
        self._held = held_positions(model, robot.held, "robot/")
        self.data.qpos[self._held[0]] = self._held[1]
        body_names = [model.body(i).name for i in range(model.nbody)]
        self._dummy = np.array([body_names[b].startswith("dummy/") for b in model.geom_bodyid])
        solid = (model.geom_group == ROBOT_COLLISION) & (model.body_weldid[model.geom_bodyid] != 0)
        self._moving, self._segments = np.flatnonzero(solid), np.flatnonzero(self._dummy)
        joints = [model.joint(f"robot/{name}") for name in robot.joint_names]
        self._q = np.array([int(joint.qposadr[0]) for joint in joints], dtype=np.intp)
        first = [model.joint(model.body(f"dummy/{s.name}").jntadr[0]).qposadr[0] for s in SEGMENTS]
        self._poses = np.array(first, dtype=np.intp)[:, None] + np.arange(_FREE)
        self._ignored = self._touching_at_home()

    def _touching_at_home(self) -> set[tuple[int, int]]:
        """Pairs of the robot's bodies whose shapes overlap at home, so by design."""
        far = np.full((len(SEGMENTS), 2, 3), 50.0)
        far[:, 1, 2] += 1.0
        self.place(self.robot.home, far)
        return {pair for pair in self._pairs() if all(self._of_robot(body) for body in pair)}

    def _of_robot(self, body: int) -> bool:
        return str(self.model.body(body).name).startswith("robot/")

    def _pairs(self) -> set[tuple[int, int]]:
        contact = self.data.contact
        deep = np.asarray(contact.dist) < 0.0
        bodies = self.model.geom_bodyid[np.asarray(contact.geom)[deep]]
        return {(int(min(pair)), int(max(pair))) for pair in bodies}

    def place(self, q: Array, capsules: Array) -> None:
        """Put the robot to q (n,) and the dummy's capsules to their ends (17, 2, 3), and find the contacts."""
        self.data.qpos[self._q] = q
        self.data.qpos[self._poses] = capsule_poses(capsules)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)

    def feasible(self, q: Array, capsules: Array) -> bool:
        """Whether the robot touches neither itself nor the ground, and the dummy neither the robot nor the pedestal."""
        self.place(q, capsules)
        return self.data.ncon == 0 or self._pairs() <= self._ignored

    def bodies_of(self, spots: SpotArray) -> NDArray[np.int32]:
        """The body that carries each spot (k,), which the spot does not see."""
        own = {frame: self._body(frame) for frame in set(spots.frames)}
        return np.array([own[frame] for frame in spots.frames], dtype=np.int32)

    def _body(self, frame: str) -> int:
        joint = self.robot.model.frames[self.robot.frame_id(frame)].parentJoint
        if joint > 0:
            return int(self.model.joint("robot/" + self.robot.model.names[joint]).bodyid[0])
        return int(self.model.body_parentid[self.model.joint("robot/" + self.robot.joint_names[0]).bodyid[0]])

    def nearest(self, q: Array, capsules: Array) -> tuple[Array, float]:
        """The dummy's point that is nearest to what moves of the robot, (3,) [m], and its distance [m].

        Args:
            q: Of the robot, (n,) [rad].
            capsules: Ends of the dummy's, (17, 2, 3) [m].
        """
        self.place(q, capsules)
        centres, radii = self.data.geom_xpos, self.model.geom_rbound
        # pairs of shapes, those first whose bounding balls are nearest to each other
        between = np.linalg.norm(centres[self._moving][:, None] - centres[self._segments], axis=2)
        least = between - radii[self._moving][:, None] - radii[self._segments]
        found, best, segment = np.full(3, np.nan), np.inf, np.empty(6)
        for pair in np.argsort(least, axis=None, kind="stable"):
            i, k = divmod(int(pair), len(self._segments))
            if least[i, k] >= best:
                break
            distance = mujoco.mj_geomDistance(
                self.model, self.data, self._moving[i], self._segments[k], min(best, _FAR), segment
            )
            if distance < best:
                best, found = distance, segment[3:].copy()
        return found, best

    def put(self, batch: Any, q: Array, capsules: Array) -> None:
        """Put the robots and dummies of a batch in place.

        Args:
            batch: A `mujoco.batch.Batch` of this model with at least k simulations.
            q: Of the robots, (k, n) [rad].
            capsules: Ends of the dummies', (k, 17, 2, 3) [m].
        """
        k, qpos = len(q), batch.bind("qpos")
        qpos[:k, self._held[0]] = self._held[1]
        qpos[:k, self._q] = q
        qpos[:k, self._poses] = capsule_poses(capsules.reshape(-1, 2, 3)).reshape(k, len(SEGMENTS), _FREE)

    def cast(
        self, batch: Any, p: int, origins: Array, directions: Array, own: NDArray[np.int32]
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """What rays meet first.

        Args:
            batch: A `mujoco.batch.Batch` of this model, see `put`.
            p: Which of its simulations.
            origins: Of the rays, (m, 3) [m].
            directions: Of the rays, unit, (m, 3).
            own: Body that each ray does not see, (m,).

        Returns:
            Distances (m,) [m], +inf for nothing; whether it is the dummy, and whether the robot.
        """
        seen = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        seen[[SCENERY, DUMMY, ROBOT_COLLISION]] = 1
        found = batch.ray(origins, directions, geomgroup=seen, bodyexclude=own, ids=[p])
        distance, geom = (of_all.reshape(len(origins)) for of_all in found)
        hit = distance >= 0.0
        dummy = hit & self._dummy[geom]
        robot = hit & (self.model.geom_group[geom] == ROBOT_COLLISION)
        return np.where(hit, distance, np.inf), dummy, robot


def capsule_poses(capsules: Array) -> Array:
    """Positions and quaternions of capsules (k, 2, 3), as a free body has them: (k, 7)."""
    axes = capsules[:, 1] - capsules[:, 0]
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return np.hstack((0.5 * (capsules[:, 0] + capsules[:, 1]), axis_quaternions(axes)))
