"""Whether a place on the robot can be used at all: how often it looks at the robot itself from close by.

A reading below d_min always counts as danger, whatever is there (section II-B). A spot that sees its own robot that
near stops it for nothing; one in the gap between two links does so all the time. So places that see the robot
nearer than d_min at home, or in more than a share of random configurations (`self_sight` of the region), are no
candidates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.placement.surface import model_body

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

CONFIGURATIONS = 100  # within limits, free of self-collision; one of them is home


class SelfSight:
    """The robot in random configurations.

    Args:
        robot: Any robot whose model MuJoCo can read.
        nearest: Nearer than this the robot must not see itself [m].

    Raises:
        RobotFileError: MuJoCo cannot read the robot's model, or it touches itself in every configuration.
    """

    def __init__(self, robot: Robot, nearest: float) -> None:
        import mujoco
        import mujoco.batch

        self.robot, self.nearest = robot, nearest
        self._poses: dict[str, Array] = {}
        try:
            self._model: Any = mujoco.MjModel.from_xml_path(str(robot.model_path))
            self._q = np.array([self._model.joint(name).qposadr[0] for name in robot.joint_names], dtype=np.intp)
        except (ValueError, KeyError) as error:
            expected = f"a model that MuJoCo can read ({error})"
            raise RobotFileError(robot.model_path, "model", robot.model_path.name, expected) from None
        collides = (self._model.geom_contype != 0) | (self._model.geom_conaffinity != 0)
        self._model.geom_group[:] = np.where(collides | ~collides.any(), 3, 2)
        self.configurations = self._free()
        self._batch = mujoco.batch.Batch(self._model, len(self.configurations))
        self._batch.bind("qpos")[:, self._q] = self.configurations

    def _free(self) -> Array:
        import mujoco

        robot, model, data = self.robot, self._model, mujoco.MjData(self._model)
        rng, found = np.random.default_rng(0), [robot.home]
        data.qpos[self._q] = robot.home
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        by_design = {tuple(pair) for pair in model.geom_bodyid[data.contact.geom]}
        for _ in range(20 * CONFIGURATIONS):
            q = rng.uniform(robot.lower, robot.upper)
            data.qpos[self._q] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            if {tuple(pair) for pair in model.geom_bodyid[data.contact.geom]} <= by_design:
                found.append(q)
            if len(found) == CONFIGURATIONS:
                break
        return np.array(found)

    def share(self, frame: str, points: Array, directions: Array) -> Array:
        """Share of the configurations in which places see the robot from close by, but for their own body, (k,).

        1 for a place that does so at home.

        Args:
            frame: Frame of the robot that the places are fixed in.
            points: (k, 3) [m].
            directions: Unit, (k, 3).
        """
        if not len(points):
            return np.zeros(0)
        if frame not in self._poses:
            self._poses[frame] = np.array([self.robot.pose(frame, q) for q in self.configurations])
        poses = self._poses[frame]
        R, t = poses[:, :3, :3], poses[:, :3, 3]
        origins = points @ R.transpose(0, 2, 1) + t[:, None, :]
        rays = directions @ R.transpose(0, 2, 1)
        own = model_body(self._model, self.robot, frame)
        seen = np.array([0, 0, 0, 1, 0, 0], dtype=np.uint8)
        distance, _ = self._batch.ray(origins, rays, geomgroup=seen, bodyexclude=own)
        near = np.asarray((distance >= 0.0) & (distance < self.nearest))
        return np.where(near[0], 1.0, near.mean(axis=0))
