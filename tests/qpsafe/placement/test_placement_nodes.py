"""Candidate nodes: on the surface, equally spaced, outward, free; the wanted number; meshes; clear errors."""

from __future__ import annotations

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest
from amounts import some

import qpsafe
from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.placement.candidates import BLIND, Candidates, Sensor, _Patch, candidate_nodes, node_pose
from qpsafe.placement.grid import NEAREST, lattice, thin_out
from qpsafe.placement.objective import SensorName
from qpsafe.placement.sensors import SENSORS
from qpsafe.placement.sight import SelfSight, zone_rays
from qpsafe.placement.spots_toml import spots_toml
from qpsafe.placement.surface import link_surface, model_body
from qpsafe.robot.robot import Robot

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")


@pytest.fixture(scope="module")
def nodes() -> Candidates:
    return candidate_nodes(ROBOT, spacing=some(9, of=4) / 100)


@pytest.mark.slow
def test_the_irb140_has_as_many_nodes_as_the_source() -> None:
    assert len(candidate_nodes(ROBOT)) == 254


def test_nodes_have_names_of_their_own_and_fit_the_robot(nodes: Candidates) -> None:
    assert len(set(nodes.nodes.names)) == len(nodes) > some(25, of=150)
    nodes.nodes.check(ROBOT)


def test_nodes_lie_in_their_box_and_on_the_surface(nodes: Candidates) -> None:
    for i, region in enumerate(ROBOT.regions):
        mine = nodes.region == i
        points, normals = nodes.nodes.positions[mine], nodes.nodes.directions[mine]
        assert (points >= region.lower - 1e-8).all()
        assert (points <= region.upper + 1e-8).all()
        assert (nodes.nodes.links[mine] == region.link).all()
        surface = link_surface(ROBOT, region)
        faces = surface.normals()
        for point, normal in zip(points, normals, strict=True):
            height = np.abs(((point - surface.skin[:, 0]) * faces).sum(axis=1))
            assert height[(faces @ normal) > 1.0 - 1e-9].min() < 1e-7  # in the plane of a triangle with this normal


def test_nodes_are_no_nearer_to_each_other_than_the_spacing_allows(nodes: Candidates) -> None:
    for i in range(len(ROBOT.regions)):
        points, normals = nodes.nodes.positions[nodes.region == i], nodes.nodes.directions[nodes.region == i]
        gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
        same_way = (normals @ normals.T > 1e-6) & ~np.eye(len(points), dtype=bool)
        assert gaps[same_way].min(initial=1.0) >= NEAREST * nodes.spacing - 1e-12


def test_directions_point_out_of_the_body(nodes: Candidates) -> None:
    """1 mm off the surface a node is in no hull of the body, 2 mm below it is in one."""
    from qpsafe.sensing.body import body_hull_set

    hulls = body_hull_set(ROBOT)
    state = ROBOT.at(ROBOT.home)
    origins, directions = nodes.nodes.rays(state)
    bodies, _ = nodes.nodes.mounting(ROBOT)
    zero = np.zeros(1)
    for origin, direction, body in zip(origins, directions, bodies, strict=True):
        own = hulls.take(np.flatnonzero(hulls.bodies == body).tolist())
        assert own.find((origin + 0.001 * direction)[None], zero, state.body_poses())[0] < 0
        assert own.find((origin - 0.002 * direction)[None], zero, state.body_poses())[0] >= 0


@pytest.mark.slow
def test_the_spacing_is_found_that_gives_the_wanted_number(tmp_path: Path) -> None:
    """On two regions; on all of them it is found for `nodes`."""
    file = (ROBOT.folder / "robot.toml").read_text(encoding="utf-8")
    regions = file[file.index("[[regions]]") :].split("[[regions]]")
    few = with_regions(tmp_path, "[[regions]]".join(["", *regions[-2:]]))
    assert len(few.regions) == 2
    assert len(candidate_nodes(few, 17)) == 17


