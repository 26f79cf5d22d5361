"""The parts of a `SafetyController` as blocks for compiled code, or why they cannot be."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.batch import blocks, code, cuts
from qpsafe.batch.blocks import Own, Shared
from qpsafe.batch.cuts import lay_out
from qpsafe.batch.knots import Path, Refused, path_of
from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.field import DangerField
from qpsafe.geometry.clearance_work import MOST, sizes_of
from qpsafe.hqp.own.state import workspace
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.kinds import OTHER, WEIGHTED, kind_of, numbers_of
from qpsafe.limits import JointLimits
from qpsafe.pipeline.sense import Sense
from qpsafe.recovery.returning import return_numbers
from qpsafe.recovery.returns import RecoveryRules
from qpsafe.recovery.stall import BEHIND
from qpsafe.tasks.joint import JointTask
from qpsafe.tasks.task import PoseTask, Task
from qpsafe.tasks.trajectory import FixedJoints

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: How far a trajectory is looked at that tells no end, where nothing else is said [s].
HORIZON = 60.0


class Packed(NamedTuple):
    """What all robots of a batch share.

    Attributes:
        blocks: The four blocks that `tick_kernel.tick` takes first.
        shared: Them, cut.
        own: Places of each robot's arrays in its blocks: `Own` of arrays of numbers.
        sizes: Floats, and integers, of one robot.
        home: Where the robot stands before anything was measured (n,) [rad].
        events: Names of the events of each trajectory.
    """

    blocks: tuple[Array, Index, Array, Index]
    shared: Shared
    own: Own
    sizes: tuple[int, int]
    home: Array
    events: tuple[tuple[str, ...], ...]


class State(NamedTuple):
    """What robots remember, a row each: floats, integers, and which spots are dead or tell odd units (2, k)."""

    floats: Array
    integers: Index
    spots: NDArray[np.bool_]


def why_not(controller: SafetyController) -> str:
    """Which part of a controller is not plain, so that its tick cannot be compiled; empty if all are."""
    law, limits, activation, rules = (
        controller.law,
        controller.limits,
        controller.activation,
        controller.recovery_rules,
    )
    kind, solver = kind_of(law, len(controller.tasks)), getattr(law, "solver", None)
    reasons = {
        "the controller is of another making": not _plain(controller),
        "the law has another solver than the own one": kind == OTHER and solver not in (None, "own"),
        "the law is of another making": kind == OTHER,
        "the field is of another making": type(controller.field) is not DangerField,
        "the evasion is of another making": type(controller.evasion) is not Evasion,
        "there are no limits": limits == "off",
        "the limits are of another making": limits != "off" and type(limits) is not JointLimits,
        "the limits have a largest jerk": type(limits) is JointLimits and limits.max_jerk is not None,
        "there is a barrier": controller.barrier is not None,
        "there is a separation limit": controller.separation is not None,
        "the activation is of another making": type(activation) is not Activation
        or any(type(threshold) is not Threshold for threshold in activation.thresholds),
        "the recovery rules are of another making": type(rules) is not RecoveryRules,
    }
    for reason, holds in reasons.items():
        if holds:
            return reason
    for task, label in zip(controller.tasks, controller._labels, strict=True):
        if not (isinstance(task, PoseTask) and task.plain and type(task).offset is Task.offset):
            return f"the task {label} is not one on the rows of a frame's pose"
    return ""


def _plain(controller: SafetyController) -> bool:
    from qpsafe.controller import SafetyController

    return type(controller) is SafetyController and "step" not in vars(controller)


def pack(controller: SafetyController, horizon: float = HORIZON) -> Packed:
    """The blocks of a controller whose parts are plain.

    Args:
        controller: Its parts are read; it is not changed.
        horizon: How far a trajectory is looked at that tells no end [s].

    Raises:
        Refused: Why they cannot be made, in words.
    """
    reason = why_not(controller)
    if reason:
        raise Refused(reason)
    robot, tasks, n = controller.robot, controller.tasks, controller.robot.nq
    trajectories = list({id(task.trajectory): task.trajectory for task in tasks}.values())
    paths = []
    for trajectory in trajectories:
        try:
            paths.append(path_of(trajectory, controller.dt, horizon))
        except Refused as error:
            raise Refused(f"the trajectory {trajectory!r}: {error}") from None
    floats, whole, gate = _numbers(controller, paths), _whole(controller, paths, trajectories), controller.verifies
    floats["gate"], whole["gate_whole"] = gate.blocks if gate else (np.zeros(0), np.zeros(0, dtype=np.int64))
    counts = [len(task.rows) for task in tasks]  # type: ignore[attr-defined]
    rows = sum(counts)
    spots = 0 if controller.spots is None else len(controller.spots)
    clearance = controller.clearance
    solids = (np.zeros(0), np.zeros(0, dtype=np.int64)) if isinstance(clearance, str) else clearance.blocks
    soft, kept = (0, (0, 0)) if isinstance(clearance, str) else (MOST, sizes_of(*clearance.size))
    solver = [len(block) for block in workspace(n, max(rows, n) + n + soft, max(rows + n, soft))]
    sizes = np.array(
        (n, len(tasks), len(paths), spots, rows, len(controller.activation.levels), sum(len(p.times) for p in paths),
         sum(len(p.events) for p in paths), robot.memory, len(robot.wire_frames), *solver, *map(len, solids), *kept,
         soft, len(floats["gate"]), len(whole["gate_whole"]), *(gate.sizes if gate else (0, 0, 0))), dtype=np.int64,
    )  # fmt: skip
    floats["solids"], whole["solids_whole"] = solids
    at, length, _ = lay_out(cuts.shared, sizes)
    at_own, *own_sizes = lay_out(cuts.own, sizes)
    head = np.concatenate((sizes, at, at_own))
    at[[k for k, name in enumerate(Shared._fields) if name in whole]] += len(head)
    head[len(sizes) : len(sizes) + len(at)] = at
    block = np.concatenate([np.ravel(floats[name]) for name in Shared._fields if name in floats]).astype(float)
    assert len(block) == length
    integers = np.concatenate([head, *[np.ravel(whole[name]) for name in Shared._fields if name in whole]])
    integers = integers.astype(np.int64)
    for part in (block, integers):
        part.flags.writeable = False
    places = cuts.own(np.arange(own_sizes[0]), np.arange(own_sizes[1]), at_own, sizes)
    sense = Sense(robot, controller.sensing, controller.field, controller.evasion)
    names = tuple(tuple(name for _, name in path.events) for path in paths)
    return Packed(
        (block, integers, *sense.blocks), cuts.shared(block, integers, at, sizes), places,
        (own_sizes[0], own_sizes[1]), np.array(robot.home), names,
    )  # fmt: skip


def _numbers(controller: SafetyController, paths: list[Path]) -> dict[str, Any]:
    """The floats, by the names in `Shared`."""
    robot, rules, law, limits, dt = (
        controller.robot, controller.recovery_rules, controller.law, controller.limits, controller.dt,
    )  # fmt: skip
    assert isinstance(limits, JointLimits)
    damping, damping_time, importance = numbers_of(law, len(controller.tasks))
    way = HierarchicalLaw()
    spots = controller.spots
    farthest = controller._units.farthest if spots is not None else np.zeros(0)
    return {
        "numbers": (
            *return_numbers(rules, dt), controller.activation.suspend_above, dt / rules.ramp, rules.tolerance,
            BEHIND * rules.tolerance,
            controller.rules.speed_cap, damping, damping_time, way.damping, way.damping_time,
            JointTask(FixedJoints(robot.home)).gain, limits.return_speed,
            rules.calm * controller.activation.suspend_above, rules.dwell,
        ),
        "levels": [(level.start, level.end, level.delta, level.epsilon) for level in controller.activation.levels],
        "placements": [robot.mounting(task.frame)[1] for task in controller.tasks],  # type: ignore[attr-defined]
        "gains": [task.gain for task in controller.tasks],
        "limits": limits.table,
        "gentle": limits.gentler(rules.acceleration).table,
        "farthest": farthest,
        "periods": [path.period for path in paths],
        "times": np.concatenate([path.times for path in paths]),
        "knots": np.concatenate([path.knots for path in paths]),
        "event_times": [time for path in paths for time, _ in path.events],
        "importance": importance,
    }  # fmt: skip


def _whole(controller: SafetyController, paths: list[Path], trajectories: list[Any]) -> dict[str, Any]:
    """The integers, by the names in `Shared`."""
    robot, rules, tasks, n = controller.robot, controller.recovery_rules, controller.tasks, controller.robot.nq
    stall, sensing = controller._stall, controller.sensing
    counts = [len(task.rows) for task in tasks]  # type: ignore[attr-defined]
    places = {id(trajectory): k for k, trajectory in enumerate(trajectories)}
    kind = kind_of(controller.law, len(tasks))
    return {
        "whole": (
            rules.enabled, stall.patience, stall.every, controller._units.every,
            0 if sensing is None else sensing.health.most,
            sum(counts) + n if kind == WEIGHTED else max(n, *counts), n, kind, rules.held,
        ),
        "counts": controller.activation.counts,
        "bodies": [robot.mounting(task.frame)[0] for task in tasks],  # type: ignore[attr-defined]
        "rows": [row for task in tasks for row in task.rows],  # type: ignore[attr-defined]
        "ends": np.cumsum(counts),
        "essential": [task.essential for task in tasks],
        "paths": [places[id(task.trajectory)] for task in tasks],
        "kinds": [path.kind for path in paths],
        "first_knot": np.cumsum([0, *[len(path.times) for path in paths]]),
        "first_event": np.cumsum([0, *[len(path.events) for path in paths]]),
        "endless": robot.endless,
        "nowhere": [*[0] * (n + 1), n],
    }  # fmt: skip


def new_state(packed: Packed, n: int) -> State:
    """Memory of n robots that have measured nothing yet."""
    sizes = packed.blocks[1]
    state = State(
        np.zeros((n, packed.sizes[0])), np.zeros((n, packed.sizes[1]), dtype=np.int64),
        np.zeros((n, 2, sizes[code.SPOTS]), dtype=np.bool_),
    )  # fmt: skip
    reset(packed, state, np.arange(n))
    return state


def own_of(packed: Packed, floats: Array, integers: Index) -> Own:
    """Arrays of one robot, in its blocks.

    Args:
        packed: What it shares with the others.
        floats: Its row of `State.floats`.
        integers: Its row of `State.integers`.
    """
    head = packed.blocks[1]
    return cuts.own(floats, integers, head[code.HEADS + blocks.SHARED :][: blocks.OWN], head)


def reset(packed: Packed, state: State, which: Index) -> None:
    """Start robots anew, see `SafetyController.reset`.

    Args:
        packed: What they share.
        state: What they remember.
        which: Their numbers.
    """
    own = packed.own
    state.floats[which], state.integers[which], state.spots[which] = 0.0, 0, False
    put(state.floats, which, own.q, packed.home)
    put(state.floats, which, own.clock[code.RATE], 1.0)
    put(state.floats, which, own.held[:, 0], np.inf)
    put(state.floats, which, own.seen[:, (0, 4)], np.nan)
    put(state.floats, which, own.track[:, 0], np.nan)
    put(state.floats, which, own.gate_known, np.nan)
    put(state.integers, which, own.marks[code.SEQ], -1)


def put(block: Any, which: Any, places: Any, values: Any) -> None:
    """Set the same values at places of some rows.

    Args:
        block: (n, size).
        which: Rows.
        places: As `Packed.own` has them.
        values: One, or one a place.
    """
    block[np.ix_(which, np.ravel(places))] = np.ravel(values)


def new_work(packed: Packed, points: int = 0) -> tuple[Array, Index]:
    """Blocks for one thread to work in, with room for so many points (or all spots)."""
    sizes = packed.blocks[1]
    room = max(points, int(sizes[code.SPOTS]))
    at, length, whole = lay_out(cuts.work, sizes, room)
    head = 1 + len(at)
    floats, integers = np.zeros(length), np.zeros(head + whole, dtype=np.int64)
    at[[k for k, name in enumerate(blocks.Work._fields) if name in blocks.WHOLE_WORK]] += head
    integers[0], integers[1:head] = room, at
    cuts.work(floats, integers, at, sizes, room).way_placement[:] = np.eye(4)
    return floats, integers
