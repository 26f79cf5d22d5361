"""A watchdog in a process of its own: when the loop's heartbeat stops, it asks for a stop, then insists.

Both share a page of memory. The loop writes the time there at every pass. If the last heartbeat is older than `limit`,
the watchdog writes how old it is: asked. A loop that still runs, late, reads that at its next pass and brakes the
robot to rest. If there is no heartbeat for `grace` more, nobody will read: the watchdog kills the loop's process, so
that the robot hears nothing and stops by its own CommTimeout, instead of hearing something stale later.

The loop watches the watchdog in turn: `trouble` tells that its process has ended, or stands still.

It starts with the first heartbeat and ends with the loop's process. It is a program beside a program, no safety device.
"""

from __future__ import annotations

import mmap
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from types import TracebackType

from qpsafe.errors import ConfigurationError
from qpsafe.text.given import number, whole

_BEAT, _ASKED, _WORST, _PULSE = range(4)  # places in the page, 8 bytes each: times and ages [ns]; turns of the watchdog
_PAGE = 4096
_START = 30.0  # how long the watchdog's process may take to start, on a busy machine [s]
_STILL = 1.0  # without a turn of its own for so long, it stands still [s]
KILLED = 3  # exit code of the watchdog's process after it had to insist


class Watchdog:
    """The loop's side; use as a context. Entering it returns once the watchdog watches.

    Args:
        limit: Age of the last heartbeat at which a stop is asked for [s].
        grace: Further time until the process is killed [s].
        priority: Real-time priority to try for the watchdog's process, up to 99; 0 for none.

    Raises:
        ConfigurationError: A time is not above 0, the priority is none; entering: its process does not start.
    """

    def __init__(self, limit: float = 0.1, grace: float = 1.0, priority: int = 0) -> None:
        self.limit, self.grace = _time("limit", limit), _time("grace", grace)
        self._priority = whole("Watchdog", "priority", priority, "a priority, 0 to 99", 0, 99)
        self._process: subprocess.Popen | None = None
        self._pulse, self._asked_at, self._still = 0, 0.0, 0.0

    def __enter__(self) -> Watchdog:
        with tempfile.TemporaryFile() as file:
            file.truncate(_PAGE)
            self._page = mmap.mmap(file.fileno(), _PAGE)
            self._places = memoryview(self._page).cast("Q")
            arguments = [str(file.fileno()), str(os.getpid()), repr(self.limit), repr(self.grace), str(self._priority)]
            command = [sys.executable, "-m", "qpsafe.irc5.process.watchdog", *arguments]
            self._process = subprocess.Popen(
                command, pass_fds=(file.fileno(),), stdin=subprocess.DEVNULL, start_new_session=True
            )
        end = time.monotonic() + _START
        while self._places[_PULSE] == 0:
            if not self.alive or time.monotonic() > end:
                code = self._process.poll()
                self.__exit__(None, None, None)
                raise ConfigurationError("Watchdog", "process", code, "a process that starts and watches")
            time.sleep(0.005)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process is not None
        self._places[_BEAT] = 0
        self._process.kill()  # it ignores what ends other processes
        self._process.wait(timeout=10.0)
        self._places.release()
        self._page.close()

    def beat(self) -> None:
        """Tell that the loop runs."""
        self._places[_BEAT] = time.monotonic_ns()

    @property
    def asked(self) -> float:
        """How old the heartbeat was when the watchdog asked for a stop [s]; 0 if it did not."""
        return 1e-9 * self._places[_ASKED]

    @property
    def worst(self) -> float:
        """The oldest heartbeat that the watchdog saw [s]."""
        return 1e-9 * self._places[_WORST]

    def acknowledge(self) -> None:
        """Take the request back."""
        self._places[_ASKED] = 0

    @property
    def alive(self) -> bool:
        """Whether the watchdog's process runs."""
        return self._process is not None and self._process.poll() is None

    def trouble(self, now: float) -> str:
        """Why nobody watches, empty if somebody does; `now` is a monotonic clock [s]. To be asked now and then."""
        if not self.alive:
            assert self._process is not None
            code = self._process.returncode
            how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
            return f"watchdog: its process has ended ({how})"
        pulse, elapsed, self._asked_at = self._places[_PULSE], now - self._asked_at, now
        # a loop that was itself suspended cannot tell: it counts little of that time
        self._still = self._still + min(elapsed, 0.1) if pulse == self._pulse else 0.0
        self._pulse = pulse
        return f"watchdog: its process has stood still for {_STILL:g} s" if self._still > _STILL else ""


def _time(key: str, value: float) -> float:
    expected = "more than 0, less than 3600 s"
    found = number("Watchdog", key, value, expected, above=0.0)
    if not found < 3600.0:
        raise ConfigurationError("Watchdog", key, value, expected)
    return found


def watch(descriptor: int, parent: int, limit: float, grace: float) -> int:
    """The watchdog's process: returns its exit code when the loop's process is gone or was killed.

    Args:
        descriptor: Of the file that holds the page of times.
        parent: The loop's process.
        limit: Age of its last heartbeat at which it is asked to stop [s].
        grace: Further time until it is killed [s].
    """
    page = mmap.mmap(descriptor, _PAGE)
    places = memoryview(page).cast("Q")
    while os.getppid() == parent:
        places[_PULSE] += 1
        time.sleep(min(limit / 5.0, 0.02))
        beat = places[_BEAT]
        if beat == 0:  # not begun, or over
            continue
        age = time.monotonic_ns() - beat
        if age > places[_WORST]:
            places[_WORST] = age
        if age > 1e9 * (limit + grace):
            os.kill(parent, signal.SIGKILL)
            _say(f"watchdog: no heartbeat for {1e-9 * age:.2f} s, killed the loop")
            return KILLED
        if age > 1e9 * limit and places[_ASKED] == 0:
            places[_ASKED] = age
    if places[_BEAT]:
        _say("watchdog: the loop has died; the robot stops by its own CommTimeout")
    return 0


def _say(words: str) -> None:
    """Print a line, unless that would block."""
    with suppress(OSError, ValueError):
        if select.select([], [sys.stderr], [], 0.2)[1]:
            os.write(sys.stderr.fileno(), f"{words}\n".encode())


if __name__ == "__main__":
    from qpsafe.irc5.process.requests import LEAVE

    for each in LEAVE:  # the loop's to answer, and it must be watched while it brakes; it ends with the loop
        signal.signal(each, signal.SIG_IGN)
    if int(sys.argv[5]) > 0:
        from qpsafe.irc5.process.realtime import fifo

        fifo(int(sys.argv[5]))
    sys.exit(watch(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])))