@pytest.mark.slow
def test_self_sight_is_that_of_every_ray_cast_in_every_pose() -> None:
    """Culled and given up early as it is, against mj_ray cast one by one along all rays in all poses."""
    sight = SelfSight(ROBOT, 0.16, 0.8, np.deg2rad(6.0))
    region = next(region for region in ROBOT.regions if region.name == "wrist")
    points, normals = lattice(
        (surface := link_surface(ROBOT, region)).skin, surface.normals(), np.stack((region.lower, region.upper)), 0.035
    )
    model, own = mujoco.MjModel.from_xml_path(str(ROBOT.model_path)), 0
    data, group = mujoco.MjData(model), np.array([0, 0, 0, 1, 0, 0], dtype=np.uint8)
    model.geom_group[:] = np.where((model.geom_contype != 0) | (model.geom_conaffinity != 0), 3, 2)
    own = model_body(model, ROBOT, region.frame)
    cone, hit = zone_rays(normals, sight.zones), np.zeros(1, dtype=np.int32)
    near = np.zeros((len(sight.configurations), len(points)), dtype=bool)
    for i, q in enumerate(sight.configurations):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        T = ROBOT.pose(region.frame, q)
        for k, (point, rays) in enumerate(zip(points @ T[:3, :3].T + T[:3, 3], cone @ T[:3, :3].T, strict=True)):
            found = [mujoco.mj_ray(model, data, point, ray, group, 1, own, hit, None) for ray in rays]
            reach = 0.8 if i < sight.around_home else 0.18
            near[i, k] = any(0.0 <= distance < reach for distance in found)
    around, elsewhere = near[: sight.around_home], near[sight.around_home :]
    for most in (0.0, 0.05, 0.5):
        expected = ~around.any(axis=0) & (elsewhere.mean(axis=0) <= most)
        assert (sight.clear(region.frame, points, normals, most) == expected).all()
        assert 0 < expected.sum() < len(points)


@pytest.mark.slow
def test_gaps_are_filled_as_if_every_fine_point_had_been_tried() -> None:
    """And as well at the next spacing, when some of them are known."""
    region = next(region for region in ROBOT.regions if region.name == "wrist")
    patch = _Patch(ROBOT, region, Sensor(), SelfSight(ROBOT, 0.16, 0.8, np.deg2rad(6.0)))
    patch.refine(0.012)
    usable = patch.usable(*patch.fine)
    assert 0 < usable.sum() < len(usable)
    filled = 0
    for spacing in (0.06, 0.05, 0.06):
        coarse = patch.usable_lattice(spacing)
        points, normals = (np.concatenate((a, b[usable])) for a, b in zip(coarse, patch.fine, strict=True))
        kept = thin_out(points, normals, NEAREST * spacing)
        filled += (kept >= len(coarse[0])).sum()
        for found, expected in zip(patch.grid(spacing), (points, normals), strict=True):
            assert np.array_equal(found, expected[kept])
    assert filled > 0


@pytest.mark.slow
def test_the_bundled_spots_do_not_see_the_robot_from_close_by() -> None:
    spots, sight = qpsafe.load_spots(ROBOT), SelfSight(ROBOT, 0.16, 0.8, np.deg2rad(6.0))
    assert spots is not None
    for i, frame in enumerate(spots.frames):
        assert sight.clear(frame, spots.positions[i : i + 1], spots.directions[i : i + 1], 0.3).all(), spots.names[i]


def test_a_flat_square_is_a_square_lattice() -> None:
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)
    up = np.array([[0.0, 0.0, 1.0]] * 2)
    points, normals = lattice(square, up, np.array([[0.0, 0, -1], [1, 1, 1]]), 0.25)
    kept = thin_out(points, normals, 0.95 * 0.25)
    expected = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2), -1).reshape(-1, 2)
    assert len(kept) == 25
    assert {tuple(p) for p in points[kept, :2].round(12)} == {tuple(p) for p in expected.round(12)}
    assert (normals[kept] == up[0]).all()


