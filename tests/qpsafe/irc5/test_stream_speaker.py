"""What the stream says while it runs: a line a cause, and what it waits for with counts and reasons."""

from __future__ import annotations

import types

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.cli.irc5.stream_speaker import LONGEST, Speaker, refused
from qpsafe.irc5.distances import SensorCounts
from qpsafe.irc5.supervisor import Event, State, Transition
from qpsafe.irc5.transport.inbox import REFUSALS


class Page:
    def __init__(self) -> None:
        self.text, self.status = "", 0

    def write(self, data: str, needed: bool = True) -> int:
        self.text += data if needed else ""
        self.status += not needed
        return len(data)


def speaker(counts: dict[str, int], page: Page, inlet: object = None, status: bool = False) -> Speaker:
    inbox = types.SimpleNamespace(refusal="why it was not")
    streamer = types.SimpleNamespace(
        address=("127.0.0.1", 6510), counts=counts, session=types.SimpleNamespace(inbox=inbox)
    )
    return Speaker(page, streamer, inlet, status, lambda: "12:00:00")  # type: ignore[arg-type]


def run(answered: bool = False, silent: float = 0.5) -> types.SimpleNamespace:
    latency = types.SimpleNamespace(above=lambda _: 0, count=7)
    return types.SimpleNamespace(answered=answered, silent=silent, duration=1.0, latency=latency)


def loop(state: State = State.RUNNING, tick: object = None) -> types.SimpleNamespace:
    return types.SimpleNamespace(supervisor=types.SimpleNamespace(state=state), tick=tick)


@given(st.text(max_size=2000))
def test_whatever_a_cause_contains_it_is_one_line_of_printable_letters(cause: str) -> None:
    page = Page()
    speaker({}, page).say(Transition(1.0, State.RUNNING, State.STOPPING, Event.STOP, None, cause))
    assert page.text.count("\n") == 1
    assert page.text.endswith("\n")
    assert page.text[:-1].isprintable()
    assert len(page.text) <= LONGEST + 20
    assert "running -> stopping" in page.text


@given(st.dictionaries(st.sampled_from(REFUSALS), st.integers(0, 5000)), st.integers(0, 3))
def test_every_refusal_is_counted_while_waiting(counts: dict[str, int], accepted: int) -> None:
    page, total = Page(), sum(counts.values())
    speaker({**counts, "accepted": accepted}, page).second(run(), loop())  # type: ignore[arg-type]
    assert bool(page.text) == bool(total)
    if total:
        assert f": {total} datagram{'s' * (total != 1)} refused (" in page.text
        assert "why it was not" in page.text
        for name, count in counts.items():
            assert (f"{name} {count}" in page.text) == (count > 0)


def test_waiting_is_repeated_when_the_counts_change_but_not_every_second() -> None:
    counts, page = {"garbage": 0}, Page()
    said = speaker(counts, page)
    for _ in range(60):
        counts["garbage"] += 10
        said.second(run(), loop())  # type: ignore[arg-type]
    assert page.text.count("\n") == 60 / 5
    for _ in range(60):
        said.second(run(), loop())  # type: ignore[arg-type]
    assert page.text.count("\n") <= 60 / 5 + 1


@pytest.mark.parametrize(
    ("moment", "words"),
    [
        (run(silent=12.0), "waiting for the robot at 127.0.0.1:6510: nothing has come"),
        (run(silent=3.0), ""),
        (run(answered=True), ""),
        (run(answered=True, silent=12.0), "nothing has come"),
    ],
)
def test_silence_is_told_after_a_while(moment: types.SimpleNamespace, words: str) -> None:
    page = Page()
    speaker({}, page).second(moment, loop())  # type: ignore[arg-type]
    assert words in page.text
    assert bool(page.text) == bool(words)


def test_a_robot_that_is_held_for_want_of_distances_is_told() -> None:
    inlet = types.SimpleNamespace(address=("127.0.0.1", 6511), counts=SensorCounts(rejected=9), refusal="19 spots")
    page = Page()
    said = speaker({}, page, inlet, status=True)
    said.second(run(answered=True), loop(State.SEEDING))  # type: ignore[arg-type]
    assert "waiting for distances at 127.0.0.1:6511: 9 datagrams refused (rejected 9); the last: 19 spots" in page.text
    assert page.status == 1
    said.second(run(answered=True), loop(State.RUNNING, tick=object()))  # type: ignore[arg-type]
    assert page.text.count("\n") == 1
    assert page.status == 2


def test_nothing_refused_is_nothing_said() -> None:
    assert refused({"accepted": 5}, "") == ""
