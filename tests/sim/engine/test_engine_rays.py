"""The engine's rays against MuJoCo's, which share no code with them."""

import mujoco
import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.spot_table import SpotTable
from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.engine.world import World
from qpsafe.sim.experiments.pick_place.cell import Cell
from qpsafe.sim.world.rays import SpotRays, cast
from qpsafe.sim.world.scene import build_scene

NOBODY = PersonTracks.of((), [[]], 0.004)
EVERYWHERE = np.eye(4)[None].repeat(7, axis=0)
ROBOTS = qpsafe.bundled_robots()


def compare(worlds, name, count, seed=0):
    """Readings of both: (hits in both, hit in one only, largest difference where both hit)."""
    robot = qpsafe.load_robot(name)
    scene = build_scene(robot, people=worlds.PEOPLE, furnish=Cell(full=0).furnish)
    world, spots = World.of(scene), qpsafe.load_spots(robot)
    both, one, worst = 0, 0, 0.0
    for reach in (None, 0.3, 5.0):
        table = SpotTable.of(scene, spots, reach)
        reader = SpotReader(world, table)
        for data, state, tracks in worlds.random_encounters(scene, count, seed):
            found, _ = reader.read(state.body_poses(), tracks.row(0))
            expected = by_mujoco(scene, data, *spots.rays(state), table)
            hit, seen = np.isfinite(expected), np.isfinite(found)
            both, one = both + int((hit & seen).sum()), one + int((hit != seen).sum())
            worst = max(worst, float(np.abs(found[hit & seen] - expected[hit & seen]).max(initial=0.0)))
    return both, one, worst


def by_mujoco(scene, data, origins, axes, table):
    """What the cones see by `cast`: the axis and six rays on the mantle."""
    u = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.8, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(axes, u)
    angle = np.pi / 3 * np.arange(6)[None, :, None]
    mantle = axes[:, None] + table.slants[:, None, None] * (np.cos(angle) * u[:, None] + np.sin(angle) * v[:, None])
    rays = np.concatenate((axes[:, None], mantle), axis=1)
    return cast(scene, data, origins, rays, table.reaches, bodies=table.unseen).min(axis=1)


@pytest.mark.parametrize("name", first(1, ROBOTS))
def test_spots_read_what_mujocos_rays_meet(worlds, name):
    both, one, worst = compare(worlds, name, 40)
    assert both > 500
    assert one == 0
    assert worst < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_spots_read_what_mujocos_rays_meet_in_many_configurations(worlds, name):
    both, one, worst = compare(worlds, name, 700, seed=1)
    print(name, both, one, worst)
    assert one <= 1e-4 * both  # grazes
    assert worst < 1e-9