def test_the_constant_matrix_of_7_measures_along_its_z_axis() -> None:
    rng = np.random.default_rng(0)
    for normal in rng.normal(size=(20, 3)):
        n, p = normal / np.linalg.norm(normal), rng.normal(size=3)
        T = node_pose(p, n)
        assert np.linalg.inv(T) @ np.append(p + 0.3 * n, 1.0) == pytest.approx([0, 0, 0.3, 1], abs=1e-12)
        assert T[:3, :3] @ T[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)


def test_a_placement_written_is_what_the_controller_loads(nodes: Candidates, tmp_path: Path) -> None:
    chosen = [share * len(nodes) // 254 for share in (3, 70, 120, 200, 215)]
    path = tmp_path / "spots.toml"
    path.write_text(spots_toml(nodes, chosen, "a test"), encoding="utf-8")
    spots = qpsafe.SpotArray.load(path, ROBOT)
    assert spots.names == tuple(nodes.nodes.names[i] for i in chosen)
    assert spots.frames == tuple(nodes.nodes.frames[i] for i in chosen)
    assert (spots.links == nodes.nodes.links[chosen]).all()
    assert spots.positions == pytest.approx(nodes.nodes.positions[chosen], abs=6e-6)
    assert spots.directions == pytest.approx(nodes.nodes.directions[chosen], abs=1e-6)
    assert spots.range_max == pytest.approx(0.8)
    assert spots.field_of_view == pytest.approx(np.deg2rad(6.0))


@pytest.fixture(scope="module")
def arrays() -> Candidates:
    return candidate_nodes(ROBOT, spacing=some(28, of=12) / 100, sensor=SENSORS[SensorName.vl53l5cx])


def test_arrays_written_are_what_is_loaded_zone_by_zone(arrays: Candidates, tmp_path: Path) -> None:
    """Their zones look where the placement looked, up to what a square that is turned by a quarter looks at."""
    path = tmp_path / "spots-vl53l5cx.toml"
    path.write_text(spots_toml(arrays, range(len(arrays)), "a test"), encoding="utf-8")
    sensors = qpsafe.load_range_sensors(ROBOT, path)
    rays = zone_rays(arrays.nodes.directions, arrays.sensor.directions)
    assert tuple(sensor.name for sensor in sensors) == arrays.nodes.names
    for i, sensor in enumerate(sensors):
        assert (sensor.mount, sensor.shape) == (arrays.nodes.frames[i], (8, 8))
        assert (sensor.range_min, sensor.range_max) == (0.02, 4.0)
        assert sensor.period == pytest.approx(1.0 / 15.0)
        looks = sensor.directions @ sensor.pose[:3, :3].T
        assert np.linalg.norm(looks[:, None] - rays[i], axis=2).min(axis=1).max() < 1e-6


def test_zones_that_look_at_their_own_link_are_those_whose_rays_meet_it(arrays: Candidates) -> None:
    """By MuJoCo's rays, which leave from 1 mm above the skin; few are, and no node has many."""
    model = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))
    data, hit = mujoco.MjData(model), np.zeros(1, dtype=np.int32)
    data.qpos[:] = ROBOT.home
    mujoco.mj_kinematics(model, data)
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    group = np.array([0, 0, 0, 1, 0, 0], dtype=np.uint8)
    different = 0
    for i, frame in enumerate(arrays.nodes.frames):
        own = model_body(model, ROBOT, frame)
        model.geom_group[:] = np.where(solid & (model.geom_bodyid == own), 3, 2)
        T = ROBOT.pose(frame, ROBOT.home)
        start = T[:3, :3] @ (arrays.nodes.positions[i] + 1e-3 * arrays.nodes.directions[i]) + T[:3, 3]
        rays = zone_rays(arrays.nodes.directions[i : i + 1], arrays.sensor.directions)[0] @ T[:3, :3].T
        free = [mujoco.mj_ray(model, data, start, ray, group, 1, -1, hit, None) < 0.0 for ray in rays]
        different += int((np.array(free) != arrays.free[i]).sum())
    assert (~arrays.free).mean(axis=1).max() <= BLIND
    assert (~arrays.free).sum() > 0
    assert different <= 0.02 * arrays.free.size  # what only decorates hides too, and a ray may pass an edge


