"""The smallest distance of the robot to people in a run, measured only where it could be the smallest: compiled."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import entry, linked
from qpsafe.compiled.memory import view
from qpsafe.geometry.separation import hull_types
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, cut, forward
from qpsafe.sim.campaign.trials.closest import ways_of
from qpsafe.sim.engine import nearest
from qpsafe.sim.engine.nearest import PAIR, robot_to_people

if TYPE_CHECKING:
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.sim.engine.tracks import PersonTracks

Array = NDArray[np.float64]

_forward, _to_people = linked(forward), linked(robot_to_people, *nearest.USES)
_ints, _pairs = types.Array(types.int64, 1, "C", readonly=True), types.Array(types.int64, 2, "C", readonly=True)
_one, _two, _three, _four = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3, 4))
_out = types.float64[::1]
_SPARE = 0.2  # farther than this above the smallest distance it need not be known exactly [m]


class PeopleAlong:
    """People who come, to be measured along many runs.

    Args:
        station: With robot and world.
        tracks: Everybody, tick by tick.
        shapes: The robot's that count, (r,); all of them by default.
    """

    def __init__(self, station: Station, tracks: PersonTracks, shapes: Index | None = None) -> None:
        world, robot = station.world, station.robot
        chosen = world.robot if shapes is None else shapes
        self._tracks, self._steps = tracks, steps_of(tracks)
        self._robot = (*robot.tree, ways_of(station), chosen, *world.solid)
        others = len(tracks.radii) + tracks.boards.shape[1]
        self._work = np.empty(robot.memory), np.empty(PAIR + len(chosen) * others), np.empty(7)

    def smallest(self, q: Array, first: int = 0, *, tolerance: float = 0.0, enough: float = -inf) -> float:
        """Smallest distance from a tick on [m].

        Args:
            q: Measured, at the ticks from `first` on (t, n) [rad].
            first: The tick.
            tolerance: By how much it may be less than what is told, at most [m].
            enough: Below that it need not be exact [m].
        """
        end, tracks = first + len(q), self._tracks
        return float(
            _along_people(
                np.ascontiguousarray(q), *self._robot, tracks.ends[first:end], tracks.radii, tracks.balls[first:end],
                tracks.boards[first:end], tracks.half_sizes, self._steps[first:end], tolerance, enough, *self._work,
            )
        )  # fmt: skip


def steps_of(tracks: PersonTracks) -> Array:
    """How far any point of anybody, or of a board, moves at most in each tick, the last one standing still (T,) [m]."""
    # a point of a capsule moves with a mean of its axis's ends; one of a board with a mean of its corners
    moved = [np.linalg.norm(np.diff(tracks.ends, axis=0), axis=3).reshape(len(tracks) - 1, -1)]
    if tracks.boards.shape[1]:
        signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
        corners = np.einsum("tbij,bkj->tbki", tracks.boards[..., :3, :3], signs * tracks.half_sizes[:, None])
        corners += tracks.boards[:, :, None, :3, 3]
        moved.append(np.linalg.norm(np.diff(corners, axis=0), axis=3).reshape(len(tracks) - 1, -1))
    return np.append(np.concatenate(moved, axis=1).max(axis=1, initial=0.0), 0.0)


@entry(
    types.float64(
        _two, *kinematics.tree_types, _one, _ints, _pairs, _two, *hull_types, _four, _one, _three, _four, _two, _one,
        types.float64, types.float64, _out, _out, _out,
    ),
    *nearest.USES, nearest, compiled,
)  # fmt: skip
def _along_people(
    q: Array, parents: Index, placements: Array, axes: Array, supports: Array, end_bodies: Index, end_places: Array,
    ways: Array, robot: Index, index: Index, shapes: Array, vertices: Array, starts: Index, neighbours: Index,
    planes: Array, ends: Array, radii: Array, balls: Array, boards: Array, half_sizes: Array, steps: Array,
    tolerance: float, enough: float, memory: Array, work: Array, found: Array,
) -> float:  # fmt: skip
    """The smallest distance of all ticks.

    It falls from tick to tick by no more than people's step and the robot's: where it cannot have become the smallest
    one yet, it is not measured.
    """
    ticks, n, segments, people, held = q.shape[0], q.shape[1], radii.shape[0], balls.shape[1], boards.shape[1]
    best, bound = inf, -inf
    for k in range(ticks):
        if k > 0:
            bound -= steps[k - 1]
            for j in range(n):
                bound -= ways[j] * abs(q[k, j] - q[k - 1, j])
        if bound >= best - tolerance:
            continue
        _forward(view(q, k * n, (n,)), parents, placements, axes, supports, end_bodies, end_places, memory)
        _to_people(
            cut(memory, n, end_bodies.shape[0])[0], robot, index, shapes, vertices, starts, neighbours, planes,
            view(ends, k * segments * 6, (segments, 2, 3)), radii, view(balls, k * people * 4, (people, 4)),
            view(boards, k * held * 16, (held, 4, 4)), half_sizes, best + _SPARE, work, found,
        )  # fmt: skip
        bound = min(found[0], best + _SPARE)
        best = min(best, bound)
        if best < enough:
            break
    return best
