"""Whether a place on the robot can be used at all: how often a sensor there sees the robot itself.

A reading below d_min always counts as danger, whatever is there (section II-B). A spot that sees its own robot that
near stops it for nothing; one in the gap between two links does so all the time. Farther away the robot itself does
not count, but hides people, and as its edge slides past, a slow sensor reads distances where nothing is. So a place
is no candidate if a sensor's cone there meets the robot within its range in any of the poses around home, where it
evades to, or nearer than d_min and a margin in more than a share of random poses (`self_sight` of the region).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.extras import require
from qpsafe.placement.boxes import may_meet
from qpsafe.placement.surface import model_body
from qpsafe.robot.models.hulls import solid_geoms
from qpsafe.robot.models.mjcf import held_positions
from qpsafe.robot.models.mujoco_spec import mujoco_model
from qpsafe.sensing.skin.spot import axes_along

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

EVASIVE = 300  # poses around home, free of self-collision, beside home itself
AROUND_HOME = 0.8  # largest deviation of a joint in these [rad]
RANDOM = 100  # poses anywhere within limits, free of self-collision
RIM = 6  # rays on the rim of a sensor's cone, beside that on its axis
MARGIN = 0.02  # added to the distance below which the robot must not see itself [m]


class _Pose(NamedTuple):
    """The robot's collision geometry in one configuration: where its geoms are, and their axes, world frame."""

    q: Array
    centres: Array
    axes: Array


