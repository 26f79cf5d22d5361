"""How old distances are told to be: never less than they are, but for 20 ms, however long they waited unread."""

from __future__ import annotations

import math
import socket
import threading
import time
import types
from collections.abc import Iterator

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5 import run as run_module
from qpsafe.irc5.distances import NEW, SensorInput, SensorOutput
from qpsafe.irc5.loop import StreamLoop
from qpsafe.irc5.process.requests import Requests
from qpsafe.irc5.run import WAIT, run_stream
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.irc5.transport import arrival
from qpsafe.irc5.transport.arrival import Waits
from qpsafe.sensing.rules import SensingRules

SPOTS = 2
FAR_TOO_MANY = 3000  # datagrams: more than a socket holds


class Sensors:
    """Sends samplings whose values are when they were sent, by the monotonic clock, and how old they were then."""

    def __init__(self) -> None:
        self.entrance = SensorInput(SPOTS, port=0)
        self.output = SensorOutput(*self.entrance.address)

    def send(self, ages: float | None = None) -> float:
        sent = time.monotonic()
        self.output.send(np.array([sent, ages or 0.0]), None if ages is None else np.full(SPOTS, ages))
        return sent

    def close(self) -> None:
        self.entrance.close()
        self.output.close()


@pytest.fixture
def sensors() -> Iterator[Sensors]:
    made = Sensors()
    yield made
    made.close()


SILENCES = st.sampled_from([0.0, 0.001, 0.01, 0.03]) | st.floats(0.0, 0.1)
BACKLOGS = st.sampled_from([1, 2, 10, FAR_TOO_MANY])


@pytest.mark.long
@settings(max_examples=some(15, of=200), deadline=None)
@given(
    st.lists(st.tuples(BACKLOGS, SILENCES, st.sampled_from([None, 0.0, 0.05]), st.booleans()), min_size=1, max_size=6)
)
def test_the_age_told_is_never_less_than_the_true_one_by_more_than_20_ms(
    history: list[tuple[int, float, float | None, bool]],
) -> None:
    """Bursts, also of more than a socket holds, silences after them, reads or only listening between."""
    sensors = Sensors()
    try:
        for backlog, silence, stated, reads in history:
            for _ in range(backlog):
                sensors.send(stated)
            time.sleep(silence)
            now = time.monotonic()
            if not reads:
                sensors.entrance.listen(now)
                continue
            values, ages = sensors.entrance.read(now)
            true = max(now - values[0], 0.0) + values[1]
            assert (ages >= true - NEW).all()
            assert (ages >= 0.0).all()
    finally:
        sensors.close()


def test_what_waited_for_a_second_behind_a_full_socket_is_a_second_old_and_the_next_is_new(sensors: Sensors) -> None:
    first = sensors.send()
    for _ in range(FAR_TOO_MANY):
        sensors.send()
    time.sleep(1.0)
    last = sensors.send()  # dropped by the system: there is no room
    now = time.monotonic()
    values, ages = sensors.entrance.read(now)
    assert first <= values[0] < last - 0.9
    assert (np.abs(ages - (now - values[0])) < 0.02).all()
    while sensors.entrance.read(time.monotonic())[0][0] < first + 0.9:  # now there is
        sensors.send()
    assert (sensors.entrance.read(time.monotonic())[1] < 0.5).all()


@pytest.mark.parametrize("stated", [None, 0.0, 0.01, -0.005])
def test_waiting_adds_to_what_a_sender_states(sensors: Sensors, stated: float | None) -> None:
    sensors.send(stated)
    time.sleep(0.1)
    ages = sensors.entrance.read(100.0)[1]
    assert (ages >= 0.1 + max(stated or 0.0, 0.0) - 1e-3).all()
    assert np.allclose(sensors.entrance.read(100.5)[1], ages + 0.5)


def test_what_is_read_at_once_is_as_new_as_in_one_process(sensors: Sensors) -> None:
    """To the bit, also if it was listened to meanwhile: a run over the wire can be compared with one without."""
    for k in range(20):
        now = 10.0 + k
        sensors.send(0.0)
        sensors.entrance.listen(now)
        assert sensors.entrance.read(now + 0.5 * NEW)[1].tolist() == [0.0] * SPOTS
    assert (sensors.entrance.counts.used, sensors.entrance.counts.skipped) == (20, 0)
    assert 0.5 * SensingRules().max_age == NEW


