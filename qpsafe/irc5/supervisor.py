"""One state machine over the stream of references: it only escalates until a person acknowledges.

The states stand in their order of severity. Every event but the two acknowledgements leads to the same state or to a
later one; what is not in `TRANSITIONS` changes nothing. docs/reference/supervisor.md has this table, and a test
compares both.

This is no safety function: it runs on an ordinary computer, in Python. It orders what the software itself does.
"""

from __future__ import annotations

import math
import re
import time
from collections import deque
from collections.abc import Callable
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple

from qpsafe.errors import in_words, represented
from qpsafe.text.given import to_call, whole


class State(StrEnum):
    """States, in order of severity."""

    IDLE = "idle"  # nothing is sent that could move the robot
    SEEDING = "seeding"  # from the measured pose, references are ramped in
    RUNNING = "running"  # references drive the robot
    DEGRADED = "degraded"  # they still do, and something must be seen to
    STOPPING = "stopping"  # references bring the robot to rest
    STOPPED = "stopped"  # it stands, or nothing more is sent

    @property
    def severity(self) -> int:
        """Place in the order, from 0."""
        return _ORDER[self]


_ORDER = {state: k for k, state in enumerate(State)}


class StopCategory(IntEnum):
    """Stop categories after IEC 60204-1, as far as a program can serve them; 0 is the gravest.

    Drive power is not in this program's hands: only the robot controller, and the safety circuit, can remove it.
    """

    #: Category 0: power is to be removed at once. All a program can do is fall silent, so that the robot stops by its
    #: own time limit; for when what it would send cannot be trusted.
    IMMEDIATE = 0
    #: Category 1: brake under control, then fall silent: the robot's program ends the motion and may switch off.
    CONTROLLED_THEN_SILENT = 1
    #: Category 2: brake under control, then hold under power, and go on sending.
    CONTROLLED_AND_HELD = 2


class Event(StrEnum):
    """What can happen."""

    SEED = "seed"  # the robot is ready to follow: start from its measured pose
    RUN = "run"  # references are ramped in
    DEGRADE = "degrade"  # something is wrong, the robot can go on
    STOP = "stop"  # category 1 or 2
    CUT = "cut"  # category 0
    STANDSTILL = "standstill"  # the robot is at rest
    ACKNOWLEDGE = "acknowledge"  # a person has seen to it


IDLE, SEEDING, RUNNING, DEGRADED, STOPPING, STOPPED = State

#: (state, event) -> next state.
TRANSITIONS: dict[tuple[State, Event], State] = {
    (IDLE, Event.SEED): SEEDING,
    (IDLE, Event.STOP): STOPPED,
    (SEEDING, Event.RUN): RUNNING,
    (SEEDING, Event.DEGRADE): DEGRADED,
    (SEEDING, Event.STOP): STOPPING,
    (RUNNING, Event.DEGRADE): DEGRADED,
    (RUNNING, Event.STOP): STOPPING,
    (DEGRADED, Event.STOP): STOPPING,
    (STOPPING, Event.STANDSTILL): STOPPED,
    **{(state, Event.CUT): STOPPED for state in (IDLE, SEEDING, RUNNING, DEGRADED, STOPPING)},
    (DEGRADED, Event.ACKNOWLEDGE): RUNNING,
    (STOPPED, Event.ACKNOWLEDGE): IDLE,
}


#: So many causes are listed; of the others it is only said that there are some.
MOST_CAUSES = 20
_MORE = "further causes, not listed"

#: Measured figures and addresses, which change from tick to tick; whole numbers are names, as in "spot 3".
_FIGURE = re.compile(r"0x[0-9a-fA-F]+|[-+]?\d*\.\d+(?:[eE][-+]?\d+)?|[-+]?\d+\.?[eE][-+]?\d+")


def cause_in_words(cause: Any) -> str:
    """A cause as text that says something, whatever was given as one; never raises."""
    if not isinstance(cause, str):
        cause = in_words(cause) if isinstance(cause, BaseException) else represented(cause)
    return cause or "no cause given"


class Transition(NamedTuple):
    """One line of the log.

    Attributes:
        time: On the supervisor's clock [s]; NaN if that failed.
        before, after: States; equal if the category alone rose, or another cause was added.
        event: What happened.
        category: Of the stop, from its request until it is acknowledged.
        cause: Why, in words.
    """

    time: float
    before: State
    after: State
    event: Event
    category: StopCategory | None
    cause: str

    def __str__(self) -> str:
        stop = "" if self.category is None else f" (stop category {self.category.value})"
        return f"{self.time:10.3f} s  {self.before} -> {self.after}{stop}: {self.cause}"