class SelfSight:
    """The robot in poses around home and in random ones.

    Attributes:
        configurations: All of them, home first, (c, n) [rad].
        around_home: How many are home or around it; the others are random.

    Args:
        robot: Any robot whose model MuJoCo can read.
        nearest: Nearer than this and a margin the robot must not see itself anywhere [m].
        reach: Nearer than this it must not do so around home [m].
        opening: Full angle of a sensor's cone [rad].
        zones: Where it looks in there, in its own frame, (z, 3); by default along the axis and the cone's rim.

    Raises:
        RobotFileError: MuJoCo cannot read the robot's model.
    """

    def __init__(self, robot: Robot, nearest: float, reach: float, opening: float, zones: Array | None = None) -> None:
        require("place", "a choice of sensors", "mujoco")
        import mujoco
        import mujoco.batch

        self.robot, self.opening = robot, opening
        self.zones = _rim(opening) if zones is None else zones
        self.nearest, self.reach = nearest + MARGIN, max(reach, nearest + MARGIN)
        self._frames: dict[str, Array] = {}
        self._model: Any = mujoco_model(robot)
        try:
            self._q = np.array([self._model.joint(name).qposadr[0] for name in robot.joint_names], dtype=np.intp)
        except (ValueError, KeyError) as error:
            expected = f"a model that MuJoCo can read ({error})"
            raise RobotFileError(robot.model_path, "model", robot.model_path.name, expected) from None
        self._model.geom_group[:] = np.where(solid_geoms(self._model), 3, 2)
        self._held = held_positions(self._model, robot.held)
        self._poses, self.around_home = self._free()
        self.configurations = np.array([pose.q for pose in self._poses])
        self._batch = mujoco.batch.Batch(self._model, len(self._poses), nthread=1)  # rays are cast pose by pose
        self._batch.bind("qpos")[:, self._held[0]] = self._held[1]
        self._batch.bind("qpos")[:, self._q] = self.configurations

    def _free(self) -> tuple[list[_Pose], int]:
        """Home, poses around it and random ones, free of self-collision; and how many are not random."""
        import mujoco

        robot, model, data = self.robot, self._model, mujoco.MjData(self._model)
        rng, home = np.random.default_rng(0), robot.home

        data.qpos[self._held[0]] = self._held[1]

        def touching(q: Array) -> set[tuple[int, ...]]:
            data.qpos[self._q] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            return {tuple(pair) for pair in model.geom_bodyid[data.contact.geom]}

        by_design = touching(home)

        def free(low: Array, high: Array) -> Iterator[_Pose]:
            for q in rng.uniform(low, high, (4000, len(home))):
                if touching(q) <= by_design:
                    yield taken(q)

        def taken(q: Array) -> _Pose:
            return _Pose(q, data.geom_xpos.copy(), data.geom_xmat.reshape(-1, 3, 3).copy())

        touching(home)
        near = np.maximum(robot.lower, home - AROUND_HOME), np.minimum(robot.upper, home + AROUND_HOME)
        around = [taken(home), *islice(free(*near), EVASIVE)]
        return [*around, *islice(free(robot.lower, robot.upper), RANDOM)], len(around)

    def clear(self, frame: str, points: Array, directions: Array, most: float) -> NDArray[np.bool_]:
        """Which places see the robot in no pose around home, and from close by in few random ones, (k,).

        The body that carries a place is left out: a place on it that looks at it is no matter of poses.

        Args:
            frame: Frame of the robot that the places are fixed in.
            points: (k, 3) [m].
            directions: Unit, (k, 3).
            most: The largest share of the random poses in which a place may see it.
        """
        model, own = self._model, model_body(self._model, self.robot, frame)
        if frame not in self._frames:
            self._frames[frame] = np.array([self.robot.pose(frame, pose.q) for pose in self._poses])
        others = np.flatnonzero((model.geom_group == 3) & (model.geom_bodyid != own))
        boxes = model.geom_aabb[others].copy()
        boxes[model.geom_rbound[others] == 0.0, 3:] = np.inf  # a plane
        seen = np.array([0, 0, 0, 1, 0, 0], dtype=np.uint8)
        cone = zone_rays(directions, self.zones)  # (k, rays, 3)
        left, times = np.arange(len(points)), np.zeros(len(points), dtype=np.int64)
        allowed = most * (len(self._poses) - self.around_home)
        for i, (pose, T) in enumerate(zip(self._poses, self._frames[frame], strict=True)):
            places = points[left] @ T[:3, :3].T + T[:3, 3]
            reach, most = (self.reach, 0.0) if i < self.around_home else (self.nearest, allowed)
            # rays only where the robot may be: this near to its axis lies what a cone holds
            widest = reach * np.sin(0.5 * self.opening)
            axes = directions[left] @ T[:3, :3].T
            near = may_meet(places, axes, pose.centres[others], pose.axes[others], boxes, reach, widest)
            some = left[near]
            if not len(some):
                continue
            rays = (cone[some] @ T[:3, :3].T).reshape(-1, 3)
            origins = np.repeat(places[near], len(self.zones), axis=0)
            meets = may_meet(origins, rays, pose.centres[others], pose.axes[others], boxes, reach, 0.0)
            distance, _ = self._batch.ray(origins[meets], rays[meets], geomgroup=seen, bodyexclude=own, ids=[i])
            meets[meets] = ((distance >= 0.0) & (distance < reach)).ravel()
            times[some[meets.reshape(len(some), -1).any(axis=1)]] += 1
            left = left[times[left] <= most]
            if not len(left):
                break
        clear = np.zeros(len(points), dtype=np.bool_)
        clear[left] = True
        return clear


def zone_rays(directions: Array, zones: Array) -> Array:
    """Where the zones (z, 3) of sensors look that look along directions (k, 3), turned as a file's are, (k, z, 3)."""
    return np.asarray(np.einsum("kij,zj->kzi", axes_along(directions), zones))


def _rim(opening: float) -> Array:
    """The axis of a cone and some directions on its rim, (1 + RIM, 3)."""
    angle, half = 2.0 * np.pi * np.arange(RIM) / RIM, 0.5 * opening
    rim = np.stack((np.sin(half) * np.cos(angle), np.sin(half) * np.sin(angle), np.full(RIM, np.cos(half))), axis=1)
    return np.concatenate((np.array([[0.0, 0.0, 1.0]]), rim))
