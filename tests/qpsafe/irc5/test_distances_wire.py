"""Distances over UDP: what is sent is read, junk and strangers change nothing."""

import select
import socket
import time
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.distances import MOST_AGED, MOST_SPOTS, Distances, SensorInput, SensorOutput, decode, encode
from qpsafe.sensing.rules import SensingRules

VALUES = st.integers(0, 30).flatmap(lambda k: arrays(np.float64, k))  # NaN and infinities too


@given(VALUES, st.booleans(), st.integers(0, 2**32 - 1), st.floats(0.0, 1e9))
def test_round_trip_to_the_bit(values: np.ndarray, aged: bool, seq: int, time: float) -> None:
    sent = Distances(seq, time, values, values[::-1] if aged else None)
    found = decode(encode(sent), len(values))
    assert found is not None
    assert found.seq == seq
    assert abs(found.time - time) <= 1e-6
    assert found.values.tobytes() == values.tobytes()
    assert (found.ages is not None) == aged
    assert found.ages is None or found.ages.tobytes() == values[::-1].tobytes()


COUNTS = st.integers(0, 70_000) | st.sampled_from([MOST_SPOTS, MOST_SPOTS + 1, MOST_AGED, MOST_AGED + 1])
SHAPES = st.tuples(COUNTS) | st.tuples(st.integers(0, 30)) | st.sampled_from([(), (20, 2), (2, 20), (20, 1), (1, 20)])


@settings(max_examples=some(25, of=500), deadline=None)
@given(SHAPES, st.none() | SHAPES | st.just("the same"))
def test_what_can_be_sent_can_be_read_and_all_else_is_refused_by_name(shape: Any, aged: Any) -> None:
    aged = shape if aged == "the same" else aged
    reader = SensorInput(min(shape[0], MOST_SPOTS) if shape else 1, port=0)
    writer = SensorOutput(*reader.address)
    values, ages = np.zeros(shape), None if aged is None else np.zeros(aged)
    fits = len(shape) == 1 and shape[0] <= (MOST_SPOTS if aged is None else MOST_AGED)
    try:
        if fits and aged in (None, shape):
            writer.send(values, ages)
            select.select([reader._socket], [], [], 5.0)
            assert np.isfinite(reader.read()[1]).all()
            assert reader.counts.used == 1
        else:
            with pytest.raises(ConfigurationError, match=f"^distances: {'ages' if fits else 'values'} = "):
                writer.send(values, ages)
    finally:
        reader.close()
        writer.close()


@settings(max_examples=some(50, of=300))
@given(st.binary(max_size=400), st.integers(0, 300), st.integers(1, 255))
def test_junk_is_nothing(junk: bytes, at: int, flip: int) -> None:
    assert decode(junk, 20) is None or junk[:4] == b"QPSD"
    good = encode(Distances(7, 0.0, np.arange(20.0)))
    assert decode(good, 19) is None
    assert decode(good[: at % len(good)], 20) is None
    assert decode(good + junk, 20) is None or not junk
    spoiled = bytearray(good)
    spoiled[at % 8] ^= flip  # in magic, version, flags or count
    assert decode(bytes(spoiled), 20) is None


@pytest.fixture
def wire():
    """An input with its output, on a port that the system chose."""
    entrance = SensorInput(3, port=0)
    exit_ = SensorOutput(*entrance.address)
    yield entrance, exit_
    entrance.close()
    exit_.close()


def test_nothing_yet_is_no_reading_of_infinite_age(wire) -> None:
    values, ages = wire[0].read()
    assert np.isnan(values).all()
    assert np.isinf(ages).all()


def test_the_newest_counts_and_ages(wire) -> None:
    entrance, exit_ = wire
    for k in range(5):
        exit_.send(np.full(3, float(k)))
    values, ages = entrance.read(now=10.0)
    assert values.tolist() == [4.0, 4.0, 4.0]
    assert ages.tolist() == [0.0, 0.0, 0.0]
    assert (entrance.counts.used, entrance.counts.skipped) == (1, 4)
    values, ages = entrance.read(now=10.5)
    assert values.tolist() == [4.0, 4.0, 4.0]
    assert ages.tolist() == [0.5, 0.5, 0.5]
    exit_.send(np.full(3, 5.0), ages=np.array([0.0, 0.1, np.nan]))
    ages = entrance.read(now=10.6)[1]
    assert ages[:2].tolist() == [0.0, 0.1]
    assert np.isnan(ages[2])  # unknown stays unknown: the sensing takes it for stale


def test_junk_duplicates_and_strangers_change_nothing(wire) -> None:
    entrance, exit_ = wire
    exit_.send(np.full(3, 1.0))
    entrance.read(now=1.0)
    own, stranger = exit_._socket, socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    own.sendto(encode(Distances(0, 0.0, np.full(3, 9.0))), entrance.address)  # a duplicate
    own.sendto(encode(Distances(2**32 - 1, 0.0, np.full(3, 9.0))), entrance.address)  # older
    own.sendto(b"", entrance.address)
    own.sendto(encode(Distances(5, 0.0, np.full(4, 9.0))), entrance.address)
    stranger.sendto(encode(Distances(5, 0.0, np.full(3, 9.0))), entrance.address)
    values, ages = entrance.read(now=1.5)
    assert values.tolist() == [1.0, 1.0, 1.0]
    assert ages.tolist() == [0.5, 0.5, 0.5]
    assert (entrance.counts.stale, entrance.counts.rejected, entrance.counts.strangers) == (2, 2, 1)
    stranger.sendto(encode(Distances(0, 0.0, np.full(3, 2.0))), entrance.address)  # after a silence: restarted
    assert entrance.read(now=3.0)[0].tolist() == [2.0, 2.0, 2.0]
    stranger.close()


def test_the_sequence_wraps_around(wire) -> None:
    entrance, exit_ = wire
    exit_._seq = 2**32 - 1
    for k in (1.0, 2.0):
        exit_.send(np.full(3, k))
        assert entrance.read(now=1.0)[0].tolist() == [k, k, k]
    assert exit_._seq == 1


def test_an_address_in_use_is_named(wire) -> None:
    with pytest.raises(ConfigurationError, match=str(wire[0].address[1])):
        SensorInput(3, port=wire[0].address[1])


@settings(max_examples=some(10, of=60), deadline=None)
@given(
    st.lists(st.floats(-1e6, 1e6) | st.floats(-0.1, 0.1) | st.just(float("nan")), min_size=3, max_size=3),
    st.floats(0.06, 30.0),
)
def test_no_age_that_a_sender_states_hides_its_silence(sent: list[float], silence: float) -> None:
    """Silent for longer than readings may be old, nothing looks fresh: each age is too high, impossible, or none."""
    rules = SensingRules()
    reader = SensorInput(3, port=0)
    writer = SensorOutput(*reader.address)
    try:
        writer.send(np.zeros(3), np.array(sent))
        until = time.monotonic() + 5.0
        while reader.counts.used == 0 and time.monotonic() < until:
            reader.read(100.0)
        _, now = reader.read(100.0)
        assert reader.counts.used == 1
        impossible = np.array(sent) < -rules.clock_error
        assert ((now < -rules.clock_error) == impossible).all()  # passed on as they are
        _, ages = reader.read(100.0 + silence)
        assert not ((-rules.clock_error <= ages) & (ages <= rules.max_age)).any()
    finally:
        reader.close()
        writer.close()
