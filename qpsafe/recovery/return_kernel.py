"""How tasks come back to their references, compiled: by offsets that fade smoothly.

o = x - x_d;   ȯ = (o - o of the last tick) / dt
held:       o stays, ȯ <- what is left of it from tick to tick
returning:  o <- (1 - s) o_r + r T ȯ_r, and its rate;   s = minimum_jerk(t/T), r = run_out(t/T), T = `return_time`
the reference is x_d displaced by o, ẋ_d by ȯ
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from numba import types

from qpsafe.compiled.compiled import Array, entry, inline
from qpsafe.compiled.memory import view
from qpsafe.recovery import steps
from qpsafe.recovery.steps import GO_ON, HOLD
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index, frame_pose
from qpsafe.tasks import clik
from qpsafe.tasks import offset as offsets
from qpsafe.tasks.offset import displace_into, offset_into

#: Numbers of the rules, in this order.
DT, KEPT, SPEED, ANGULAR_SPEED, JOINT_SPEED, SHORTEST = range(6)
#: Of a return: its duration and the time since its start [s].
DURATION, SINCE = range(2)
#: Of a task: whether it has to come back, is on its way, and whether its offset of the last tick is known.
PENDING, RETURNING, KNOWN = range(3)
#: What an offset is made of, in bits: a shift, a turn, joints; whether it is that of a task of another making; and by
#: how many bits how many numbers it has are shifted.
MOVES, TURNS, JOINTS, ASKED, SIZE = 1, 2, 4, 8, 4

_length, _return_time, _fading = inline(steps.length), inline(steps.return_time), inline(steps.fading)
_minimum_jerk, _run_out = inline(steps.minimum_jerk), inline(steps.run_out)
USES = (steps, kinematics, clik, offsets)


@inline
def copy(source: Array, target: Array) -> None:
    """Copy a vector; a slice would make sure that they do not overlap."""
    for j in range(source.shape[0]):
        target[j] = source[j]


@inline
def largest(vector: Array) -> float:
    """The largest absolute value; NaN if there is one."""
    most = 0.0
    for j in range(vector.shape[0]):
        if most == most and not abs(vector[j]) <= most:
            most = abs(vector[j])
    return most


@inline
def _too_fast(of: Any) -> bool:
    """Whether a rate of an offset is above the peak speed of a return."""
    numbers, rate, kind = of
    if kind & JOINTS:
        return not largest(rate) <= numbers[JOINT_SPEED]
    linear, angular = _length(rate[0], rate[1], rate[2]), _length(rate[3], rate[4], rate[5])
    fast = kind & MOVES != 0 and not linear <= numbers[SPEED]
    return fast or (kind & TURNS != 0 and not angular <= numbers[ANGULAR_SPEED])


_way_on = inline(steps.ways_by(_too_fast))


@inline
def _duration(numbers: Array, kind: int, offset: Array) -> float:
    """Of the return from an offset [s]."""
    if kind & JOINTS:
        return _return_time(largest(offset) / numbers[JOINT_SPEED], numbers[SHORTEST])
    shift = _length(offset[0], offset[1], offset[2]) / numbers[SPEED]
    turn = _length(offset[3], offset[4], offset[5]) / numbers[ANGULAR_SPEED]
    return _return_time(max(shift, turn), numbers[SHORTEST])


@inline
def lead_back(
    numbers: Array, kind: int, active: bool, offset: Array, rate: Array, marks: Index, back: Array, start: Array,
    speed: Array, before: Array,
) -> bool:  # fmt: skip
    """One tick of a pending task: what its reference is displaced by, and how fast that changes; False if it is back.

    Args:
        numbers: Of the rules.
        kind: Of the offset, in bits.
        active: Whether the task is fully active; a released task is not pulled.
        offset: Where the task is now, off its reference (6,) or (n,); then what is left of it.
        rate: (6,) or (n,), filled in.
        marks, back: Of the task, see above; changed.
        start, speed, before: Offset and rate at the start of its return, offset at the last tick; changed.
    """
    for j in range(offset.shape[0]):
        rate[j] = (offset[j] - before[j]) / numbers[DT] if marks[KNOWN] == 1 else 0.0
        before[j] = offset[j]
    marks[KNOWN] = 1
    way = _way_on(marks[RETURNING] == 1, active, (numbers, rate, kind))
    if way == HOLD:  # held, not pulled: its motion runs out
        marks[RETURNING] = 0
        for j in range(rate.shape[0]):
            rate[j] = numbers[KEPT] * rate[j]
        return True
    if way == GO_ON:
        back[SINCE] += numbers[DT]
    else:  # x_d,r is where the task is now
        back[DURATION], back[SINCE] = _duration(numbers, kind, offset), 0.0
        marks[RETURNING] = 1
        copy(offset, start)
        copy(rate, speed)
    if back[SINCE] >= back[DURATION]:
        marks[RETURNING] = marks[PENDING] = 0
        return False
    share = back[SINCE] / back[DURATION]
    (s, ds), (r, dr) = _minimum_jerk(share), _run_out(share)
    a, b, c, d = _fading(s, ds, r, dr, back[DURATION])
    for j in range(offset.shape[0]):
        offset[j], rate[j] = a * start[j] + b * speed[j], c * start[j] + d * speed[j]
    return True


@inline
def _sum_of_squares(array: Array, share: float) -> float:
    total = 0.0
    for j in range(array.shape[0]):
        total += share * array[j] * (share * array[j])
    return total


_block, _whole = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.int64, 1, "C", readonly=True)
_outs, _outs3 = types.float64[:, ::1], types.float64[:, :, ::1]


@entry(
    types.int64(
        _block, _whole, types.Array(types.float64, 3, "C", readonly=True), _whole, _block, types.int64, types.float64,
        types.int64[:, ::1], _outs, _outs, _outs3, _outs, _outs3, _outs3,
    ),
    *USES,
)  # fmt: skip
def lead_references(
    memory: Array, bodies: Index, placements: Array, kinds: Index, numbers: Array, active: int, share: float,
    marks: Index, returns: Array, before: Array, goals: Array, twists: Array, drift: Array, poses: Array,
) -> int:  # fmt: skip
    """Displace the references of the pending ones of N tasks, offsets of w numbers at most.

    Args:
        memory: Of the commanded configuration, see `kinematics.forward`.
        bodies, placements: Of the tasks' frames (N,), (N, 4, 4); any for tasks of another making.
        kinds: Of their offsets, in bits, and how many numbers these have in the bits above (N,).
        numbers: Of the rules.
        active: Bits of the tasks that are fully active.
        share: How fast the trajectories' clock runs.
        marks: (N, 3).
        returns: Of each task duration, time, and offset and rate at its start (N, 2 + 2 w).
        before: Offsets at the last tick (N, w).
        goals, twists: References (N, 4, 4), (N, 6); displaced.
        drift: Offset and rate (N, 2, w), filled in; of a task of another making the offset stands there.
        poses: Of the frames (N, 4, 4), filled in.

    Returns:
        Bits of the tasks that have come back; -1 - k, and nothing done, if the reference of task k is not finite.
    """  # fmt: skip
    tasks, w = before.shape[0], before.shape[1]
    for k in range(tasks):
        if marks[k, PENDING] == 1 and kinds[k] & ASKED == 0:  # never into an offset, which remembers
            squares = _sum_of_squares(view(goals, 16 * k, (16,)), 1.0) + _sum_of_squares(twists[k], share)
            if not isfinite(squares):
                return -1 - k
    done = 0
    for k in range(tasks):
        for c in range(6):
            twists[k, c] = share * twists[k, c]
        if marks[k, PENDING] == 0:
            continue
        size, own = kinds[k] >> SIZE, returns[k]
        offset, rate = view(drift, 2 * w * k, (size,)), view(drift, 2 * w * k + w, (size,))
        if kinds[k] & ASKED == 0:
            frame_pose(view(memory, 16 * bodies[k], (4, 4)), placements[k], poses[k])
            offset_into(poses[k], goals[k], offset)
        start = view(returns, (2 + 2 * w) * k + 2, (size,))
        speed = view(returns, (2 + 2 * w) * k + 2 + w, (size,))
        if not lead_back(
            numbers, kinds[k], active >> k & 1 == 1, offset, rate, marks[k], own, start, speed, before[k]
        ):  # fmt: skip
            done |= 1 << k
        elif kinds[k] & ASKED == 0:
            displace_into(goals[k], twists[k], offset, rate, goals[k], twists[k])
    return done
