"""The blocks that a compiled tick works on, by the arrays they are made of.

What all robots of a batch share stands in two blocks, of floats and of integers, the latter beginning with the sizes
that `code` names. What one robot remembers, and what its last tick came to, stands in three: floats, integers, and
which spots are dead or tell odd units. What a tick works in stands in two more, one pair a thread. `cuts` cuts them.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Shared(NamedTuple):
    """What all robots share: joints n, tasks N, trajectories T, rows R, levels L, spots k, knots K, events E."""

    numbers: Any
    levels: Any  # start, end, Δ, ε of each (L, 4)
    placements: Any  # of the tasks' frames (N, 4, 4)
    gains: Any
    limits: Any  # lower, upper, velocity, acceleration (4, n)
    gentle: Any  # likewise, of the way back
    farthest: Any  # reading of each spot that may be metres (k,)
    periods: Any  # of the trajectories (T,)
    times: Any  # of the knots (K,)
    knots: Any  # (K, KNOT)
    event_times: Any
    whole: Any
    counts: Any  # tasks that each level switches (L,)
    bodies: Any  # of the tasks' frames
    rows: Any  # of all tasks (R,)
    ends: Any  # after the last row of each task
    essential: Any
    paths: Any  # trajectory of each task
    kinds: Any  # of the trajectories
    first_knot: Any  # (T + 1,)
    first_event: Any  # (T + 1,)
    endless: Any  # joints that turn without end
    nowhere: Any  # rows and body of the way back through the joints (n + 2,): zeros, then n
    importance: Any  # weights of a weighted law, w_1, ..., w_N, w_E (N + 1,)
    solids: Any  # what the robot keeps clear of, see `ClearanceLimit.blocks`; empty for nothing
    solids_whole: Any
    gate: Any  # its tables, none where it is off
    gate_whole: Any


class Own(NamedTuple):
    """What one robot remembers, and what its last tick came to."""

    q: Any
    qd: Any
    before: Any  # q̇ a tick ago
    evasive: Any  # q̇0 that the admittance goes on from
    clock: Any
    returns: Any  # of the tasks (N, 2)
    offsets: Any  # of each at the start of its return (N, 6), its rate then, and at the last tick (3, N, 6)
    way: Any  # return through the joints (2,)
    way_offsets: Any  # likewise (3, n)
    posture: Any  # where it leads (n,)
    amounts: Any  # of the stall watch (3, N)
    met: Any  # where all tasks were last met (n,)
    values: Any  # poses of the frames at the last look (N, 4, 4), and their offsets (N, 6)
    compared: Any
    seen: Any  # of the sensors, see `DistanceSensing.memory`
    held: Any
    track: Any
    result: Any  # CDF_n, m, f
    activations: Any
    qd0: Any
    errors: Any  # of all tasks (R,)
    marks: Any
    tasks: Any  # (N, 3)
    way_marks: Any  # (3,)
    stall: Any  # (5,)
    cursors: Any  # next event of each trajectory (T,)
    happened: Any  # first event of this tick, and how many (T, 2)
    counts: Any  # of the sensors
    age: Any
    far: Any  # looks at readings too large for metres (k,)
    gate_known: Any  # distances of solids that the gate measured
    gated: Any  # what it let through, see `gate_kernel` (5,)


class Work(NamedTuple):
    """What a tick works in; nothing in it stays."""

    sensing: Any
    points: Any
    danger: Any
    vectors: Any
    memory: Any
    given: Any
    way_given: Any
    solver: Any
    matrix: Any
    target: Any
    floats: Any
    way_floats: Any
    poses: Any
    goals: Any
    twists: Any
    offsets: Any
    bounds: Any
    command: Any
    switches: Any
    clock: Any
    returns: Any
    back: Any
    way: Any
    way_back: Any
    shift: Any
    drift: Any
    none: Any
    way_placement: Any
    links: Any
    solver_whole: Any
    last: Any
    integers: Any
    way_integers: Any
    codes: Any
    tasks: Any
    way_marks: Any
    clearance: Any  # see `qpsafe.geometry.clearance_kernel.Rows`
    near: Any
    clearance_whole: Any
    soft: Any
    gate: Any
    gate_whole: Any


#: Those of `Work` that are integers.
WHOLE_WORK = (
    "links", "solver_whole", "last", "integers", "way_integers", "codes", "tasks", "way_marks", "clearance_whole",
    "soft", "gate_whole",
)  # fmt: skip
#: How many arrays these are.
SHARED, OWN, WORK = len(Shared._fields), len(Own._fields), len(Work._fields)
