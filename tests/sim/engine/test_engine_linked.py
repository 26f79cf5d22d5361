"""The engine's kernels called by another kernel, over all ticks of a trial, as a compiled loop does."""

import numpy as np
from numba import types

import qpsafe
from qpsafe.compiled.compiled import entry, linked
from qpsafe.geometry.pairs import PAIR
from qpsafe.sim.engine import nearest, spot_rays
from qpsafe.sim.engine.distances import Distances
from qpsafe.sim.engine.nearest import robot_to_people
from qpsafe.sim.engine.spot_rays import SpotReader, read_spots, work_size
from qpsafe.sim.engine.spot_table import SpotTable
from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.engine.world import World
from qpsafe.sim.world.scene import build_scene

_read_spots, _robot_to_people = linked(read_spots, *spot_rays.USES), linked(robot_to_people, *nearest.USES)

_ints, _table = (types.Array(types.int64, ndim, "C", readonly=True) for ndim in (1, 2))
_one, _two, _three, _four, _five = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in range(1, 6))


@entry(
    types.void(
        _four, types.Tuple((_ints, _ints, _three, _one, _one)), types.Tuple((_table, _two, _two, _table, _two)),
        types.Tuple((_table, _two, _two, _ints, _ints, _two)), _ints,
        types.Tuple((types.Array(types.float64, 4, "C", readonly=True), _one, _three, _four, _two)),
        types.float64[::1], types.float64[:, ::1], types.int64[::1], types.float64[:, ::1],
    ),
    nearest, *nearest.USES, spot_rays, *spot_rays.USES,  # a kernel in the cache calls those that were there with it
)  # fmt: skip
def _trial(poses, spots, seen, solid, robot, people, work, readings, hits, gaps):
    ends, radii, balls, boards, half_sizes = people
    for k in range(poses.shape[0]):
        row = ends[k], radii, balls[k], boards[k], half_sizes
        _read_spots(poses[k], *spots, *seen, *row, work, readings[k], hits)
        _robot_to_people(poses[k], robot, *solid, *row, np.inf, work, gaps[k])


def test_a_trial_in_one_kernel_is_the_same_tick_by_tick(worlds):
    robot = qpsafe.load_robot("irb140")
    scene, spots = build_scene(robot, people=worlds.PEOPLE), qpsafe.load_spots(robot)
    world, table = World.of(scene), SpotTable.of(scene, spots)
    encounters = [(state, tracks) for _, state, tracks in worlds.random_encounters(scene, 30, 0)]
    poses = np.array([state.body_poses() for state, _ in encounters])
    one = encounters[0][1]
    tracks = PersonTracks(
        np.concatenate([t.ends for _, t in encounters]), one.radii,
        np.concatenate([t.boards for _, t in encounters]), one.half_sizes, 0.004, one.names,
    )  # fmt: skip
    readings, gaps, hits = np.empty((30, len(spots))), np.empty((30, 7)), np.empty(len(spots), dtype=np.int64)
    work = np.empty(max(work_size(world.index), PAIR + len(world.robot) * (34 + 1)))
    people = tracks.ends, tracks.radii, tracks.balls, tracks.boards, tracks.half_sizes
    _trial(poses, tuple(table), world.seen, world.solid, world.robot, people, work, readings, hits, gaps)
    reader, distances = SpotReader(world, table), Distances(world, robot)
    for k in range(30):
        assert (readings[k] == reader.read(poses[k], tracks.row(k))[0]).all()
        found = distances.people(poses[k], tracks.row(k))
        assert gaps[k].tolist() == [found.distance, *found.on_robot, *found.on_other]
    assert np.isfinite(readings).any()
