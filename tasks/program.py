"""A program: moves one after the other, with events in between, as one trajectory."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.tasks.moves import Move
from qpsafe.tasks.trajectory import Sample
from qpsafe.text.given import number, parts, whole
from qpsafe.text.words import counted


class Event(NamedTuple):
    """Something to do at a point of a path, such as to grip: when the path's clock passes it, once."""

    time: float
    name: str


class Program(Fixed):
    """A sequence of moves. It keeps no clock: the same time gives the same reference, so it can be paused anywhere.

    Args:
        moves: At least one; each begins where the one before it ends.
        events: Pairs of the number of the move before which it happens, and its name.
        cycle: Whether to begin again at the end, forever.
        frame: Frame of the robot that follows it; empty where the program does not say.

    Raises:
        ConfigurationError: No moves, a gap between two of them, an event at no move, a cycle that is not closed.
    """

    fixed = frozenset(("moves", "cycle", "frame", "duration", "events"))

    def __init__(
        self, moves: Sequence[Move], events: Sequence[tuple[int, str]] = (), cycle: bool = False, frame: str = ""
    ) -> None:
        self.moves = parts("Program", "moves", moves, "a list of moves")
        if not self.moves:
            raise ConfigurationError("Program", "moves", moves, "at least one move")
        for k, move in enumerate(self.moves):
            if not _is_move(move):
                raise ConfigurationError(
                    "Program", f"moves[{k}]", move, "a move of a pose that takes time, e.g. a Line"
                )
        if not isinstance(cycle, bool | np.bool_):
            raise ConfigurationError("Program", "cycle", cycle, "True or False")
        if not isinstance(frame, str):
            raise ConfigurationError("Program", "frame", frame, 'the name of a frame, or ""')
        self.cycle, self.frame = bool(cycle), frame
        followers = [*self.moves[1:], *self.moves[:1]] if cycle else self.moves[1:]
        for k, (move, after) in enumerate(zip(self.moves, followers, strict=False)):
            gap = np.abs(after.sample(0.0).pose - move.sample(move.duration).pose).max()
            if not gap <= 1e-6:
                follower = (k + 1) % len(self.moves)
                expected = f"to begin where moves[{k}] ends (found a gap of {gap:.3g})"
                raise ConfigurationError("Program", f"moves[{follower}]", after, expected)
        self._ends = list(accumulate(move.duration for move in self.moves))
        self.duration = self._ends[-1]
        if cycle and not self.duration > 0.0:
            raise ConfigurationError("Program", "cycle", cycle, "moves that take some time")
        starts = [0.0, *self._ends]
        found = []
        for k, pair in enumerate(parts("Program", "events", events, "pairs of a number of a move and a name")):
            key = f"events[{k}]"
            both = parts("Program", key, pair, "a pair of a number of a move and a name")
            if len(both) != 2:
                raise ConfigurationError("Program", key, pair, "a pair of a number of a move and a name")
            place = whole("Program", key, both[0], f"0 to {len(self.moves)}", 0, len(self.moves))
            if not (isinstance(both[1], str) and both[1]):
                raise ConfigurationError("Program", key, both[1], "a name")
            found.append(Event(starts[place], both[1]))
        #: Events of one cycle, in their order.
        self.events = tuple(sorted(found, key=lambda event: event.time))
        self._last: tuple[float, Sample] | None = None  # several tasks ask for the same time

    def __repr__(self) -> str:
        moves, events = counted(len(self.moves), "move"), counted(len(self.events), "event")
        return f"Program({self.frame!r}, {moves}, {events}, duration={self.duration:.4g}, cycle={self.cycle})"

    def sample(self, t: float) -> Sample:
        """Reference at time t [s]; at rest at the last goal after the end, unless it is a cycle."""
        last = self._last  # another thread may put another one there
        if last is not None and last[0] == t:
            return last[1]
        here = t % self.duration if self.cycle else t
        k = min(bisect_right(self._ends, here), len(self.moves) - 1)
        sample = self.moves[k].sample(here - (self._ends[k - 1] if k else 0.0))
        self._last = (t, sample)
        return sample

    def move_at(self, t: float) -> int:
        """Number of the move at time t [s]."""
        return min(bisect_right(self._ends, t % self.duration if self.cycle else t), len(self.moves) - 1)

    def event(self, k: int) -> Event | None:
        """The k-th event from 0 on, cycles counted through; None if there is none."""
        if not self.events or (k >= len(self.events) and not self.cycle):
            return None
        round_, place = divmod(k, len(self.events))
        event = self.events[place]
        return Event(event.time + round_ * self.duration, event.name)


def _is_move(move: Any) -> bool:
    """Whether something has a finite duration and poses at both ends of it."""
    try:
        duration = number("Program", "duration", move.duration, "a finite time >= 0 [s]", 0.0)
        return all(np.shape(move.sample(t).pose) == (4, 4) for t in (0.0, duration))
    except (AttributeError, TypeError, ConfigurationError):
        return False
