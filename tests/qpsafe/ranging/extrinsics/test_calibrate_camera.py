"""The pose of a simulated camera is found again, and what its images cannot tell is said."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import some
from camera_calibration import errors, somebody
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.cell_cameras import looking
from qpsafe.ranging.extrinsics.calibrate import _judged, calibrate_camera
from qpsafe.ranging.extrinsics.cast import cast
from qpsafe.ranging.extrinsics.start import kabsch
from qpsafe.ranging.extrinsics.surface import RobotSurface
from qpsafe.ranging.extrinsics.views import View
from qpsafe.sensing.body import body_hull_set


@pytest.mark.slow  # some 4 s of processor time each
@pytest.mark.parametrize("seed", range(10))
def test_a_camera_is_found_without_any_guess(studio: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sensor = studio.camera(rng)
    found = calibrate_camera(studio.robot, studio.record(sensor, rng, 24))
    place, angle, middle = errors(found, sensor.pose)
    assert (place < 25.0, angle < 0.6, middle < 4.0, found.weak) == (True, True, True, ())
    assert found.deviation[0] < 2e-3


@pytest.mark.long
def test_a_camera_is_found_from_a_guess(studio: Any) -> None:
    """A guess that is 17 cm and 6 degrees wrong, with somebody who walks through the images."""
    rng = np.random.default_rng(1)
    sensor = studio.camera(rng)
    recording = studio.record(sensor, rng, 12, somebody)
    guess = looking(sensor.pose[:3, 3] + [0.1, -0.1, 0.1], [0.15, 0.05, 0.45])
    place, angle, middle = errors(calibrate_camera(studio.robot, recording, guess), sensor.pose)
    assert (place < 40.0, angle < 1.0, middle < 5.0) == (True, True, True)


@pytest.mark.slow
def test_other_joint_angles_are_told(studio: Any) -> None:
    """Images that do not belong to the joints: no pose explains them."""
    rng = np.random.default_rng(2)
    sensor = studio.camera(rng)
    recording = studio.record(sensor, rng, 10)
    shuffled = replace(recording, q=np.roll(recording.q, 3, axis=0))
    assert calibrate_camera(studio.robot, shuffled, sensor.pose).weak


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_what_faces_do_not_tell_is_said(axis: int) -> None:
    """Faces that are all parallel to an axis: nothing holds the camera along it."""
    rng = np.random.default_rng(axis)
    n, p = rng.normal(size=(400, 3)), rng.uniform(-0.5, 0.5, (400, 3))
    n[:, axis] = 0.0
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    rows = np.hstack((n, np.cross(p, n)))
    view = View(
        rows,
        0.01 * rng.normal(size=400),
        np.ones(400),
        np.arange(400) % 10,
        np.zeros(3),
        0.5,
        explained=1.0,
        through=0.0,
    )
    (line,) = _judged(np.eye(4), view, 10).weak
    assert line == f"translation along ({', '.join(f'{x:.2f}' for x in np.eye(3)[axis])})"
    some = View(*view[:6], explained=0.5, through=0.5)
    assert len(_judged(np.eye(4), some, 10).weak) == 3


def test_a_robot_at_rest_tells_nothing(studio: Any) -> None:
    rng = np.random.default_rng(4)
    sensor = studio.camera(rng)
    recording = studio.record(sensor, rng, 6)
    still = replace(recording, distances=np.repeat(recording.distances[:1], 6, axis=0))
    with pytest.raises(ConfigurationError, match="moves"):
        calibrate_camera(studio.robot, still)


@settings(max_examples=some(8, of=20), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_rays_meet_the_hulls_where_their_half_spaces_begin(studio: Any, seed: int) -> None:
    """Against the definition: the place is on the surface, nothing of the ray before it is inside any hull."""
    rng = np.random.default_rng(seed)
    robot = studio.robot
    hulls, poses = body_hull_set(robot), np.ascontiguousarray(robot.at(rng.uniform(-1.0, 1.0, 6)).body_poses())
    camera = looking(rng.uniform(0.9, 1.5, 3), rng.uniform(0.0, 0.4, 3))
    directions = np.array([0.0, 0.0, 1.0]) + 0.3 * rng.normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distances, normals = np.empty(30), np.zeros((30, 3))
    cast(camera, directions, poses, *hulls.tables, distances, normals)
    rays = directions @ camera[:3, :3].T
    for d, n, u in zip(distances, normals, rays, strict=True):
        end = min(d, 3.0)
        along = camera[:3, 3] + np.linspace(0.0, end - 1e-6, 300)[:, None] * u
        assert (hulls.find(along, np.full(300, -1e-7), poses) < 0).all()
        if np.isfinite(d):
            on = (camera[:3, 3] + d * u)[None]
            assert hulls.find(on, np.array([1e-6]), poses)[0] >= 0
            assert n @ u < 0.0


def test_samples_lie_on_the_surface_and_look_outwards(studio: Any) -> None:
    robot, q = studio.robot, np.array([0.3, -0.2, 0.4, 0.1, 0.5, -0.6])
    samples, normals = RobotSurface(robot, 0.03).at(q)
    poses, hulls = robot.at(q).body_poses(), body_hull_set(robot)
    assert (hulls.find(samples, np.full(len(samples), 1e-9), poses) >= 0).all()
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    outside = hulls.find(samples + 1e-3 * normals, np.full(len(samples), 0.0), poses) < 0
    assert outside.mean() > 0.8  # where links overlap, outside one of them is inside another


@given(st.integers(0, 2**32 - 1))
def test_kabsch_finds_a_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose, points = looking(rng.normal(size=3), rng.normal(size=3) + 5.0), rng.normal(size=(6, 3))
    assert kabsch(points, points @ pose[:3, :3].T + pose[:3, 3]) == pytest.approx(pose, abs=1e-9)
