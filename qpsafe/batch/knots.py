"""Trajectories of any kind as knots that compiled code interpolates, checked against them."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, inf
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.batch import code, reference_kernel
from qpsafe.batch.reference_kernel import interpolate
from qpsafe.compiled.compiled import entry
from qpsafe.compiled.memory import view
from qpsafe.errors import in_words
from qpsafe.tasks import clik, offset
from qpsafe.tasks.moves import Arc, Dwell, JointMoveOfFrame, Line
from qpsafe.tasks.offset import rate_of, rotation_between
from qpsafe.tasks.program import Program
from qpsafe.tasks.trajectory import FixedPose, Sample

Array = NDArray[np.float64]

#: How far interpolation may be off: places and angles [m, rad], their rates [m/s, rad/s].
POSE_TOLERANCE, TWIST_TOLERANCE = 1e-10, 1e-8
_FINEST = 1024  # parts of a tick that knots may be apart
_BETWEEN = (0.21, 0.5, 0.83)  # shares of the way between knots that are looked at
_ENDING = (Line, Arc, Dwell, JointMoveOfFrame)  # at rest at their goal from `duration` on


class Refused(Exception):
    """Why a trajectory cannot be made into knots, in words."""


class Path(NamedTuple):
    """A trajectory in knots.

    Attributes:
        kind: `FIXED`, `RESTS`, `CYCLES` or `ENDS`.
        period: Time of its last knot [s].
        times: Of the knots (K,) [s].
        knots: (K, `KNOT`).
        events: Times and names.
    """

    kind: int
    period: float
    times: Array
    knots: Array
    events: tuple[tuple[float, str], ...]


@entry(types.void(types.float64[:, ::1]), clik, offset, code)
def _link(knots: Array) -> None:
    """Fill in how each knot turns to the next one."""
    for k in range(knots.shape[0] - 1):
        here, after = view(knots, k * code.KNOT, (4, 4)), view(knots, (k + 1) * code.KNOT, (4, 4))
        turn = rotation_between(after, here)
        rate = rate_of(turn, (knots[k + 1, code.TWIST + 3], knots[k + 1, code.TWIST + 4], knots[k + 1, code.TWIST + 5]))
        for c in range(3):
            knots[k, code.TURN + c], knots[k, code.TURN_RATE + c] = turn[c], rate[c]


_read, _rows = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.float64, 2, "C", readonly=True)


@entry(types.void(_read, _rows, _read, types.float64[:, :, ::1], types.float64[:, ::1]), reference_kernel, offset, code)
def _sample_knots(times: Array, knots: Array, at: Array, poses: Array, twists: Array) -> None:
    for k in range(at.shape[0]):
        interpolate(times, knots, at[k], poses[k], twists[k])


def path_of(trajectory: Any, dt: float, horizon: float) -> Path:
    """A trajectory in knots.

    Args:
        trajectory: Any that gives `Sample`s.
        dt: Tick [s]; knots are a tick apart where that is near enough.
        horizon: How far one is looked at that tells no end [s].

    Raises:
        Refused: It cannot be followed so.
    """
    if type(trajectory) is FixedPose:
        return Path(code.FIXED, inf, np.zeros(1), _sampled(trajectory, [0.0]), ())
    if type(trajectory) is Program:
        return _of_program(trajectory, dt)
    if isinstance(trajectory, Program):
        kind, end = (code.CYCLES if trajectory.cycle else code.RESTS), trajectory.duration
    elif isinstance(trajectory, _ENDING):
        kind, end = code.RESTS, trajectory.duration
    else:
        kind, end = code.ENDS, horizon
    return _knotted(trajectory, dt, kind, end)


@lru_cache(maxsize=8)
def _of_program(program: Program, dt: float) -> Path:
    """A program never changes: the knots of the last ones are not made once more."""
    return _knotted(program, dt, code.CYCLES if program.cycle else code.RESTS, program.duration)


def _knotted(trajectory: Any, dt: float, kind: int, end: float) -> Path:
    """A trajectory up to its end [s], with as many knots as it takes.

    Args:
        trajectory: Any that gives `Sample`s.
        dt: Tick [s].
        kind: What it does at its end.
        end: [s].
    """
    times = np.append(np.arange(ceil(end / dt - 1e-9)) * dt, end)
    knots = _sampled(trajectory, times)
    new = np.arange(len(times) - 1)  # ways between knots that nobody has looked at
    for _ in range(_FINEST.bit_length()):
        _link(knots)
        wrong = new[_off(trajectory, times, knots, new)]
        if not len(wrong):
            return Path(kind, end, times, knots, _events(trajectory, end))
        middles = 0.5 * (times[wrong] + times[wrong + 1])
        knots = np.insert(knots, wrong + 1, _sampled(trajectory, middles), 0)
        times = np.insert(times, wrong + 1, middles)
        new = np.repeat(wrong + np.arange(len(wrong)), 2)
        new[1::2] += 1
    raise Refused(f"it jumps, or shakes too quickly to be interpolated, at {times[wrong[0]]:.6g} s")


def _off(trajectory: Any, times: Array, knots: Array, ways: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of the ways between knots are interpolated too far off the trajectory."""
    off = np.zeros(len(ways), dtype=np.bool_)
    for share in _BETWEEN:
        at = (1.0 - share) * times[ways] + share * times[ways + 1]
        poses, twists = np.empty((len(at), 4, 4)), np.empty((len(at), 6))
        _sample_knots(times, knots, at, poses, twists)
        true = _sampled(trajectory, at)
        off |= np.abs(poses.reshape(-1, 16) - true[:, code.POSE : code.TWIST]).max(axis=1, initial=0.0) > POSE_TOLERANCE
        off |= np.abs(twists - true[:, code.TWIST : code.TURN]).max(axis=1, initial=0.0) > TWIST_TOLERANCE
    return off


def _events(trajectory: Any, end: float) -> tuple[tuple[float, str], ...]:
    """Times and names of the events of one cycle, or up to the end."""
    if isinstance(trajectory, Program):
        return tuple((event.time, event.name) for event in trajectory.events)
    found: list[tuple[float, str]] = []
    while hasattr(trajectory, "event"):
        event = trajectory.event(len(found))
        if event is None or event.time > end:
            break
        found.append((float(event.time), str(event.name)))
    return tuple(found)


def _sampled(trajectory: Any, times: Any) -> Array:
    knots = np.zeros((len(times), code.KNOT))
    for k, time in enumerate(times):
        try:
            sample = trajectory.sample(float(time))
        except Exception as error:  # somebody's own
            raise Refused(f"it fails at {time:.6g} s: {in_words(error)}") from error
        if type(sample) is not Sample or sample.pose.shape != (4, 4) or not sample.finite:
            raise Refused(f"its sample at {time:.6g} s is no finite Sample")
        knots[k, code.POSE : code.TWIST], knots[k, code.TWIST : code.TURN] = sample.pose.ravel(), sample.twist
    return knots
