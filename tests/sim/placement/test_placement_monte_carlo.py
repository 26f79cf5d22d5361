"""Monte Carlo pairs: feasible, reproducible for any sharing out, detections as single rays find them, errors."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
import pytest
from amounts import some

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.placement.candidates import Candidates, candidate_nodes, node_pose
from qpsafe.placement.objective import SensorName
from qpsafe.placement.sample import NEAR, Sample
from qpsafe.placement.sensors import SENSORS
from qpsafe.sim.people.anatomy import SEGMENTS
from qpsafe.sim.placement import cast as placement_cast
from qpsafe.sim.placement.cast import cast_pairs, pieces
from qpsafe.sim.placement.draw import draw_pairs
from qpsafe.sim.placement.dummy import DRAWS, RADII, dummies
from qpsafe.sim.placement.run import MonteCarlo
from qpsafe.sim.placement.world import PlacementWorld

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")


@pytest.fixture(scope="module")
def nodes() -> Candidates:
    return candidate_nodes(ROBOT, spacing=some(20, of=8) / 100)


@pytest.fixture(scope="module")
def world() -> PlacementWorld:
    return PlacementWorld(ROBOT)


def same(a: Sample, b: Sample) -> None:
    for key in ("first", "node", "danger", "torque", "peak", "near"):
        np.testing.assert_array_equal(getattr(a, key), getattr(b, key))
    assert (a.on_robot, a.too_near) == (b.on_robot, b.too_near)


def test_dummies_have_a_persons_bones_and_stand_on_the_floor() -> None:
    capsules = dummies(np.random.default_rng(0).random((50, DRAWS)), 1.0, -0.55)
    lengths = np.linalg.norm(capsules[:, :, 1] - capsules[:, :, 0], axis=2)
    expected = np.broadcast_to([s.length for s in SEGMENTS], lengths.shape)
    np.testing.assert_allclose(lengths, expected, atol=1e-9)
    lowest = (capsules[..., 2].min(axis=2) - RADII).min(axis=1)
    np.testing.assert_allclose(lowest, -0.55, atol=1e-6)


def test_pairs_are_within_limits_and_nothing_touches(world: PlacementWorld) -> None:
    """Every shape of the robot is compared with every capsule and every part that may touch it, by distances."""
    q, capsules = draw_pairs(world, 3, 0, range(12), 1.0)
    assert ((q >= ROBOT.lower) & (q <= ROBOT.upper)).all()
    model, data = world.model, world.data
    robot = np.flatnonzero(model.geom_group == 3)
    dummy = np.flatnonzero(model.geom_group == 1)
    excluded = {tuple(sorted(divmod(int(s), 65536))) for s in model.exclude_signature}
    segment = np.empty(6)
    for k in range(12):
        world.place(q[k], capsules[k])
        mujoco.mj_kinematics(model, data)
        for g in robot:
            for h in dummy:
                assert mujoco.mj_geomDistance(model, data, g, h, 5.0, segment) > -1e-6
            for h in robot:
                a, b = sorted((int(model.geom_bodyid[g]), int(model.geom_bodyid[h])))
                if a != b and (a, b) not in excluded:
                    assert mujoco.mj_geomDistance(model, data, g, h, 5.0, segment) > -1e-6


def test_a_dummy_in_the_base_is_not_feasible(world: PlacementWorld) -> None:
    """The base does not move, so no contact would be found between it and a mocap body."""
    for x, expected in ((0.0, False), (-0.15, False), (1.5, True)):
        assert world.feasible(ROBOT.home, dummies(np.full((1, DRAWS), 0.5), 0.0, -0.55)[0] + [x, 0.0, 0.0]) is expected


def test_a_configuration_that_touches_itself_is_not_feasible(world: PlacementWorld) -> None:
    far = dummies(np.full((1, DRAWS), 0.5), 0.0, -0.55)[0] + [3.0, 0.0, 0.0]
    assert world.feasible(ROBOT.home, far)
    assert not world.feasible(np.deg2rad([0.0, 100.0, 40.0, 0.0, 0.0, 0.0]), far)  # the tool in the pedestal
    assert not world.feasible(np.deg2rad([0.0, -60.0, -220.0, 0.0, 100.0, 0.0]), far)


def test_detections_are_what_single_rays_find(nodes: Candidates, world: PlacementWorld) -> None:
    simulation = MonteCarlo(ROBOT, nodes, seed=5)
    found = cast_pairs(simulation.setup, 0, 0, 16)
    q, capsules = draw_pairs(world, 5, 0, range(16), simulation.setup.radius)
    spots, field = nodes.nodes, qpsafe.DangerField(1.0, 0.0)
    seen = np.zeros(6, np.uint8)
    seen[[0, 1, 3]] = 1
    own, start, blocked = world.bodies_of(spots), 0, 0
    for p in range(16):
        world.place(q[p], capsules[p])
        state = ROBOT.at(q[p])
        origins, directions = spots.rays(state)
        expected = []
        for i in range(len(spots)):
            geom = np.full(1, -1, np.int32)
            d = mujoco.mj_ray(world.model, world.data, origins[i], directions[i], seen, 1, int(own[i]), geom)
            group = world.model.geom_group[geom[0]] if geom[0] >= 0 else -1
            blocked += int(group == 3 and d <= 0.8)
            if group == 1 and 0.2 <= d <= 0.8:
                value = field.value((origins[i] + d * directions[i])[None], state.wire(np.zeros(6)))[0]
                expected.append((i, value))
        end = start + int(found.counts[p])
        assert found.nodes[start:end].tolist() == [i for i, _ in expected]
        assert found.danger[start:end] == pytest.approx([v for _, v in expected], rel=1e-6)
        assert (found.danger[start:end] <= found.peak[p] * 1.001).all()  # max SDF is the largest there is
        start = end
    assert found.on_robot == blocked > 0
    assert start > some(10, of=20)


@pytest.fixture(scope="module")
def arrays() -> Candidates:
    return candidate_nodes(ROBOT, spacing=0.12, sensor=SENSORS[SensorName.vl53l5cx])


@pytest.mark.slow
def test_an_array_detects_what_any_of_its_zones_finds(arrays: Candidates, world: PlacementWorld) -> None:
    """Every zone's ray is cast by itself, none left out, and a node's most dangerous point counts."""
    simulation = MonteCarlo(ROBOT, arrays, seed=5)
    found = cast_pairs(simulation.setup, 0, 0, 3)
    q, capsules = draw_pairs(world, 5, 0, range(3), simulation.setup.radius)
    field, seen = qpsafe.DangerField(1.0, 0.0), np.array([1, 1, 0, 1, 0, 0], np.uint8)
    own, geom, start = world.bodies_of(arrays.nodes), np.full(1, -1, np.int32), 0
    for p in range(3):
        nearest, _ = world.nearest(q[p], capsules[p])
        state = ROBOT.at(q[p])
        expected = []
        for i, frame in enumerate(arrays.nodes.frames):
            T = state.pose(frame) @ node_pose(arrays.nodes.positions[i], arrays.nodes.directions[i])
            points = []
            for direction in arrays.sensor.directions[arrays.free[i]] @ T[:3, :3].T:
                d = mujoco.mj_ray(world.model, world.data, T[:3, 3], direction, seen, 1, int(own[i]), geom)
                if geom[0] >= 0 and world.model.geom_group[geom[0]] == 1 and 0.02 <= d <= 4.0:
                    points.append(T[:3, 3] + d * direction)
            if points:
                close = np.linalg.norm(np.array(points) - nearest, axis=1).min() <= NEAR
                expected.append((i, field.value(np.array(points), state.wire(np.zeros(6))).max(), close))
        end = start + int(found.counts[p])
        assert found.nodes[start:end].tolist() == [i for i, _, _ in expected]
        assert found.danger[start:end] == pytest.approx([value for _, value, _ in expected], rel=1e-6)
        assert found.near[start:end].tolist() == [close for _, _, close in expected]
        start = end
    assert 0 < found.near.sum() < len(found.nodes)


def test_the_nearest_point_is_as_near_as_any_pair_of_shapes(world: PlacementWorld) -> None:
    q, capsules = draw_pairs(world, 4, 0, range(6), 1.0)
    model, segment = world.model, np.empty(6)
    moving = [g for g in np.flatnonzero(model.geom_group == 3) if model.body_weldid[model.geom_bodyid[g]] != 0]
    dummy = np.flatnonzero(model.geom_group == 1)
    for k in range(6):
        point, distance = world.nearest(q[k], capsules[k])
        every = [mujoco.mj_geomDistance(model, world.data, g, h, 5.0, segment) for g in moving for h in dummy]
        assert distance == pytest.approx(min(every), abs=1e-6)
        axes = capsules[k][:, 1] - capsules[k][:, 0]  # on the dummy's skin
        share = ((point - capsules[k][:, 0]) * axes).sum(axis=1) / (axes**2).sum(axis=1)
        foot = capsules[k][:, 0] + np.clip(share, 0.0, 1.0)[:, None] * axes
        assert np.abs(np.linalg.norm(point - foot, axis=1) - RADII).min() < 1e-5


def test_the_torque_is_that_of_the_evasive_motion_alone(nodes: Candidates, world: PlacementWorld) -> None:
    """Eqs. (14), (15) by frame Jacobians."""
    simulation = MonteCarlo(ROBOT, nodes, seed=5)
    found = cast_pairs(simulation.setup, 0, 0, 8)
    q, _ = draw_pairs(world, 5, 0, range(8), simulation.setup.radius)
    pair = np.repeat(np.arange(8), found.counts)
    for a in range(0, len(pair), 5):
        state, i = ROBOT.at(q[pair[a]]), found.nodes[a]
        first, second = ROBOT.wire_frames[nodes.nodes.links[i]]
        largest = sum(np.linalg.norm(state.jacobian(frame)[:3], 2) for frame in (first, second)) * found.danger[a]
        assert 0.0 <= found.torque[a] <= largest * (1 + 1e-9)


def test_the_sample_does_not_depend_on_pieces_order_or_workers(
    nodes: Candidates, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = MonteCarlo(ROBOT, nodes, seed=2)
    alone = simulation.sample(64)
    assert alone.pairs == 64
    monkeypatch.setattr(placement_cast, "CHUNK", 32)
    assert len(pieces(64)) == 2
    with ThreadPoolExecutor(2) as executor:
        same(simulation.sample(64, 0, executor), alone)
    monkeypatch.undo()
    longer = simulation.sample(80)
    np.testing.assert_array_equal(longer.peak[:64], alone.peak)  # pairs do not depend on how many follow
    other = simulation.sample(64, 1)
    assert not np.isin(other.peak, alone.peak).any()
    assert not np.isin(MonteCarlo(ROBOT, nodes, seed=3).sample(20).peak, alone.peak).any()


@pytest.mark.slow
def test_two_dask_workers_find_the_same(nodes: Candidates) -> None:
    distributed = pytest.importorskip("distributed")
    simulation = MonteCarlo(ROBOT, nodes, seed=2)
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    )
    with cluster, distributed.Client(cluster) as client:
        same(simulation.sample(700, 0, client.get_executor()), simulation.sample(700))


def test_progress_reaches_the_end_and_never_falls(nodes: Candidates) -> None:
    done: list[int] = []
    MonteCarlo(ROBOT, nodes).sample(100, progress=done.append)
    assert done == sorted(done)
    assert done[-1] == 100


@pytest.mark.slow
def test_a_robot_that_always_touches_itself_is_named(tmp_path: Path) -> None:
    shutil.copytree(ROBOT.folder, tmp_path / "stuck")
    model = tmp_path / "stuck" / "robot.xml"
    block = '<geom class="collision" name="block" type="sphere" size="0.1" pos="0 0 -0.5"/>'  # always in the ground
    text = model.read_text(encoding="utf-8")
    joint = text.index('<joint name="joint_1"')
    model.write_text(text[:joint] + block + text[joint:], encoding="utf-8")
    robot = qpsafe.load_robot(tmp_path / "stuck")
    world = PlacementWorld(robot)
    world._ignored.clear()
    with pytest.raises(ConfigurationError, match="infeasible in a row"):
        draw_pairs(world, 0, 0, range(1), 1.0)


@pytest.mark.parametrize(
    ("key", "value"), [("radius", 0.0), ("radius", float("nan")), ("pedestal", -1.0), ("seed", -1)]
)
def test_a_value_that_makes_no_sense(key: str, value: float, nodes: Candidates) -> None:
    with pytest.raises(ConfigurationError, match=key):
        MonteCarlo(ROBOT, nodes, **{key: value})  # type: ignore[arg-type]


def test_no_pairs(nodes: Candidates) -> None:
    with pytest.raises(ConfigurationError, match="pairs = 0"):
        MonteCarlo(ROBOT, nodes).sample(0)
