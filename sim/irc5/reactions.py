"""Reactions to faults of the robot and its wire, and how they are seen in a run.

Ticks count from 1, the first turn with the fault. A reaction's tick is None if it did not come.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from qpsafe.sim.irc5.bench import Turn

HELD = 1e-9  # rad; an answer as near to the measured pose as that is the measured pose
RAMP = 125  # ticks of ramping in

#: From the turns with the fault, and the one before them: the tick of the reaction.
Seen = Callable[[Sequence[Turn], Turn], int | None]


def goes_on(turns: Sequence[Turn], before: Turn) -> int | None:
    """Running throughout, and every packet that arrived was answered once, with a position for every speed."""
    return 1 if all(turn.state == "running" and turn.answers <= 1 for turn in turns) else None


def counted(*names: str) -> Seen:
    """What came was refused under one of these names from the first tick on, and nothing else changed."""

    def seen(turns: Sequence[Turn], before: Turn) -> int | None:
        if goes_on(turns, before) is None or not all(turn.answers == 1 for turn in turns):
            return None
        old = sum(before.counts.get(name, 0) for name in names)
        return first(turns, lambda turn: sum(turn.counts.get(name, 0) for name in names) > old)

    return seen


def refused(*names: str) -> Seen:
    """The same, while no packet of the robot can be used: no answer to them, and a stop for its silence at most."""

    def seen(turns: Sequence[Turn], before: Turn) -> int | None:
        old = sum(before.counts.get(name, 0) for name in names)
        return first(turns, lambda turn: sum(turn.counts.get(name, 0) for name in names) > old and turn.answers == 0)

    return seen


def first(turns: Sequence[Turn], holds: Callable[[Turn], bool]) -> int | None:
    """Tick of the first turn for which it holds."""
    return next((k + 1 for k, turn in enumerate(turns) if holds(turn)), None)


def held(turns: Sequence[Turn], before: Turn) -> int | None:
    """Its own pose at speed 0 from some tick on, for as long as it is not ready; then ramped in until it runs again."""
    closed = [k for k, turn in enumerate(turns) if not turn.ready and turn.q_ref is not None]
    good = [k for k in closed if _is_held(turns[k])]
    if not good or good != closed[len(closed) - len(good) :] or turns[-1].state != "running":
        return None
    opened = closed[-1] + 1
    ramp = first(turns[opened:], lambda turn: turn.state == "running")
    return None if ramp is None or ramp > RAMP + 3 else good[0] + 1


def _is_held(turn: Turn) -> bool:
    assert turn.q_ref is not None
    assert turn.qd_ref is not None
    return bool(np.abs(turn.q_ref - turn.q).max() <= HELD and (turn.qd_ref == 0.0).all())


def reseeded(turns: Sequence[Turn], before: Turn) -> int | None:
    """Seeded from the measured pose, and running again within the ramp; ticks from the first packet of the new run."""
    spoke = first(turns, lambda turn: turn.seeded)
    if spoke is None or turns[-1].state != "running":
        return None
    runs = first(turns[spoke:], lambda turn: turn.state == "running")
    return None if runs is None or runs > RAMP + 10 else 1


def reseeded_or_stopped(turns: Sequence[Turn], before: Turn) -> int | None:
    """The same; or it was seen before that the robot does not follow, and the stream has stopped for good."""
    missed = any("from what it was sent" in cause for cause in turns[-1].causes)
    return 1 if turns[-1].state == "stopped" and missed else reseeded(turns, before)


def left(turns: Sequence[Turn], before: Turn) -> int | None:
    """Silent from some tick on, and at rest before: never silent at speed."""
    silent = first(turns, lambda turn: turn.answers == 0)
    if silent is None or silent < 2 or any(turn.answers for turn in turns[silent - 1 :]):
        return None
    last = turns[silent - 2].qd_ref
    return silent if last is not None and (last == 0.0).all() else None


def stopped(why: str) -> Seen:
    """Stopped for good, for that cause."""

    def seen(turns: Sequence[Turn], before: Turn) -> int | None:
        if turns[-1].state != "stopped" or not any(why in cause for cause in turns[-1].causes):
            return None
        return first(turns, lambda turn: turn.state in ("stopping", "stopped"))

    return seen