class Clocks:
    """A computer's two clocks, of which the real-time one is set now and then."""

    def __init__(self) -> None:
        self.monotonic, self.ahead = 10**12, 10**18

    def monotonic_ns(self) -> int:
        return self.monotonic

    def time_ns(self) -> int:
        return self.monotonic + self.ahead


STEPS, TIMES = st.integers(-(10**11), 10**11), st.integers(0, 10**10)


@settings(max_examples=some(100, of=2000))
@given(st.lists(st.tuples(TIMES, STEPS | st.just(0), TIMES, st.booleans()), max_size=8))
def test_setting_the_clock_makes_nothing_younger_than_it_is_nor_older_than_the_last_look(
    rounds: list[tuple[int, int, int, bool]],
) -> None:
    """Between two looks a datagram comes and the clock is set once: before it, or after."""
    clocks = Clocks()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arrival, "time", clocks)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as entrance:
            waits = Waits(entrance)
            for before, step, after, late in rounds:
                empty = clocks.monotonic
                clocks.monotonic += before
                clocks.ahead += 0 if late else step
                arrived, stamp = clocks.monotonic, clocks.time_ns()
                clocks.ahead += step if late else 0
                clocks.monotonic += after
                waits.look()
                waited = waits.of(stamp)
                assert waited >= 1e-9 * (clocks.monotonic - arrived) - 1e-9
                assert waited <= 1e-9 * (clocks.monotonic - empty) + 1e-9
                # a time that was noted when it was read tells nothing
                assert waits.of(clocks.time_ns()) == 1e-9 * (clocks.monotonic - empty)
                waits.emptied()


@pytest.mark.parametrize("clock", ["steady", "set back", "set forth"])
def test_a_clock_that_is_set_while_a_datagram_waits_hides_nothing(sensors: Sensors, clock: str, monkeypatch) -> None:
    sensors.send()
    time.sleep(0.1)
    step = {"steady": 0, "set back": -3600 * 10**9, "set forth": 3600 * 10**9}[clock]
    real = time.time_ns
    other = types.SimpleNamespace(time_ns=lambda: real() + step, monotonic_ns=time.monotonic_ns)
    monkeypatch.setattr(arrival, "time", other)
    ages = sensors.entrance.read(100.0)[1]
    assert (ages >= 0.099).all()
    assert (ages < 60.0).all()


class Silent(EgmStreamer, StreamLoop):
    """A robot that does not speak: what `run_stream` has of a streamer, a loop and its supervisor."""

    leaving = False

    def __init__(self, requests: Requests, end: float) -> None:
        self.requests, self.end = requests, end
        self.rules = types.SimpleNamespace(silence=0.1)
        self.session = types.SimpleNamespace(at_rest=True)
        self.supervisor = types.SimpleNamespace(state=run_module.State.STOPPED)

    def wait(self, timeout: float) -> None:
        assert timeout == WAIT
        time.sleep(0.01)
        if time.monotonic() > self.end:
            self.requests.leave = "enough"

    def silent(self, seconds: float) -> None:
        pass

    def stop(self, category: object, cause: str) -> None:
        self.leaving = True


def test_the_sensors_are_listened_to_while_no_robot_speaks(sensors: Sensors) -> None:
    """For longer than the socket holds what they send; the newest is there when the robot comes."""
    requests = Requests()
    robot, over = Silent(requests, time.monotonic() + 1.0), threading.Event()
    sent: list[float] = []

    def speak() -> None:
        while not over.wait(0.0005):
            sent.append(sensors.send())

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        run = run_stream(robot, robot, sensors=sensors.entrance, requests=requests)
        newest = sent[-1]
    finally:
        over.set()
        speaker.join()
    assert run.failure == ""
    assert sensors.entrance._newest is not None
    assert sensors.entrance._newest.values[0] >= newest - 0.2
    assert sensors.entrance.counts.used == 0
    assert sensors.entrance.counts.skipped > 300
    values, ages = sensors.entrance.read()
    assert math.isclose(values[0], sent[-1])
    assert (ages < 0.2).all()
