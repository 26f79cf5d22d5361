"""The supervisor only escalates until acknowledged, and says why; its diagram in the docs is its table."""

import math
import re
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from qpsafe.irc5.supervisor import MOST_CAUSES, TRANSITIONS, Event, State, StopCategory, Supervisor

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "supervisor.md"
CAUSES = st.sampled_from(["sensor 3", "robot: motors off", "watchdog", "no packet", "operator"])
CATEGORIES = st.sampled_from(StopCategory)


class Stream(RuleBasedStateMachine):
    """Any sequence of events."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.heard: list = []
        self.supervisor = Supervisor(lambda: self.now, on_transition=self.heard.append)
        self.worst = self.supervisor.state
        self.gravest: StopCategory | None = None

    @rule(cause=CAUSES)
    def seed(self, cause: str) -> None:
        self.check(Event.SEED, self.supervisor.seed(cause), cause)

    @rule(cause=CAUSES)
    def run(self, cause: str) -> None:
        self.check(Event.RUN, self.supervisor.run(cause), cause)

    @rule(cause=CAUSES)
    def degrade(self, cause: str) -> None:
        self.check(Event.DEGRADE, self.supervisor.degrade(cause), cause)

    @rule(category=CATEGORIES, cause=CAUSES)
    def stop(self, category: StopCategory, cause: str) -> None:
        asked = self.supervisor.stop(category, cause)
        self.check(Event.CUT if category == 0 else Event.STOP, asked, cause)
        # whatever the state was: from now on the robot stops, at least as gravely as asked, and the cause is kept
        assert self.supervisor.state in (State.STOPPING, State.STOPPED)
        assert self.supervisor.category is not None
        assert self.supervisor.category <= category
        assert cause in self.supervisor.causes

    @rule(cause=CAUSES)
    def standstill(self, cause: str) -> None:
        self.check(Event.STANDSTILL, self.supervisor.standstill(cause), cause)

    @rule(cause=CAUSES)
    def acknowledge(self, cause: str) -> None:
        before = self.supervisor.state
        done = self.supervisor.acknowledge(cause)
        assert done == (before in (State.DEGRADED, State.STOPPED))
        if done:  # never to more than what it was before the trouble
            assert self.supervisor.state == {State.DEGRADED: State.RUNNING, State.STOPPED: State.IDLE}[before]
            assert self.supervisor.causes == ()
            assert self.supervisor.category is None
            self.worst, self.gravest = self.supervisor.state, None
        else:
            assert self.supervisor.state is before

    @rule(step=st.floats(0.0, 10.0))
    def wait(self, step: float) -> None:
        self.now += step

    def check(self, event: Event, changed: bool, cause: str) -> None:
        """A reported change is on the log with its cause, time and event; without one nothing changed."""
        if changed:
            last = self.supervisor.log[-1]
            assert (last.after, last.event, last.cause) == (self.supervisor.state, event, cause)
            assert last.time == self.now

    @invariant()
    def only_escalates(self) -> None:
        state, category = self.supervisor.state, self.supervisor.category
        assert state.severity >= self.worst.severity
        assert self.gravest is None or (category is not None and category <= self.gravest)
        self.worst, self.gravest = state, category

    @invariant()
    def what_is_wrong_has_a_cause(self) -> None:
        bad = self.supervisor.state.severity >= State.DEGRADED.severity
        assert bool(self.supervisor.causes) == bad
        assert (self.supervisor.category is not None) == (self.supervisor.state in (State.STOPPING, State.STOPPED))

    @invariant()
    def the_log_is_a_chain(self) -> None:
        log = list(self.supervisor.log)
        assert log == self.heard
        assert self.supervisor.count == len(log)
        state = State.IDLE
        for transition in log:
            assert transition.before is state
            assert transition.cause
            assert transition.after is TRANSITIONS.get((state, transition.event), state)
            state = transition.after
        assert state is self.supervisor.state

    @precondition(lambda self: self.supervisor.silent)
    @invariant()
    def silence_is_not_broken_but_by_acknowledgement(self) -> None:
        for again in (self.supervisor.seed, self.supervisor.run):
            assert not again("by itself")
        assert self.supervisor.silent
        assert not self.supervisor.moving


TestStream = Stream.TestCase
TestStream.settings = settings(max_examples=some(20, of=120), stateful_step_count=30, deadline=None)


def test_no_event_but_acknowledgement_leads_back() -> None:
    for (before, event), after in TRANSITIONS.items():
        if event is not Event.ACKNOWLEDGE:
            assert after.severity > before.severity
    assert [state.value for state in State] == ["idle", "seeding", "running", "degraded", "stopping", "stopped"]


def test_every_state_can_be_stopped_and_every_category_has_a_name() -> None:
    for state in (State.IDLE, State.SEEDING, State.RUNNING, State.DEGRADED):
        assert {(state, Event.STOP), (state, Event.CUT)} <= set(TRANSITIONS)
    assert {c.value: c.name for c in StopCategory} == {
        0: "IMMEDIATE",
        1: "CONTROLLED_THEN_SILENT",
        2: "CONTROLLED_AND_HELD",
    }


def test_the_log_is_bounded_and_a_repeated_cause_is_logged_once() -> None:
    supervisor = Supervisor(keep=5)
    supervisor.seed("ready")
    supervisor.run("ramped in")
    for _ in range(1000):
        supervisor.degrade("sensor 3 is sick")
    assert supervisor.count == 3
    for k in range(1000):
        supervisor.degrade(f"cause {k}")
    assert len(supervisor.log) == 5
    assert len(supervisor.causes) <= 100
    text = str(supervisor.log[-1])
    assert "degraded -> degraded" in text
    assert "cause" in text


@given(
    st.lists(st.floats(0.0, 1e6, allow_subnormal=False), min_size=2, max_size=60),
    st.sampled_from(["joint_2 is {} rad from what it was sent", "law: <object at 0x{:x}> failed after {:.3f} s"]),
)
@settings(max_examples=some(8, of=50), deadline=None)
def test_a_cause_whose_figures_change_is_one_cause_and_one_line(figures: list[float], words: str) -> None:
    supervisor = Supervisor()
    supervisor.seed("ready")
    for figure in figures:
        text = words.format(repr(float(figure))) if "joint" in words else words.format(int(figure), figure)
        supervisor.stop(StopCategory.CONTROLLED_AND_HELD, text)
    assert len(supervisor.causes) == 1
    assert supervisor.count == 2


def test_names_with_numbers_are_causes_of_their_own_up_to_a_bound() -> None:
    supervisor = Supervisor()
    supervisor.seed("ready")
    for k in range(5):
        supervisor.degrade(f"spot {k} is dead, joint_{k} too")
    assert len(supervisor.causes) == 5
    for k in range(5000):
        supervisor.degrade(f"spot {k} is dead")
    assert len(supervisor.causes) == MOST_CAUSES + 1
    assert "further causes" in supervisor.causes[-1]
    assert supervisor.stop(StopCategory.IMMEDIATE, "and what stops it is listed all the same")
    assert "listed all the same" in supervisor.causes[-1]


def test_whatever_listening_raises_the_supervisor_goes_on() -> None:
    def fail(transition: object) -> None:
        raise OSError("no space left")

    supervisor = Supervisor(on_transition=fail)
    assert supervisor.seed("ready")
    assert supervisor.stop(StopCategory.CONTROLLED_THEN_SILENT, "Ctrl-C")
    assert supervisor.state is State.STOPPING
    assert supervisor.unheard == "OSError"


class Hostile:
    """Whatever is asked of it, it raises."""

    def _fail(self, *_: object) -> NoReturn:
        raise RuntimeError("not this one")

    __repr__ = __str__ = __eq__ = __hash__ = __bool__ = __float__ = __len__ = _fail  # type: ignore[assignment]


ODD = st.one_of(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
    st.lists(st.integers()) | st.dictionaries(st.text(), st.integers()),
    st.builds(Hostile) | st.builds(object) | st.just(Hostile) | st.builds(ValueError, st.text()),
    st.just(10**5000) | st.just(np.zeros(3)),
)
CLOCKS = st.sampled_from(["good", "raises"]) | ODD
WAYS = st.sampled_from([method for method in vars(Supervisor) if not method.startswith("_")]).filter(
    lambda name: callable(getattr(Supervisor, name))
)


@given(st.lists(st.tuples(WAYS, ODD, ODD | CATEGORIES, CLOCKS), min_size=1, max_size=12))
@settings(max_examples=some(60, of=500))
def test_nothing_that_is_given_in_the_loop_raises_or_leaves_a_change_unsaid(
    calls: list[tuple[str, Any, Any, Any]],
) -> None:
    """Causes, categories and times of any type: what changes is in the log, in words, at NaN where there is no time."""
    told: Any = "good"

    def clock() -> Any:
        if isinstance(told, str) and told == "raises":
            raise ZeroDivisionError("no time")
        return 1.0 if isinstance(told, str) and told == "good" else told

    supervisor = Supervisor(clock)
    for name, cause, category, told in calls:
        before, count = supervisor.state, supervisor.count
        changed = getattr(supervisor, name)(*([category] if name == "stop" else []), cause)
        assert supervisor.count == count + changed
        assert changed or supervisor.state is before
        if not changed:
            continue
        last = supervisor.log[-1]
        assert (last.before, last.after) == (before, supervisor.state)
        assert isinstance(last.time, float)
        assert isinstance(last.cause, str)
        assert last.cause
        assert str(last)
        assert math.isfinite(last.time) or supervisor.untimed or isinstance(told, float)
        if name == "stop" and not (isinstance(category, int | float) and category in (0, 1, 2)):
            assert supervisor.category is StopCategory.IMMEDIATE
            assert "for a stop category: taken for 0" in last.cause


@pytest.mark.parametrize("category", [7, -1, "1", None, math.nan, [1], Hostile(), Hostile])
def test_a_category_that_is_none_stops_as_the_gravest_and_is_said(category: Any) -> None:
    supervisor = Supervisor()
    supervisor.seed("ready")
    assert supervisor.stop(category, "in a hurry")
    assert (supervisor.state, supervisor.category) == (State.STOPPED, StopCategory.IMMEDIATE)
    (cause,) = supervisor.causes
    assert cause.startswith("in a hurry (with ")


def test_a_clock_that_fails_is_said_and_the_transition_is_logged() -> None:
    supervisor = Supervisor(lambda: 1 / 0)
    assert supervisor.seed("ready")
    assert math.isnan(supervisor.log[-1].time)
    assert supervisor.untimed == "ZeroDivisionError: division by zero"
    assert "idle -> seeding: ready" in str(supervisor.log[-1])


def test_the_pages_table_is_that_of_the_code() -> None:
    """Transitions of the page are those of the code, states in their order of severity; the drawing has each state."""
    page = PAGE.read_text(encoding="utf-8")
    head, _, *rows = re.search(r"^\| in \|.*?\n\n", page, re.MULTILINE | re.DOTALL)[0].strip().splitlines()  # type: ignore[index]
    events = [cell.strip() for cell in head.strip("|").split("|")][1:]
    assert set(events) == {event.value for event in Event}
    cells = [[cell.strip(" `") for cell in row[1:-1].split("|")] for row in rows]
    assert [before for before, *_ in cells] == [state.value for state in State]
    told = {(before, event, after) for before, *row in cells for event, after in zip(events, row, strict=True) if after}
    assert told == {(a.value, event.value, b.value) for (a, event), b in TRANSITIONS.items()}
    drawing = page[page.index("```\n") : page.index("| in |")]
    assert set(re.findall(r"│ (\w+) │", drawing)) == {state.value for state in State}
