"""Junk on the wire: no exception, no change of state; the same judged by an independent message module."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from random import Random
from types import ModuleType

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5.messages import MalformedPacket, decode_sensor


def load(name: str) -> ModuleType:
    """A script of the benchmarks, which are no package."""
    path = Path(__file__).parents[3] / "benchmarks" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


fuzz_egm = load("fuzz_egm")


@settings(max_examples=some(50, of=300))
@given(data=st.binary(max_size=300))
def test_any_bytes(data: bytes) -> None:
    fuzz_egm.Target().check(data)


@settings(max_examples=some(50, of=300))
@given(data=st.data())
def test_valid_packets_with_some_bytes_changed(data: st.DataObject) -> None:
    target = fuzz_egm.Target()
    packet = bytearray(target.next)
    places = st.integers(0, len(packet) - 1)
    for place, value in data.draw(st.lists(st.tuples(places, st.integers(0, 255)), max_size=5)):
        packet[place] = value
    target.check(bytes(packet[: data.draw(st.integers(0, len(packet)))]))


@settings(max_examples=some(33, of=200))
@given(data=st.binary(max_size=200))
def test_a_simulated_robot_survives_any_answer(data: bytes) -> None:
    try:
        packet = decode_sensor(data, 6)
    except MalformedPacket:
        return
    assert np.isfinite([packet.q_ref, packet.qd_ref]).all()


def test_many_mutants() -> None:
    report = fuzz_egm.fuzz(some(2_000, of=6_000), seed=1)
    assert report["ok"]
    assert report["judged_by"]
    became = report["became"]
    expected = {"garbage", "incomplete", "wrong_kind", "wrong_joint_count", "not_finite", "no_clock", "implausible"}
    assert all(became[reason] > 0 for reason in expected | {"accepted", "stale", "wrong_sender"})


@pytest.mark.slow
def test_a_million_mutants() -> None:
    assert fuzz_egm.fuzz(1_000_000, seed=2)["ok"]


def test_the_judge_would_notice() -> None:
    """What the fuzzing relies on: the target raises when a refused datagram changes something, or a value is off."""
    target = fuzz_egm.Target()
    offer = target.session.offer

    def careless(data: bytes, sender: tuple[str, int], now: float) -> bool:
        target.session._missed += 1
        return offer(data, sender, now)

    target.session.offer = careless
    with pytest.raises(AssertionError):
        target.check(b"junk")
    packet = fuzz_egm.Target().next
    other = fuzz_egm.valid(Random(5), 2, 1e6)
    with pytest.raises(AssertionError):
        fuzz_egm.judge(packet, fuzz_egm.EgmSession(fuzz_egm.LIMITS).inbox.offer(other, fuzz_egm.ROBOT, 0.0).packet)
