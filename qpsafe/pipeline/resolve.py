"""The second half of a tick: from references and q̇0 to the command.

    tasks --CLIK--> J, ẋ;   limits --> box;   J, ẋ, q̇0, activations, box --law--> q̇;   q̇ --box--> command

One compiled call, see `qpsafe.pipeline.resolve_kernel`. A task, limits or a law of another making takes the place of
its stage; the others stay the compiled ones.
"""

from __future__ import annotations

from itertools import accumulate, pairwise
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.hqp.own.regimes import MOST_LAYOUTS, MOST_SOFT, layout_for
from qpsafe.hqp.solution import SOLVED
from qpsafe.laws.hierarchical import weigh
from qpsafe.laws.kinds import NULLSPACE, OTHER, PAPER, STRICT, WEIGHTED, kind_of, numbers_of
from qpsafe.laws.problem import LawProblem, LawResult, TaskVelocity
from qpsafe.limits import JointLimits
from qpsafe.pipeline.checks import check_command, checked_box, checked_velocity
from qpsafe.pipeline.resolve_kernel import Parts, given, parts, resolve_tick, sizes_of
from qpsafe.pipeline.resolved import Resolved
from qpsafe.recovery.returning import Led
from qpsafe.sensing.detection import reals
from qpsafe.tasks.clik import is_plain
from qpsafe.tasks.task import PoseTask

if TYPE_CHECKING:
    from collections.abc import Sequence

    from qpsafe.hqp.level import Level
    from qpsafe.laws.problem import Law
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.tasks.clik import Clik
    from qpsafe.tasks.task import Task

Array = NDArray[np.float64]
_FLOAT = np.dtype(np.float64)


