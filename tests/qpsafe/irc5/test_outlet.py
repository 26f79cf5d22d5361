"""An outlet never keeps its writer waiting, loses nothing where it can write, and says so where it cannot."""

from __future__ import annotations

import errno
import io
import os
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.irc5.process import outlet as module
from qpsafe.irc5.process.outlet import Outlet


class Gate:
    """A file that takes a few bytes at a time, and only while it is open."""

    def __init__(self, most: int = 7) -> None:
        self.open, self.most, self.data = threading.Event(), most, b""
        self.fault: OSError | None = None

    def write(self, piece: memoryview) -> int:
        self.open.wait(30.0)
        if self.fault is not None:
            raise self.fault
        taken = bytes(piece[: self.most])
        self.data += taken
        return len(taken)


@pytest.fixture
def gate() -> Iterator[Gate]:
    made = Gate()
    yield made
    made.open.set()


def until(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + 30.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.002)
    return condition()


@given(st.lists(st.text(max_size=40) | st.binary(max_size=40), max_size=30), st.integers(1, 50))
@settings(max_examples=some(10, of=25))
def test_everything_is_written_in_order_however_little_is_taken_at_a_time(pieces: list, most: int) -> None:
    gate = Gate(most)
    gate.open.set()
    outlet = Outlet(gate.write, "it")
    for piece in pieces:
        assert outlet.write(piece) == len(piece)
        assert outlet.trouble(time.monotonic()) == ""
    assert outlet.close()
    assert gate.data == b"".join(p if isinstance(p, bytes) else p.encode("utf-8", "replace") for p in pieces)
    assert not outlet.busy


def test_a_blocked_file_is_told_of_and_holds_up_nobody(gate: Gate) -> None:
    outlet = Outlet(gate.write, "terminal", due=1.0)
    outlet.write("a line\n")
    assert outlet.trouble(100.0) == ""
    assert outlet.trouble(101.0) == ""
    assert outlet.trouble(101.1) == "terminal: blocked for 1 s"
    assert not outlet.close(patience=0.05)
    assert outlet.lost == 1


def test_a_status_line_may_wait_for_ever_and_is_dropped_where_something_waits(gate: Gate) -> None:
    outlet = Outlet(gate.write, "terminal")
    for k in range(100):
        outlet.write(f"{k}", needed=False)
    for now in range(100):
        assert outlet.trouble(float(now)) == ""
    gate.open.set()
    assert outlet.close()
    assert gate.data == b"0"


def test_what_was_slow_and_goes_on_is_no_trouble(gate: Gate) -> None:
    outlet = Outlet(gate.write, "terminal")
    outlet.write("a line\n")
    assert outlet.trouble(100.0) == ""
    gate.open.set()
    assert until(lambda: gate.data == b"a line\n")
    assert until(lambda: outlet.trouble(200.0) == "")
    assert outlet.close()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EPIPE, errno.EIO])
def test_a_file_that_fails_is_told_of_and_nothing_raises(gate: Gate, number: int) -> None:
    outlet = Outlet(gate.write, "log")
    gate.fault = OSError(number, os.strerror(number))
    gate.open.set()
    outlet.write("lost")
    assert until(lambda: os.strerror(number) in outlet.trouble(0.0))
    outlet.write("lost, too")
    assert not outlet.close()
    assert outlet.lost == 2


def test_memory_is_bounded(gate: Gate, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST", 1000)
    outlet = Outlet(gate.write, "log")
    for _ in range(100):
        outlet.write(b"x" * 100)
    assert outlet.lost == 90
    assert "90 pieces were lost" in outlet.trouble(0.0)


def test_real_files_full_closed_and_none() -> None:
    with open("/dev/full", "w") as full:
        outlet = Outlet.over(full, "screen")
        outlet.write("words")
        assert not outlet.close()
        assert "No space left" in outlet.failure
    back, there = os.pipe()
    os.close(back)
    with os.fdopen(there, "w") as pipe:
        outlet = Outlet.over(pipe, "screen")
        outlet.write("words")
        assert not outlet.close()
    for stream in (None, io.StringIO()):
        outlet = Outlet.over(stream, "screen")
        outlet.write("words")
        assert outlet.close()
    assert stream is not None
    assert stream.getvalue() == "words"
    assert not outlet.isatty()


def test_a_full_pipe_is_read_to_the_end_once_somebody_reads() -> None:
    back, there = os.pipe()
    with os.fdopen(there, "w") as pipe:
        outlet = Outlet.over(pipe, "screen")
        text = "line of some length\n" * 20000  # more than any pipe holds
        outlet.write(text)
        assert outlet.trouble(0.0) == ""
        found = bytearray()
        while len(found) < len(text):
            found += os.read(back, 65536)
        assert outlet.close()
    os.close(back)
    assert found.decode() == text
