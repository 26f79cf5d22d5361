"""Eq. (7) against MuJoCo's own rays and kinematics, cones, and the known obstacles of the scene."""

import mujoco
import numpy as np
import pytest
from amounts import some

import qpsafe
from qpsafe.sensing.hulls import HullSet
from qpsafe.sim.engine.spot_table import SpotTable
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.rays import SpotRays, cast
from qpsafe.sim.world.scene import SCENERY, build_scene

ROBOTS = [name for name in qpsafe.bundled_robots() if qpsafe.load_robot(name).spots_path is not None]
GROUPS = np.array([1, 1, 0, 1, 0, 0], dtype=np.uint8)


def frame_in_mujoco(scene, data, frame):
    """Pose of a frame of the robot as MuJoCo computes it."""
    model, target = scene.model, "robot/" + scene.robot.model.frames[scene.robot.frame_id(frame)].name
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, target)
    if site >= 0:
        return data.site_xmat[site].reshape(3, 3), data.site_xpos[site], int(model.site_bodyid[site])
    body = model.body(target).id
    return data.xmat[body].reshape(3, 3), data.xpos[body], body


@pytest.mark.parametrize("name", ROBOTS)
def test_points_are_where_mujocos_rays_hit(name):
    """1,000 random configurations: eq. (7) with the measured distance gives MuJoCo's hit within 1e-9 m."""
    robot = qpsafe.load_robot(name)
    scene, spots, rng = build_scene(robot), qpsafe.load_spots(robot), np.random.default_rng(0)
    data, hit_geom = scene.make_data(), np.zeros(1, dtype=np.int32)
    worst, hits, seen = 0.0, 0, set()
    for k in range(some(100, of=1000)):
        q = rng.uniform(robot.lower, robot.upper)
        data.qpos[scene.q_addresses] = q
        if k % 10 == 0:
            angle = rng.uniform(-np.pi, np.pi)
            pose = scene.person.pose(*(rng.uniform(0.7, 1.2) * np.array([np.cos(angle), np.sin(angle)])), angle + np.pi)
        scene.place_person(data, pose)
        distances, expected = np.zeros(len(spots)), np.full((len(spots), 3), np.nan)
        for i, frame in enumerate(spots.frames):
            R, p, body = frame_in_mujoco(scene, data, frame)
            origin, ray = p + R @ spots.positions[i], R @ spots.directions[i]
            d = mujoco.mj_ray(scene.model, data, origin, ray, GROUPS, True, body, hit_geom)
            if d >= 0.0:
                distances[i], expected[i] = d, origin + d * ray
                seen.add(int(scene.model.geom_group[hit_geom[0]]))
        found = np.isfinite(expected[:, 0]) & (distances < 5.0)
        points = spots.points(robot.at(q), distances)
        worst = max(worst, float(np.abs(points - expected)[found].max(initial=0.0)))
        hits += int(found.sum())
    assert worst < 1e-9
    assert hits > some(500, of=5000)
    assert seen == {0, 1, 3}  # floor and pedestal, person and board, the robot itself


def test_a_cone_sees_the_nearest_thing_in_it_and_never_less_than_its_axis():
    robot = qpsafe.load_robot("irb140")
    scene, spots, rng = build_scene(robot), qpsafe.load_spots(robot), np.random.default_rng(1)
    data, rays = scene.make_data(), SpotRays(scene, spots)
    nearer = 0
    for _ in range(40):
        q = robot.home + rng.uniform(-0.4, 0.4, 6)
        data.qpos[scene.q_addresses] = q
        scene.place_person(data, scene.person.pose(rng.uniform(0.8, 1.3), rng.uniform(-0.5, 0.5), np.pi))
        state = robot.at(q)
        cone = rays.distances(data, state, reach=3.0)
        axis = cast(scene, data, *spots.rays(state), 3.0, bodies=SpotTable.of(scene, spots).unseen)
        assert (cone <= axis).all()
        nearer += int((cone < axis).sum())
    assert nearer > 50


def test_known_obstacles_are_the_scenery():
    """On the surface of floor and pedestal a ray's point is inside; on the board it is not."""
    robot = qpsafe.load_robot("irb140")
    scene, rng = build_scene(robot), np.random.default_rng(2)
    data = scene.make_data()
    scene.place_person(data, scene.person.pose(1.0, 0.0, np.pi))
    hulls = HullSet([(0, obstacle.name, obstacle.vertices) for obstacle in known_obstacles(scene)])
    assert len(hulls) == int((scene.model.geom_group == SCENERY).sum())
    origins = rng.uniform((-0.9, -0.9, -0.4), (0.9, 0.9, 0.9), (400, 3))
    directions = rng.normal(size=(400, 3))
    distances = cast(scene, data, origins, directions, 2.0, groups=(SCENERY,))
    hit = np.isfinite(distances)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    points = origins[hit] + distances[hit, None] * unit[hit]
    assert hit.sum() > 100
    pose = np.eye(4)[None]
    assert (hulls.find(points, np.full(len(points), 0.002), pose) >= 0).all()
    before = points - 0.03 * unit[hit]
    outside = hulls.find(before, np.full(len(points), 0.002), pose) < 0
    assert outside.mean() > 0.85  # but for grazing rays