class Resolve:
    """Resolves ticks with one set of tasks and one law; whoever exchanges them makes another `Resolve`.

    Args:
        robot: The robot.
        tasks: Highest priority first.
        law: The law.
        dt: Tick [s].

    Attributes:
        most: Largest speeds of joints that are to stand in the next tick (n,) [rad/s], infinite for the others; None
            for none.
    """

    def __init__(self, robot: Robot, tasks: Sequence[Task], law: Law, dt: float) -> None:
        self.parts = tasks, law
        self.most: Array | None = None
        self._robot, self._dt = robot, dt
        #: Rows of each task that the compiled call fills in, None for the others.
        self._rows = [task.rows if isinstance(task, PoseTask) and task.plain else None for task in tasks]
        self._counts = tuple([0 if rows is None else len(rows) for rows in self._rows])
        self._others = [k for k, rows in enumerate(self._rows) if rows is None]
        self._kind = kind_of(law, len(tasks))
        *damping, importance = numbers_of(law, len(tasks)) if self._kind != OTHER else (0.0, 0.0, ())
        self._numbers = (*damping, np.array(importance))
        self._damping = self._numbers[:2] if self._kind == STRICT else _NO_LAW
        if self._kind in (PAPER, NULLSPACE, WEIGHTED):
            from qpsafe.pipeline.law_kernel import law_tick  # not compiled for the strict law

            self._law_tick = law_tick
        self._block = np.zeros(26 * len(tasks) + 2 + 2 * robot.nq)
        cut = given(self._block, robot.nq, len(tasks))
        self._gains, self._standing, self._goals, self._twists, self._weights, _, self._qd0, self._most = cut
        self._gains[:] = [task.gain for task in tasks]
        nowhere = (0, np.eye(4))
        mountings = [
            robot.mounting(task.frame) if isinstance(task, PoseTask) and rows is not None else nowhere
            for task, rows in zip(tasks, self._rows, strict=True)
        ]
        self._frames = np.array([b for b, _ in mountings], dtype=np.int64), np.array([place for _, place in mountings])
        self._weighed: tuple[Any, list[float]] = (), []  # the last activations, and what they weigh
        self._most[:] = np.inf
        self._held: Array | None = None  # the largest speeds that the block has
        self._stood = False  # whether rows of a task are marked in it as standing already
        self._layouts: dict[tuple[int, tuple[int, ...]], tuple[Any, ...]] = {}

    def __call__(
        self, state: RobotState, qd: Array, before: Array, samples: Sequence[Any], qd0: Array,
        activations: tuple[float, ...], limits: JointLimits | None, soft: tuple[Level, ...] = (),
    ) -> Resolved:  # fmt: skip
        """Resolve one tick.

        Args:
            state: Commanded configuration.
            qd: Commanded velocity (n,) [rad/s].
            before: The one a tick before (n,) [rad/s].
            samples: Reference of every task.
            qd0: Evasive velocity (n,) [rad/s].
            activations: Of the tasks.
            limits: Joint limits, or None.
            soft: Levels under the limits.

        Raises:
            ValueError, TypeError: What a part returned could not be sent to a robot.
        """  # fmt: skip
        begin = perf_counter()
        counts, asked = self._take(state, samples)
        ours = self._kind != OTHER and limits is not None
        count = 0
        if soft:
            ours = ours and len(soft) <= MOST_SOFT and all(level.weight is None for level in soft)
            if self._kind != NULLSPACE and len(soft) <= MOST_SOFT:  # projections know no inequalities
                count = sum(level.rows for level in soft)
        room = -(-count // _ROOM) * _ROOM
        made = self._layouts.get((room, counts))
        if made is None:
            if len(self._layouts) >= MOST_LAYOUTS:  # a task whose rows change for ever
                self._layouts.clear()
            made = self._layouts[(room, counts)] = self._laid_out(counts, room)
        rows, layout, sizes = made
        if count:
            layout.fill(soft)
        command, floats, integers = np.empty(len(qd)), np.zeros(sizes[0]), np.zeros(sizes[1], dtype=np.int64)
        plain = type(limits) is JointLimits and limits.max_jerk is None
        if asked or not plain:
            box = None if plain or limits is None else limits.box(state.q, qd, (qd - before) / self._dt)
            if limits is not None and type(limits) is not JointLimits:
                box = checked_box(box, limits, state.q, qd)
            self._fill(floats, asked, counts)
            if box is not None:
                cut = Parts(*parts(floats, integers, len(qd), len(rows), len(counts) + 1))
                cut.bounds[0], cut.bounds[1] = box.lower, box.upper
                cut.codes[0], cut.codes[1], cut.codes[2] = box.lower_kind, box.upper_kind, box.sacrificed
        table, return_speed = (limits.table, limits.return_speed) if plain else (_NO_LIMITS, 0.0)  # type: ignore[union-attr]
        self._qd0[:] = qd0
        if self.most is not self._held:
            self._most[:], self._held = np.inf if self.most is None else self.most, self.most
        if activations is not self._weighed[0] or type(activations) is not tuple:
            self._weighed = activations, weigh(activations, self._weights).tolist()
        weights = self._weighed[1]
        damping = self._damping if ours else _NO_LAW
        excess, worst = resolve_tick(
            state.q, qd, state.memory, self._robot.tree.supports, self._robot.ends, *self._frames, rows, self._block,
            table, self._dt, return_speed, *damping, *layout, floats, integers, command,
        )  # fmt: skip
        if ours and self._kind != STRICT:
            excess, worst = self._law_tick(
                self._kind, *self._numbers, np.array(activations), self._dt, self._block, *layout, floats, integers,
                command,
            )  # fmt: skip
        if excess < 0.0:
            raise ValueError(f"the law returned a velocity that is not finite or absurd: {command}")
        taken, how = perf_counter() - begin, (self._kind, self._numbers[2], activations)
        frozen = (floats, integers, qd0, weights, counts, taken, how, limits is not None, soft)
        if ours:
            if not plain:  # whatever limits of another making do to it
                check_command(command, self._dt)
            return Resolved(command, excess, worst == 0.0, frozen=frozen)
        return self._by_law(Resolved(command, 0.0, False, frozen=frozen), state, activations, soft)

    def _take(self, state: RobotState, samples: Sequence[Any]) -> tuple[tuple[int, ...], dict[int, Clik]]:
        """Take the references of tasks on poses, ask the other tasks; rows of each, and the others' answers."""
        asked: dict[int, Clik] = {}
        left: Sequence[int] = range(len(self._rows))
        if self._stood:
            self._standing[:], self._stood = 0.0, False
        if type(samples) is Led:  # what is led on a pose at once
            self._goals[:], self._twists[:] = samples.goals, samples.twists
            left = sorted({*samples.asked, *self._others}) if samples.asked else self._others
            if not left:
                return self._counts, asked
        counts = list(self._counts)
        for k in left:
            task, sample = self.parts[0][k], samples[k]
            if self._rows[k] is not None:
                pose, twist = sample.pose, sample.twist
                if is_plain(pose, twist):
                    self._goals[k], self._twists[k] = pose, twist
                    continue
            self._standing[k], self._stood = 1.0, True
            asked[k] = task.clik(state, sample)
            counts[k] = len(asked[k].velocity)
        return tuple(counts), asked

    def _laid_out(self, counts: tuple[int, ...], room: int) -> tuple[Any, ...]:
        """For tasks of these numbers of rows: which rows of a pose each is, memory of the solver, sizes of results."""
        kinds = [rows if rows is not None else (0,) * count for rows, count in zip(self._rows, counts, strict=True)]
        rows = np.array([row for kind in kinds for row in kind], dtype=np.int64)
        n = self._robot.nq
        layout = layout_for(n, counts, self._kind == WEIGHTED, room)
        return rows, layout, sizes_of(n, len(rows), len(counts) + 1, room)

    def _fill(self, floats: Array, asked: dict[int, Clik], counts: tuple[int, ...]) -> None:
        """Write down what tasks of another making answered, where `Parts` has A, b and e."""
        n, ends = self._robot.nq, [0, *accumulate(counts)]
        b, e = ends[-1] * n, ends[-1] * (n + 1)
        for k, clik in asked.items():
            first, stop = ends[k], ends[k + 1]
            self._put(floats[first * n : stop * n].reshape(-1, n), clik.jacobian, "Jacobian", k)
            self._put(floats[b + first : b + stop], clik.velocity, "velocity", k)
            self._put(floats[e + first : e + stop], clik.error, "error", k)

    @staticmethod
    def _put(place: Array, value: Any, what: str, k: int) -> None:
        """Write down what task k answered, if it is an array of real numbers of this shape."""
        if not (type(value) is np.ndarray and value.dtype == _FLOAT and value.shape == place.shape):
            value = reals(f"the {what} of task {k + 1}", value, place.shape)
        place[...] = value

    def _by_law(
        self, made: Resolved, state: RobotState, activations: tuple[float, ...], soft: tuple[Level, ...]
    ) -> Resolved:
        """Ask a law of another making, or for what the compiled call does not know."""
        cut, (_, _, qd0, _, counts, *_, limited, _) = made._parts, made._frozen  # type: ignore[misc]
        pairs = list(pairwise([0, *accumulate(counts)]))
        wishes = tuple([TaskVelocity(cut.A[a:b].copy(), cut.b[a:b].copy()) for a, b in pairs])
        corrections = tuple([task.gain * cut.e[a:b] for task, (a, b) in zip(self.parts[0], pairs, strict=True)])
        lower, upper = cut.bounds.copy() if limited else (None, None)
        result = self.parts[1].solve(LawProblem(wishes, qd0.copy(), activations, lower, upper, soft, corrections))
        answer = checked_velocity(result, state.q, self._dt)
        command, excess = made.box.admit(answer) if made.box else (answer.copy(), 0.0)
        check_command(command, self._dt)
        if type(result) is LawResult:  # the law's own array may be its memory of the next tick
            result = LawResult(answer.copy(), result.status, result.regimes)
        return Resolved(command, excess, result.status == SOLVED, result=result, frozen=made._frozen)


_NO_LIMITS = np.empty((0, 0))
_NO_LAW = np.nan, np.nan  # in the same compiled call
_ROOM = 16  # memory is made for soft rows by so many
