"""What zones meet, against MuJoCo's rays; when sensors look; that images say where things are."""

from __future__ import annotations

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.adapters.vl53l5cx import vl53l5cx
from qpsafe.ranging.sensor import WORLD, RangeSensor
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.spot_table import scene_body
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.ranging.zones import Ideal, ZoneSensors, zone_table
from qpsafe.sim.world.rays import cast

AXES = Ideal(cones=False)


def in_world(sensor: RangeSensor, state) -> tuple[np.ndarray, np.ndarray]:
    """Origin and directions of the zones, world frame: by the robot's poses, which the tables do not use."""
    pose = (np.eye(4) if sensor.mount == WORLD else state.pose(sensor.mount)) @ sensor.pose
    return pose[:3, 3], sensor.directions @ pose[:3, :3].T


def test_zones_read_what_mujocos_rays_meet(worlds, stage, kinds) -> None:
    """Axes to the nanometre, on the robot and in the world; the body that carries a sensor is not seen by it."""
    _, scene, world = stage
    met = {sensor.name: 0 for sensor in kinds}
    for data, state, tracks in worlds.random_encounters(scene, 20, 0):
        images = ZoneSensors(scene, world, kinds, AXES).images(0.0, world.poses(state), tracks.row(0))
        assert {image.sensor.name for image in images} == set(met)
        for image in images:
            sensor = image.sensor
            origin, directions = in_world(sensor, state)
            body = -1 if sensor.mount == WORLD else scene_body(scene, sensor.mount)
            expected = cast(
                scene, data, np.tile(origin, (len(sensor), 1)), directions, sensor.range_max,
                bodies=np.full(len(sensor), body),
            )  # fmt: skip
            assert np.asarray(image.distances) == pytest.approx(expected, abs=1e-9)
            met[sensor.name] += int(np.isfinite(expected).sum())
    assert min(met.values()) > 80


def test_a_cone_sees_nothing_farther_than_its_axis(worlds, stage, kinds) -> None:
    _, scene, world = stage
    nearer = 0
    for _, state, tracks in worlds.random_encounters(scene, 10, 1):
        poses, people = world.poses(state), tracks.row(0)
        for sensor in kinds:
            cones, axes = (
                SpotReader(world, zone_table(scene, sensor, sensor.range_max, wide)).read(poses, people)[0]
                for wide in (True, False)
            )
            assert (cones <= axes).all()
            nearer += int((cones < axes).sum())
    assert nearer > 100


def test_a_sensor_reads_the_same_whatever_frame_it_is_said_in(worlds, stage) -> None:
    """On the robot or in the world at the same place, but for the body that carries it: seen from outside the arm."""
    _, scene, world = stage
    for _, state, tracks in worlds.random_encounters(scene, 10, 2):
        pose = state.pose("tcp")
        away = np.eye(4)
        away[:3, 3] = 0.0, 0.0, 0.1
        sensors = [vl53l5cx("a", mount="tcp", pose=away), vl53l5cx("b", mount=WORLD, pose=pose @ away)]
        hand, wall = (image.distances for image in ZoneSensors(scene, world, sensors, AXES).images(
            0.0, world.poses(state), tracks.row(0)))  # fmt: skip
        # 0.1 m before the tool and looking away from it, it is not in its own sight
        assert hand == pytest.approx(np.asarray(wall), abs=1e-9)


def test_points_lie_on_somebody_or_on_the_cell(worlds, stage, kinds) -> None:
    """Of the camera, metres away: each point is on a capsule, a board or a geom of the scene, by their own formulas."""
    _, scene, world = stage
    seen = 0
    for data, state, tracks in worlds.random_encounters(scene, 5, 3):
        sensors = ZoneSensors(scene, world, [kinds[2]], AXES)
        (image,) = sensors.images(0.0, world.poses(state), tracks.row(0))
        origin, directions = in_world(kinds[2], state)
        ends, radii, *_ = people_of(scene, data)
        found = np.asarray(image.distances)
        empty = cast(scene, data, np.tile(origin, (len(found), 1)), directions, 5.0, groups=(0, 3, 4))
        on_person = np.isfinite(found) & (found < empty - 1e-6)
        points = origin + found[on_person, None] * directions[on_person]
        start, axis = ends[:, 0], ends[:, 1] - ends[:, 0]
        share = np.clip(((points[:, None] - start) * axis).sum(2) / (axis * axis).sum(1), 0.0, 1.0)
        away = np.linalg.norm(points[:, None] - start - share[..., None] * axis, axis=2) - radii
        board = data.geom_xpos[scene.board_geoms[0]], data.geom_xmat[scene.board_geoms[0]].reshape(3, 3)
        local = np.abs((points - board[0]) @ board[1]) - scene.model.geom_size[scene.board_geoms[0]]
        off = np.minimum(np.abs(away).min(axis=1), np.abs(local.max(axis=1)))
        assert off.max(initial=0.0) < 1e-6
        seen += len(points)
    assert seen > 50


def looks(sensors: ZoneSensors, world, state, people, ticks: int, dt: float = 0.004):
    """(tick, name, stamp) of all images of a run in which nothing moves."""
    poses = world.poses(state)
    return [(k, i.sensor.name, i.stamp) for k in range(ticks) for i in sensors.images(dt * k, poses, people)]


def test_sensors_look_one_after_another_and_images_come_when_their_time_has_passed(worlds, stage) -> None:
    _, scene, world = stage
    _, state, tracks = next(iter(worlds.random_encounters(scene, 1, 4)))
    sensors = [vl53l5cx(f"s{i}", mount="dh3") for i in range(10)]
    came = looks(ZoneSensors(scene, world, sensors, Ideal(latency=0.03)), world, state, tracks.row(0), 500)
    assert [name for k, name, _ in came if k == 0] == [sensor.name for sensor in sensors]  # nobody begins blind
    times = {sensor.name: [(0.004 * k, s) for k, name, s in came if name == sensor.name] for sensor in sensors}
    first = []
    for rows in times.values():
        arrivals, stamps = np.array(rows).T
        assert arrivals - stamps == pytest.approx(0.03, abs=0.004 + 1e-9)
        assert (arrivals - stamps > 0.03 - 1e-9).all()
        assert np.diff(stamps)[1:].mean() == pytest.approx(1 / 15, abs=0.001)
        assert abs(np.diff(stamps)[1:] - 1 / 15).max() <= 0.004 + 1e-9
        first.append(stamps[1])
    assert np.diff(np.sort(first)) == pytest.approx(1 / 150, abs=0.004 + 1e-9)


def test_images_come_in_the_order_in_which_they_were_taken(worlds, stage, kinds) -> None:
    _, scene, world = stage
    _, state, tracks = next(iter(worlds.random_encounters(scene, 1, 5)))
    models = [Ideal(latency=late) for late in (0.05, 0.0, 0.02, 0.01)]
    came = looks(ZoneSensors(scene, world, kinds, models), world, state, tracks.row(0), 100)
    for k in range(100):
        stamps = [stamp for tick, _, stamp in came if tick == k]
        assert stamps == sorted(stamps)


def test_mistakes_are_named(stage, kinds) -> None:
    _, scene, world = stage
    with pytest.raises(ConfigurationError, match="models"):
        ZoneSensors(scene, world, kinds, [Ideal()])
    with pytest.raises(ConfigurationError, match="names of their own"):
        ZoneSensors(scene, world, [kinds[0], kinds[0]])
    with pytest.raises(ConfigurationError, match="mount"):
        ZoneSensors(scene, world, [vl53l5cx("a", mount="elbow")])