def test_caps_of_arrays_are_none_but_of_regions_that_take_nothing(arrays: Candidates) -> None:
    most = arrays.caps(ROBOT).most
    assert [cap == 0 for cap in most] == [region.at_most == 0 for region in ROBOT.regions]
    assert set(most.tolist()) == {0, len(arrays)}
    assert (arrays.links == 0).all()


def with_regions(folder: Path, text: str) -> Robot:
    """A copy of the robot with other regions."""
    shutil.copytree(ROBOT.folder, folder, ignore=shutil.ignore_patterns("*.py", "__pycache__"), dirs_exist_ok=True)
    file = folder / "robot.toml"
    head = file.read_text(encoding="utf-8").partition("[[regions]]")[0]
    file.write_text(head + text, encoding="utf-8")
    return qpsafe.load_robot(folder)


BOX = "lower = [-0.44, -0.14, -0.18]\nupper = [0.09, 0.10, -0.06]\n"


def test_a_mesh_of_the_users_own(tmp_path: Path) -> None:
    """A cube of trimesh's instead of the model's geometry: 6 faces of 3 x 3 points."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.4, 0.4, 0.4)).export(tmp_path / "cube.stl")
    box = "lower = [-1.0, -1.0, -1.0]\nupper = [1.0, 1.0, 1.0]\nself_sight = 1.0\n"
    robot = with_regions(tmp_path, f'[[regions]]\nname = "cube"\nlink = 6\nmesh = "cube.stl"\n{box}')
    found = candidate_nodes(robot, spacing=0.2)
    assert np.abs(found.nodes.positions).max(axis=1) == pytest.approx(0.2)
    by_side = found.nodes.positions / 0.2 @ np.vstack((np.eye(3), -np.eye(3))).T
    faces = {tuple(d) for d in found.nodes.directions.round(9) + 0.0}
    assert len(faces) == len(by_side[0]) or len(faces) <= 6
    for direction, point in zip(found.nodes.directions, found.nodes.positions, strict=True):
        assert direction @ point == pytest.approx(0.2)


MISTAKES = {
    "link": ('name = "a"\nlink = 7\n' + BOX, "regions[0].link"),
    "frame": ('name = "a"\nlink = 2\nframe = "dh9"\n' + BOX, "regions[0].frame"),
    "box": ('name = "a"\nlink = 2\nlower = [0.1, 0, 0]\nupper = [0, 1, 1]\n', "regions[0].lower"),
    "mesh": ('name = "a"\nlink = 2\nmesh = "none.stl"\n' + BOX, "regions[0].mesh"),
    "name": (f'name = "a"\nlink = 2\n{BOX}[[regions]]\nname = "a"\nlink = 2\n{BOX}', "regions[1].name"),
    "at_most": ('name = "a"\nlink = 2\nat_most = -1\n' + BOX, "regions[0].at_most"),
    "key": ('name = "a"\nlink = 2\ncolour = 1\n' + BOX, "regions[0].colour"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_region_names_file_key_and_value(mistake: str, tmp_path: Path) -> None:
    text, key = MISTAKES[mistake]
    with pytest.raises(RobotFileError) as caught:
        with_regions(tmp_path, "[[regions]]\n" + text)
    assert caught.value.key == key
    assert caught.value.where == str(tmp_path / "robot.toml")


def test_a_robot_without_a_region(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"regions = None: expected at least one \[\[regions\]\]"):
        candidate_nodes(with_regions(tmp_path, ""))


def test_a_box_beside_the_robot(tmp_path: Path) -> None:
    text = '[[regions]]\nname = "air"\nlink = 2\nlower = [5.0, 5.0, 5.0]\nupper = [6.0, 6.0, 6.0]\n'
    with pytest.raises(RobotFileError, match=r"regions \(air\)"):
        candidate_nodes(with_regions(tmp_path, text))


@pytest.mark.parametrize("wanted", [0, -3])
def test_no_nodes_are_wanted(wanted: int) -> None:
    with pytest.raises(ConfigurationError, match="nodes >= 1"):
        candidate_nodes(ROBOT, wanted)
