"""What is printed or logged beside a loop that must never wait for it: a thread of its own writes, the loop hands over.

A full pipe, a terminal that was halted, a slow or a full disk hold up that thread alone. What cannot be written is
counted, and told to whoever asks for `trouble`.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import Any

from qpsafe.text.given import number, of_kind, to_call

#: More bytes than this never wait.
MOST = 1 << 22


class Outlet:
    """A file that never keeps its writer waiting; text files of rich's `Console` and logs both use it.

    Args:
        write: Writes bytes and returns how many; may block, and may raise OSError.
        name: In messages.
        due: How long something that must be told may wait to be written [s].

    Attributes:
        failure: Why nothing can be written any more, empty while it can.
        lost: How many pieces were not written as a whole.

    Raises:
        ConfigurationError: `write` cannot be called, the name is no text, or `due` no finite number > 0.
    """

    encoding = "utf-8"

    def __init__(self, write: Callable[[Any], int], name: str, due: float = 1.0) -> None:
        to_call("Outlet", "write", write)
        of_kind("Outlet", "name", name, str)
        self._put, self.name = write, name
        self.due = number("Outlet", "due", due, "a finite time > 0 [s]", above=0.0)
        self.failure, self.lost = "", 0
        self._tty = False
        self._queue: SimpleQueue[tuple[bytes, bool] | None] = SimpleQueue()
        # each of these is written by one thread only: the first two here, the others by the thread
        self._given = self._needed = 0
        self._taken = self._told = 0
        self._waited, self._seen, self._since = False, 0, 0.0  # when it was last asked
        self._thread = threading.Thread(target=self._run, name=f"outlet of {name}", daemon=True)
        self._thread.start()

    @classmethod
    def over(cls, stream: Any, name: str) -> Outlet:
        """For an open file; past its buffer, where it has a descriptor."""
        if stream is None:  # closed by whoever started this program
            return cls(len, name)
        try:
            stream.flush()
            write: Callable[[Any], int] = partial(os.write, stream.fileno())
        except (AttributeError, OSError, ValueError):
            write = partial(_as_text, stream)
        found = cls(write, name)
        found._tty = bool(getattr(stream, "isatty", bool)())
        return found

    @property
    def busy(self) -> bool:
        """Whether the thread is still there."""
        return self._thread.is_alive()

    @property
    def thread(self) -> int:
        """The thread's number for the scheduler, 0 if it has none."""
        return self._thread.native_id or 0

    def write(self, data: str | bytes, needed: bool = True) -> int:
        """Hand over; never blocks, never raises.

        Args:
            data: Text or bytes.
            needed: Whether somebody must know if it cannot be written. What is not needed is dropped if anything waits.
        """
        piece = data.encode(self.encoding, "replace") if isinstance(data, str) else bytes(data)
        waiting = self._given - self._taken
        if waiting + len(piece) > MOST or self.failure or (waiting and not needed):
            self.lost += needed
            return len(data)
        self._given += len(piece)
        self._needed += needed
        self._queue.put((piece, needed))
        return len(data)

    def flush(self) -> None:
        """Nothing: the thread does not keep anything back."""

    def isatty(self) -> bool:
        """Whether a person reads it."""
        return self._tty

    def trouble(self, now: float) -> str:
        """Why what must be told is not, empty if it is; `now` is a monotonic clock [s]. To be asked now and then."""
        if self.failure:
            return f"{self.name}: {self.failure}"
        if self.lost:
            return f"{self.name}: too slow, {self.lost} pieces were lost"
        waits = self._needed != self._told
        if not waits or not self._waited or self._seen != self._taken:
            self._seen, self._since = self._taken, now
        self._waited = waits
        if now - self._since > self.due:
            return f"{self.name}: blocked for {self.due:g} s"
        return ""

    def close(self, patience: float = 3.0) -> bool:
        """Wait until all is written, but no longer than `patience` [s] without progress; whether it was."""
        self._queue.put(None)
        taken, end = self._taken, time.monotonic() + patience
        while self._thread.is_alive() and time.monotonic() < end:
            self._thread.join(0.02)
            if self._taken != taken:
                taken, end = self._taken, time.monotonic() + patience
        self.lost += self._needed - self._told
        self._needed = self._told
        return not (self.failure or self.lost)

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            piece, needed = memoryview(item[0]), item[1]
            while piece:
                count = 0 if self.failure else self._write(piece)
                if self.failure:
                    self.lost += needed
                    self._taken += len(piece)
                    break
                self._taken += count
                piece = piece[count:]
            self._told += needed

    def _write(self, piece: memoryview) -> int:
        try:
            return self._put(piece)
        except BlockingIOError:  # somebody else has made it a descriptor that does not block
            time.sleep(0.01)
        except (OSError, ValueError) as error:  # a full disk, a closed pipe, a closed file
            self.failure = str(error)
        return 0


def _as_text(stream: Any, piece: memoryview) -> int:
    stream.write(bytes(piece).decode("utf-8", "replace"))
    stream.flush()
    return len(piece)
