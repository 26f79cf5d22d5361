"""What is to be done in a tick, explained when it is looked at, and what of it was unusual."""

from __future__ import annotations

from functools import cached_property
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.laws.explained import Solved, explain
from qpsafe.laws.problem import LawResult
from qpsafe.limits import JERK, Box, JointLimits
from qpsafe.pipeline.resolve_kernel import Parts, parts

if TYPE_CHECKING:
    from qpsafe.hqp.level import Level

Array = NDArray[np.float64]


class Resolved:
    """What is to be done in a tick; explained, from numbers that stay, when it is looked at.

    Args:
        command: Joint velocity (n,) [rad/s], inside the box.
        excess: By how much the law's answer was outside; NaN if a limit gave way.
        solved: Whether the law answered as planned.
        box: Admissible velocities, if they are known already.
        result: The law's answer, likewise.
        frozen: Else they are made from the results of `resolve_tick`, the evasive velocity, the regimes' weights, the
            rows of each task, the time it took [s], kind, weights and activations of the law for `explain`, whether
            there are limits, and the soft levels.
    """

    def __init__(
        self, command: Array, excess: float, solved: bool, box: Box | None = None, result: LawResult | None = None,
        frozen: tuple[Any, ...] | None = None,
    ) -> None:  # fmt: skip
        self.command, self.excess, self.solved = command, excess, solved
        self._box, self._result, self._frozen = box, result, frozen

    def fine(self, limits: JointLimits | None) -> bool:
        """Whether nothing was unusual, whatever of the command is sent within `limits`."""
        return self.excess <= 1e-9 and self.solved and (limits is None or limits.max_jerk is None)

    @cached_property
    def _parts(self) -> Parts:
        assert self._frozen is not None
        floats, integers, _, weights, counts, *_ = self._frozen
        return Parts(*parts(floats, integers, len(self.command), sum(counts), len(weights)))

    @cached_property
    def box(self) -> Box | None:
        """Admissible velocities; None without limits."""
        if self._frozen is None or not self._frozen[-2]:
            return self._box
        return Box(*self._parts.bounds, *self._parts.codes)

    @cached_property
    def result(self) -> LawResult | None:
        """The law's answer; None if it was not asked."""
        if self._result is not None or self._frozen is None:
            return self._result
        cut, (_, _, qd0, weights, counts, taken, how, _, soft) = self._parts, self._frozen
        solved = Solved(
            cut.A, cut.b, qd0, cut.bounds[0], cut.bounds[1], cut.blend, cut.x, cut.info, weights, counts, taken, soft
        )  # fmt: skip
        return explain(solved, self.solved, *how)

    @property
    def soft(self) -> tuple[Level, ...]:
        """Levels under the joint limits, before the first task."""
        return () if self._frozen is None else self._frozen[-1]

    @cached_property
    def errors(self) -> tuple[Array, ...]:
        """Of the tasks against their references of this tick, (rows,) each."""
        if self._frozen is None:
            return ()
        return tuple([self._parts.e[first:last] for first, last in pairwise([0, *accumulate(self._frozen[4])])])


def judged(resolved: Resolved, names: tuple[str, ...], command: Array) -> tuple[str, ...]:
    """What was unusual, in words: limits that gave way, a law that exceeded them, a solver that did not finish.

    Args:
        resolved: What was to be done.
        names: Of the joints.
        command: What is sent (n,) [rad/s].
    """
    box, messages = resolved.box, tuple[str, ...]()
    if box is not None and not resolved.excess <= 1e-9:
        assert resolved.result is not None
        messages = box.notes(names)
        lists = resolved.result.qd.tolist(), box.lower.tolist(), box.upper.tolist()
        beyond = [name for name, v, lo, hi in zip(names, *lists, strict=True) if lo - v > 1e-9 or v - hi > 1e-9]
        if beyond:
            messages = (*messages, "the law exceeded the limits, clipped: " + ", ".join(beyond))
    if box is not None:
        messages = tuple(dict.fromkeys((*messages, *given_way(box, names, command))))
    if not resolved.solved:
        assert resolved.result is not None
        messages = (*messages, f"law: {resolved.result.status}")
    return messages


def given_way(box: Box, names: tuple[str, ...], command: Array) -> tuple[str, ...]:
    """Jerk limits that what is sent (n,) [rad/s] leaves, in words and in the box: braking, all others bind.

    Args:
        box: Of the tick.
        names: Of the joints.
        command: Inside all limits but those (n,) [rad/s].
    """
    beyond = (command < box.lower - 1e-9) | (command > box.upper + 1e-9)
    if not beyond.any():
        return ()
    box.sacrificed[beyond & (box.sacrificed == 0)] = JERK
    return box.notes(names)