class Supervisor:
    """Where the stream stands, and why.

    Nothing here raises in the loop: an event that does not fit the state is ignored, and the call returns False. A
    cause that differs from a known one in measured figures only is that one; one that is no text is put into words.

    Args:
        clock: Tells the time [s]. What it raises is only kept in `untimed`.
        keep: How many transitions `log` keeps; the oldest are dropped, `count` goes on.
        on_transition: Called with every transition, e.g. to print it. What it raises is only kept in `unheard`.

    Attributes:
        state: The present state.
        category: Of the present stop, None without one.
        causes: Why the state is degraded or worse; each once, until acknowledged.
        log: The last transitions.
        count: How many there have been.
        unheard: The last exception of `on_transition`, in words; empty without one.
        untimed: Why the clock told no time, the last time that it did not, in words; empty if it always did.

    Raises:
        ConfigurationError: `clock` or `on_transition` cannot be called, or `keep` is no whole number >= 0.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        keep: int = 1000,
        on_transition: Callable[[Transition], None] | None = None,
    ) -> None:
        to_call("Supervisor", "clock", clock)
        if on_transition is not None:
            to_call("Supervisor", "on_transition", on_transition)
        keep = whole("Supervisor", "keep", keep, "a whole number, 0 to 10^9", 0, 10**9)
        self._clock, self._on_transition = clock, on_transition
        self.state = IDLE
        self.category: StopCategory | None = None
        self.causes: tuple[str, ...] = ()
        self.log: deque[Transition] = deque(maxlen=keep)
        self.count = 0
        self.unheard = self.untimed = ""

    @property
    def moving(self) -> bool:
        """Whether references may move the robot: seeding, running, degraded, or braking."""
        return self.state not in (IDLE, STOPPED)

    @property
    def silent(self) -> bool:
        """Whether nothing may be sent any more: category 0, or category 1 after standstill."""
        return self.state is STOPPED and self.category in (
            StopCategory.IMMEDIATE,
            StopCategory.CONTROLLED_THEN_SILENT,
        )

    def seed(self, cause: str) -> bool:
        """The robot is ready to follow: idle -> seeding."""
        return self._handle(Event.SEED, cause)

    def run(self, cause: str) -> bool:
        """References are ramped in: seeding -> running."""
        return self._handle(Event.RUN, cause)

    def degrade(self, cause: str) -> bool:
        """Something is wrong, but the robot can go on."""
        return self._handle(Event.DEGRADE, cause)

    def stop(self, category: StopCategory, cause: str) -> bool:
        """Stop; a stop in progress only becomes graver.

        Args:
            category: How; what is none counts as category 0, since nothing graver can have been meant, and is said.
            cause: Why.
        """
        try:
            category = StopCategory(category)
        except Exception:  # of a stranger's own __eq__ or __hash__ as well
            cause = f"{cause_in_words(cause)} (with {represented(category)} for a stop category: taken for 0)"
            category = StopCategory.IMMEDIATE
        return self._handle(Event.CUT if category is StopCategory.IMMEDIATE else Event.STOP, cause, category)

    def standstill(self, cause: str) -> bool:
        """The robot is at rest: stopping -> stopped."""
        return self._handle(Event.STANDSTILL, cause)

    def acknowledge(self, cause: str) -> bool:
        """A person has seen to it: degraded -> running, stopped -> idle. While braking it does nothing.

        What is still wrong is reported by the next tick, and escalates again.
        """
        return self._handle(Event.ACKNOWLEDGE, cause)

    def _handle(self, event: Event, cause: str, category: StopCategory | None = None) -> bool:
        before, cause = self.state, cause_in_words(cause)
        after = TRANSITIONS.get((before, event), before)
        graver = category is not None and (self.category is None or category < self.category)
        bad = event in (Event.DEGRADE, Event.STOP, Event.CUT)
        news = bad and not self._known(cause)
        if news and after is before and not graver and len(self.causes) >= MOST_CAUSES:
            cause, news = _MORE, _MORE not in self.causes
        if after is before and not graver and not (news and before.severity >= DEGRADED.severity):
            return False
        now = self._time()
        if event is Event.ACKNOWLEDGE:
            self.causes, self.category = (), None
        elif bad and not self._known(cause):
            self.causes = (*self.causes, cause)
        if graver:
            self.category = category
        self.state = after
        self.count += 1
        transition = Transition(now, before, after, event, self.category, cause)
        self.log.append(transition)
        if self._on_transition is not None:
            try:
                self._on_transition(transition)
            except Exception as error:  # of the user's; the loop must go on
                self.unheard = type(error).__name__
        return True

    def _time(self) -> float:
        try:
            return float(self._clock())
        except Exception as error:  # of the user's, or it tells no number; what happened counts all the same
            self.untimed = in_words(error)
            return math.nan

    def _known(self, cause: str) -> bool:
        return cause in self.causes or _FIGURE.sub("#", cause) in {_FIGURE.sub("#", known) for known in self.causes}
