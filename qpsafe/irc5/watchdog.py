"""A watchdog in a process of its own: when the loop's heartbeat stops, it asks for a stop, then insists.

Both share a page of memory. The loop writes the time there at every pass. If the last heartbeat is older than `limit`,
the watchdog writes how old it is: asked. A loop that still runs, late, reads that at its next pass and brakes the
robot to rest. If there is no heartbeat for `grace` more, nobody will read: the watchdog kills the loop's process, so
that the robot hears nothing and stops by its own CommTimeout, instead of hearing something stale later.

It starts with the first heartbeat and ends with the loop's process. It is a program beside a program, no safety device.
"""

from __future__ import annotations

import mmap
import os
import signal
import subprocess
import sys
import tempfile
import time
from types import TracebackType

from qpsafe.errors import ConfigurationError

_BEAT, _ASKED, _WORST = range(3)  # places in the page, 8 bytes each: times and ages [ns]
_PAGE = 4096
KILLED = 3  # exit code of the watchdog's process after it had to insist


class Watchdog:
    """The loop's side; use as a context.

    Args:
        limit: Age of the last heartbeat at which a stop is asked for [s].
        grace: Further time until the process is killed [s].
        priority: Real-time priority to try for the watchdog's process; 0 for none.

    Raises:
        ConfigurationError: A time is not above 0.
    """

    def __init__(self, limit: float = 0.1, grace: float = 1.0, priority: int = 0) -> None:
        for name, value in (("limit", limit), ("grace", grace)):
            if not 0.0 < value < 3600.0:
                raise ConfigurationError("Watchdog", name, value, "more than 0, less than 3600 s")
        self.limit, self.grace, self._priority = limit, grace, priority
        self._process: subprocess.Popen | None = None

    def __enter__(self) -> Watchdog:
        with tempfile.TemporaryFile() as file:
            file.truncate(_PAGE)
            self._page = mmap.mmap(file.fileno(), _PAGE)
            self._places = memoryview(self._page).cast("Q")
            arguments = [str(file.fileno()), str(os.getpid()), repr(self.limit), repr(self.grace), str(self._priority)]
            command = [sys.executable, "-m", "qpsafe.irc5.watchdog", *arguments]
            self._process = subprocess.Popen(command, pass_fds=(file.fileno(),), stdin=subprocess.DEVNULL)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process is not None
        self._places[_BEAT] = 0
        self._process.terminate()
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


def watch(descriptor: int, parent: int, limit: float, grace: float) -> int:
    """The watchdog's process: returns its exit code when the loop's process is gone or was killed."""
    page = mmap.mmap(descriptor, _PAGE)
    places = memoryview(page).cast("Q")
    while os.getppid() == parent:
        time.sleep(min(limit / 5.0, 0.02))
        beat = places[_BEAT]
        if beat == 0:  # not begun, or over
            continue
        age = time.monotonic_ns() - beat
        if age > places[_WORST]:
            places[_WORST] = age
        if age > 1e9 * (limit + grace):
            print(f"watchdog: no heartbeat for {1e-9 * age:.2f} s, killing the loop", file=sys.stderr, flush=True)
            os.kill(parent, signal.SIGKILL)
            return KILLED
        if age > 1e9 * limit and places[_ASKED] == 0:
            places[_ASKED] = age
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the loop's to answer
    if int(sys.argv[5]) > 0:
        from qpsafe.irc5.realtime import fifo

        fifo(int(sys.argv[5]))
    sys.exit(watch(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])))
