"""A whole run in one compiled call, where all parts of a controller can be compiled: people, rays, tick and servo."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.batch import blocks, code, tick_kernel
from qpsafe.batch.blocks import OWN, SHARED, WORK
from qpsafe.batch.cuts import cut_own, cut_work
from qpsafe.batch.knots import Refused
from qpsafe.batch.pack import Packed, new_state, new_work, pack
from qpsafe.batch.tick_kernel import BLOCKS, tick_compiled
from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import entry, linked
from qpsafe.compiled.memory import view
from qpsafe.controller import SafetyController
from qpsafe.recovery.steps import PHASES
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, forward
from qpsafe.sim.campaign.opponents.registry import NOTHING, SPOTS, Opponent
from qpsafe.sim.campaign.trials import servo
from qpsafe.sim.campaign.trials.recording import Recording
from qpsafe.sim.campaign.trials.servo import DT, served
from qpsafe.sim.engine import spot_rays
from qpsafe.sim.engine.spot_rays import read_spots, work_size

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.senses import Senses
    from qpsafe.sim.campaign.trials.station import Station

Array = NDArray[np.float64]

_forward, _read_spots = linked(forward), linked(read_spots, *spot_rays.USES)


def packed(station: Station, entry: Opponent) -> Packed | None:
    """The blocks of a controller for a station, made once a process; None where a part of it cannot be compiled."""
    name = f"{entry.name} {entry.edition}".rstrip()
    if name not in station.packed:
        made, found = entry.make(station), None
        if isinstance(made, SafetyController):
            with suppress(Refused):
                found = pack(made)
        station.packed[name] = found
    return station.packed[name]


def play(station: Station, entry: Opponent, senses: Senses, ticks: int, lag: float = 0.0) -> Recording | None:
    """Run a controller, as `record` does; None where that has to be done tick by tick.

    Args:
        station: What the robot does where.
        entry: The controller.
        senses: What it is told: readings of ideal spots, or nothing.
        ticks: T.
        lag: Of the servo [s].
    """
    told = code.DISTANCES if entry.sight == SPOTS and senses.ideal else code.POINTS if entry.sight == NOTHING else None
    made = None if told is None else packed(station, entry)
    if made is None:
        return None
    world, robot, table, tracks = station.world, station.robot, senses.table, senses.tracks
    k, n = len(table.bodies), robot.nq
    state, (work, whole) = new_state(made, 1), new_work(made)
    runs, path_time, seen = np.empty((4, ticks, n)), np.empty(ticks), np.empty((ticks, k, 3))
    marks = np.empty((ticks, 3), dtype=np.int64)
    _play(
        *made.blocks, state.floats[0], state.integers[0], state.spots[0], work, whole,
        *robot.tree, *table, *world.seen, tracks.ends, tracks.radii, tracks.balls, tracks.boards, tracks.half_sizes,
        np.ascontiguousarray(station.start), round(lag / DT), told,
        np.empty(robot.memory), np.empty(work_size(world.index)), np.empty(k), np.empty(k, dtype=np.int64), np.zeros(k),
        runs, path_time, seen, marks,
    )  # fmt: skip
    points = [seen[i, :count] for i, count in enumerate(marks[:, 2].tolist())]
    phases = np.array(PHASES)[marks[:, 0]]
    return Recording(DT, runs[0], runs[1], runs[2], runs[3], phases, path_time, marks[:, 1].copy(), points)


_ints, _rows = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three, _four = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3, 4))
_out = types.float64[::1]


@entry(
    types.void(
        *BLOCKS[0], *BLOCKS[1], *BLOCKS[2], *kinematics.tree_types,
        _ints, _ints, _three, _one, _one, _rows, _two, _two, _rows, _two, _four, _one, _three, _four, _two,
        _one, types.int64, types.int64,
        _out, _out, _out, types.int64[::1], _out,
        types.float64[:, :, ::1], _out, types.float64[:, :, ::1], types.int64[:, ::1],
    ),
    *tick_kernel.USES, tick_kernel, *spot_rays.USES, spot_rays, servo, blocks, compiled,
)  # fmt: skip
def _play(
    floats: Array, integers: Index, f: Array, i: Index, own: Array, whole: Index, spots: Array, work: Array,
    work_whole: Index, parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index,
    end_places: Array, bodies: Index, unseen: Index, rays: Array, reaches: Array, slants: Array,
    index: Index, shapes: Array, boxes: Array, nodes: Index, triangles: Array, ends: Array, radii: Array, balls: Array,
    boards: Array, half_sizes: Array, start: Array, delay: int, told: int,
    memory: Array, ray_work: Array, readings: Array, hits: Index, ages: Array,
    runs: Array, path_time: Array, seen: Array, marks: Index,
) -> None:  # fmt: skip
    """Fill runs (4, T, n): measured q and q̇, reference q and q̇; path time (T,); points (T, k, 3); marks (T, 3).

    Marks are phase, status, and how many points counted.
    """
    ticks, n, segments, people, held = runs.shape[1], start.shape[0], radii.shape[0], balls.shape[1], boards.shape[1]
    s = cut_own(own, whole, view(integers, code.HEADS + SHARED, (OWN,)), integers)
    w = cut_work(work, work_whole, view(work_whole, 1, (WORK,)), integers, work_whole[0])
    nothing, nobody = view(ages, 0, (0,)), view(seen, 0, (0, 3))
    for j in range(n):
        runs[0, 0, j], runs[1, 0, j] = start[j], 0.0
    for k in range(ticks):
        q, qd = view(runs, k * n, (n,)), view(runs, (ticks + k) * n, (n,))
        if told == code.DISTANCES:
            _forward(q, parents, placements, axes, supports, end_bodies, end_places, memory)
            _read_spots(
                cut(memory, n, end_bodies.shape[0])[0], bodies, unseen, rays, reaches, slants,
                index, shapes, boxes, nodes, triangles, view(ends, k * segments * 6, (segments, 2, 3)), radii,
                view(balls, k * people * 4, (people, 4)), view(boards, k * held * 16, (held, 4, 4)), half_sizes,
                ray_work, readings, hits,
            )  # fmt: skip
            status = tick_compiled(
                floats, integers, f, i, own, whole, spots, work, work_whole, q, qd, readings, ages, nobody, told
            )  # fmt: skip
        else:
            status = tick_compiled(
                floats, integers, f, i, own, whole, spots, work, work_whole, q, qd, nothing, nothing, nobody, told
            )  # fmt: skip
        for j in range(n):
            runs[2, k, j], runs[3, k, j] = s.q[j], s.qd[j]
        path_time[k] = s.clock[code.TIME]
        count = s.marks[code.COUNT]
        marks[k, 0], marks[k, 1], marks[k, 2] = s.marks[code.PHASE], status, count
        for p in range(count):
            for c in range(3):
                seen[k, p, c] = w.points[p, c]
        if k + 1 == ticks:
            break
        served(runs, k, delay)
