"""The pose of a camera from a recording, how well it is known, and what of it cannot be told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.extrinsics.moving import Moving
from qpsafe.ranging.extrinsics.register import SCHEDULE, Registration
from qpsafe.ranging.extrinsics.start import first_poses, poses_around
from qpsafe.ranging.extrinsics.surface import RobotSurface
from qpsafe.ranging.extrinsics.views import View, Views
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.ranging.extrinsics.recording import Recording
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: Points of an image that are registered, at most.
MOST = 600
#: And those by which poses to begin with are chosen.
FEW = 60
#: A direction that so small a share of the residuals tells about, of what the best one has, is not observed.
UNOBSERVED = 0.02
#: What moves has to be seen where the robot should be, and the robot has to be seen where it should be, in this share.
EXPLAINED, THROUGH = 0.8, 0.1


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """Where a camera is.

    Attributes:
        pose: From the camera's frame to the robot's base (4, 4) [m].
        covariance: Of an error of the pose, translation of the centre of what was seen and rotation about it, in the
            base frame (6, 6) [m, rad]. Images count as independent, points of one image do not.
        rms: Root mean square of what was read minus what should have been, along the rays [m].
        explained: Share of what moves that is seen where the robot should be.
        through: Share of the rays that should meet the robot, but read something farther.
        points: How many rays met the robot.
        images: In how many images something moved.
        centre: Of what was seen, in the base frame (3,) [m].
        weak: What cannot be told, in words; empty if nothing.
    """

    pose: Array
    covariance: Array
    rms: float
    explained: float
    through: float
    points: int
    images: int
    centre: Array
    weak: tuple[str, ...]

    @property
    def deviation(self) -> tuple[float, float]:
        """Standard deviation in the worst direction: of a translation [m], of a rotation [rad]."""
        along, about = self.covariance[:3, :3], self.covariance[3:, 3:]
        return float(np.sqrt(np.linalg.eigvalsh(along)[-1])), float(np.sqrt(np.linalg.eigvalsh(about)[-1]))


def calibrate_camera(
    robot: Robot, recording: Recording, guess: Array | None = None, seed: int = 0
) -> CameraCalibration:
    """Find a camera that looks at a robot while it moves.

    Args:
        robot: The robot; its collision geometry is the target, so that where the real surface lies deeper than the
            hulls, the camera seems to be that much farther away.
        recording: Images at different configurations.
        guess: A pose of the camera (4, 4), right within about 0.2 m and 20 degrees; without one it is found.
        seed: Of the points that are chosen.

    Raises:
        ConfigurationError: The robot has no collision geometry, or too little moves in the images.
    """
    moving = Moving(recording, MOST, seed)
    points = moving.points
    total, seen = sum(map(len, points)), sum(len(x) > 0 for x in points)
    if seen < 4 or total < 60:
        expected = "something that moves by more than 6 cm in at least 4 images, 60 points in all"
        raise ConfigurationError(
            "calibrate-camera", "recording", f"{counted(total, 'point')} in {counted(seen, 'image')}", expected
        )
    surface, views = RobotSurface(robot), Views(robot, recording.q, moving)
    surfaces = [surface.at(q) for q in recording.q]
    registration = Registration(points, surfaces)
    rough = Views(robot, recording.q, Moving(recording, FEW, seed))
    ways: list[Callable[[], list[Array]]] = [lambda: [np.asarray(guess, dtype=np.float64)]]
    if guess is None:
        ways = [lambda: first_poses(points, surfaces, rough, seed), lambda: poses_around(points, surfaces, rough, seed)]
    found: list[tuple[Array, View]] = []
    for begins in ways:
        for begin in begins():
            pose, _ = registration.refine(begin, SCHEDULE if guess is None else SCHEDULE[1:])
            found.append(views.refine(pose))
        pose, view = min(found, key=lambda entry: entry[1].wrong)
        if _agrees(view):
            break
    return _judged(pose, view, seen)


def _agrees(view: View) -> bool:
    return view.explained >= EXPLAINED and view.through <= THROUGH


def _judged(pose: Array, view: View, images: int) -> CameraCalibration:
    used = view.weights > 0.0
    rms = float(np.sqrt(np.average(view.residuals**2, weights=view.weights))) if used.any() else np.inf
    scale = np.r_[1.0, 1.0, 1.0, [view.radius] * 3]
    rows = view.rows / scale
    H = (rows * view.weights[:, None]).T @ rows
    values, axes = np.linalg.eigh(H)
    weak = [_words(axes[:, k]) for k in range(6) if not values[k] > UNOBSERVED * values[-1]]
    if not view.explained >= EXPLAINED:
        weak.append(f"the robot: only {100 * view.explained:.0f} % of what moves is where it should be")
    if not view.through <= THROUGH:
        weak.append(f"the robot: {100 * view.through:.0f} % of the rays that should meet it see through it")
    # sandwich: images are independent, points of one image are not
    bread = np.linalg.pinv(H, hermitian=True, rcond=1e-12)
    sums = np.zeros((int(view.images.max(initial=0)) + 1, 6))
    np.add.at(sums, view.images, rows * (view.weights * view.residuals)[:, None])
    count = max(int((np.abs(sums).sum(axis=1) > 0.0).sum()), 2)
    meat = sums.T @ sums * count / (count - 1)
    covariance = bread @ meat @ bread / np.outer(scale, scale)
    return CameraCalibration(
        pose, covariance, rms, view.explained, view.through, int(used.sum()), images, view.centre, tuple(weak)
    )


def _words(axis: Array) -> str:
    """A direction of (v, ω) in words."""
    along, about = axis[:3], axis[3:]
    moves = np.linalg.norm(along) >= np.linalg.norm(about)
    v = along if moves else about
    v = v / np.linalg.norm(v) * np.sign(v[np.argmax(np.abs(v))])
    inside = ", ".join(f"{x:.2f}" for x in v.round(2) + 0.0)  # no -0
    return f"{'translation along' if moves else 'rotation about'} ({inside})"