def test_what_can_move_is_seen_where_it_is(worlds):
    """Screws of the pick-and-place cell, thrown about: by the rays of an experiment, not by those of an encounter."""
    robot = qpsafe.load_robot("irb140")
    scene, spots = build_scene(robot, furnish=Cell().furnish), qpsafe.load_spots(robot)
    rays, fixed, rng = SpotRays(scene, spots), World.of(scene), np.random.default_rng(4)
    reader, seen = SpotReader(fixed, SpotTable.of(scene, spots)), 0
    for data, state, tracks in worlds.random_encounters(scene, 60, 4, (0.5, 1.6)):
        for joint in np.flatnonzero(scene.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
            at, i = scene.model.jnt_qposadr[joint], rng.integers(len(spots))
            origin, axis = (side[i] for side in spots.rays(state))
            data.qpos[at : at + 3] = origin + rng.uniform(0.05, 0.7) * axis
            data.qpos[at + 3 : at + 7] = rng.normal(size=4)
        mujoco.mj_kinematics(scene.model, data)
        expected = by_mujoco(scene, data, *spots.rays(state), SpotTable.of(scene, spots))
        assert rays.distances(data, state) == pytest.approx(expected, abs=1e-9)
        seen += int((reader.read(fixed.poses(state), tracks.row(0))[0] > expected + 1e-9).sum())
    assert seen > 100


def eyes(rng, count, slant=0.0):
    """Spots of one ray each, anywhere in the world, inside shapes too."""
    rays = np.zeros((count, 4, 2))
    rays[:, :3, 0], rays[:, 3, 0] = rng.uniform(-1.0, 1.0, (count, 3)), 1.0
    directions = rng.normal(size=(count, 3))
    rays[:, :3, 1] = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    rays[: count // 4, :3, 1] = np.eye(3)[rng.integers(0, 3, count // 4)]  # along the axes
    ints = np.zeros(count, dtype=np.int64)
    return SpotTable(ints, ints - 1, rays, np.full(count, 3.0), np.full(count, slant))


def test_rays_meet_every_kind_of_shape_as_mujocos_do(worlds):
    """From outside and from inside, meshes that are convex and one that is not."""
    kinds = set()
    for seed in range(3):
        scene = worlds.scene_of_shapes(seed)
        world, rng = World.of(scene), np.random.default_rng(seed)
        table = eyes(rng, 1500)
        data = scene.make_data()
        state = scene.robot.at(scene.robot.home)
        found, hits = SpotReader(world, table).read(state.body_poses(), NOBODY.row(0))
        expected = cast(scene, data, table.rays[:, :3, 0], table.rays[:, :3, 1], 3.0)
        hit = np.isfinite(expected)
        assert (hit == np.isfinite(found)).all()
        assert np.abs(found[hit] - expected[hit]).max() < 1e-9
        kinds |= set(world.index[hits[hit], 0].tolist())
        assert (hits[~hit] == -1).all()
    assert kinds == {0, 2, 3, 4, 5, 6, 7}


@pytest.mark.parametrize(("slant", "reach"), first(2, [(0.2, 3.0), (0.5, 0.4), (0.05, 0.5), (1.0, 1.0)]))
def test_a_cone_reads_the_least_of_its_rays(worlds, slant, reach):
    """What balls and boxes pass over in a cone, none of its rays would have met."""
    scene, count = worlds.scene_of_shapes(5), 1000
    table = eyes(np.random.default_rng(5), count, slant)._replace(reaches=np.full(count, reach))
    world, poses = World.of(scene), scene.robot.at(scene.robot.home).body_poses()
    person = worlds.PEOPLE[0]
    people = PersonTracks.of([person], [[person.pose(0.3, 0.0, 1.0)]], 0.004).row(0)
    cones, hits = SpotReader(world, table).read(poses, people)
    axes = table.rays[:, :3, 1]
    u = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.8, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v, least = np.cross(axes, u), np.full(count, np.inf)
    for i in range(-1, 6):
        d = axes + (slant * (np.cos(np.pi / 3 * i) * u + np.sin(np.pi / 3 * i) * v) if i >= 0 else 0.0)
        rays = table.rays.copy()
        rays[:, :3, 1] = d / np.linalg.norm(d, axis=1, keepdims=True)
        single, _ = SpotReader(world, table._replace(rays=rays, slants=np.zeros(count))).read(poses, people)
        least = np.minimum(least, single)
    assert (np.isfinite(cones) == np.isfinite(least)).all()
    seen = np.isfinite(cones)
    assert seen.sum() > 100
    assert np.abs(cones[seen] - least[seen]).max() < 1e-12
    # and the shape that is named is met by the cone if it is the only one there is
    g = len(world.names)
    assert (hits >= g).sum() > 10
    for i in np.flatnonzero((hits >= 0) & (hits < g))[:20]:
        only = SpotReader(world.take([hits[i]]), table).read(poses, NOBODY.row(0))[0]
        assert only[i] == pytest.approx(cones[i], abs=1e-12)


def test_a_cone_that_looks_straight_down_sees_a_floor_just_in_reach(worlds):
    scene = worlds.scene_of_shapes(0, count=0)
    rng, count = np.random.default_rng(3), 400
    table = eyes(rng, count, slant=0.2)
    table.rays[:, :3, 0] = rng.uniform((1.5, -2.0, 0.0), (3.0, 2.0, 0.0), (count, 3))
    table.rays[:, 2, 0] = -scene.pedestal + 3.0 * rng.uniform(0.9, 1.01, count)
    down = rng.normal(0.0, 0.15, (count, 3)) - np.array([0.0, 0.0, 1.0])
    table.rays[:, :3, 1] = down / np.linalg.norm(down, axis=1, keepdims=True)
    found, _ = SpotReader(World.of(scene), table).read(EVERYWHERE, NOBODY.row(0))
    expected = by_mujoco(scene, scene.make_data(), table.rays[:, :3, 0], table.rays[:, :3, 1], table)
    assert 100 < np.isfinite(expected).sum() < count
    assert found == pytest.approx(expected, abs=1e-9)


def test_what_is_met_has_a_name(worlds):
    """A person is met by number of capsule or board; somebody out of reach is not met."""
    scene = build_scene(qpsafe.load_robot("irb140"), people=worlds.PEOPLE)
    world = World.of(scene)
    g, spots = len(world.names), qpsafe.load_spots(scene.robot)
    reader, met = SpotReader(world, SpotTable.of(scene, spots)), set()
    for _, state, tracks in worlds.random_encounters(scene, 40, 3):
        found, hits = reader.read(state.body_poses(), tracks.row(0))
        assert ((hits >= 0) == np.isfinite(found)).all()
        alone, others = reader.read(state.body_poses(), NOBODY.row(0))
        assert (found <= alone).all()
        assert (hits[found == alone] == others[found == alone]).all()
        met |= {"nothing" if h < 0 else "world" if h < g else "body" if h < g + 34 else "board" for h in hits.tolist()}
    assert met == {"nothing", "world", "body", "board"}


def test_a_spot_that_is_no_ray_reads_nan(worlds):
    scene = worlds.scene_of_shapes(1, count=1)
    table = eyes(np.random.default_rng(0), 6)
    table.rays[1, 0, 0], table.rays[2, 1, 1], table.rays[3, :3, 1] = np.inf, np.nan, 0.0
    found, hits = SpotReader(World.of(scene), table).read(EVERYWHERE, NOBODY.row(0))
    assert np.isnan(found).tolist() == [False, True, True, True, False, False]
    assert (hits[1:4] == -1).all()


def test_the_order_of_shapes_does_not_matter(worlds):
    scene = worlds.scene_of_shapes(2)
    world, table = World.of(scene), eyes(np.random.default_rng(2), 300, slant=0.05)
    order = np.random.default_rng(0).permutation(len(world.names))
    poses = scene.robot.at(scene.robot.home).body_poses()
    one, hits = SpotReader(world, table).read(poses, NOBODY.row(0))
    other, mixed = SpotReader(world.take(order), table).read(poses, NOBODY.row(0))
    assert (one == other).all()
    mixed = np.where(mixed >= 0, order[mixed], -1)
    for i in np.flatnonzero(hits != mixed):  # one of two faces that lie in one plane
        alone = SpotReader(world.take([mixed[i]]), table).read(poses, NOBODY.row(0))[0]
        assert alone[i] == one[i]
    assert (hits != mixed).mean() < 0.1


def test_tracks_of_wrong_shape_are_refused(worlds):
    good = PersonTracks.of(worlds.PEOPLE, [[p.pose(1.0, 0.0, 0.0) for p in worlds.PEOPLE]] * 3, 0.004)
    assert good.ends.shape == (3, 34, 2, 3)
    assert good.balls.shape == (3, 2, 4)
    for change in ({"radii": good.radii[:5]}, {"ends": good.ends * np.nan}, {"names": good.names[1:]}):
        parts = {key: getattr(good, key) for key in ("ends", "radii", "boards", "half_sizes", "dt", "names")}
        with pytest.raises(ConfigurationError, match="PersonTracks"):
            PersonTracks(**(parts | change))
    ends = good.ends.reshape(3, 2, 34, 3)
    gaps = np.linalg.norm(ends - good.balls[:, :, None, :3], axis=3) + good.radii.reshape(2, 17).repeat(2, axis=1)
    assert (gaps <= good.balls[:, :, None, 3] + 1e-12).all()
