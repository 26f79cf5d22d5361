"""What signals ask of the loop: whatever would end or suspend the process brakes the robot first, each time."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGTTIN", "SIGBREAK", "SIGALRM", "SIGVTALRM", "SIGPROF")
_RARE = ("SIGUSR2", "SIGXCPU", "SIGIO", "SIGPWR", "SIGSTKFLT")
_REAL_TIME = range(signal.SIGRTMIN, signal.SIGRTMAX + 1) if hasattr(signal, "SIGRTMIN") else ()

#: Signals that end or suspend a process by default and can be caught, but for crashes of the program itself.
LEAVE: tuple[int, ...] = (
    *(getattr(signal, name) for name in (*_NAMES, *_RARE) if hasattr(signal, name)),
    *_REAL_TIME,
)


class Requests:
    """What is asked of the loop from outside.

    Attributes:
        leave: The first request to leave, in words; empty without one.
        acknowledge: SIGUSR1 has come since it was last looked at.
        driving: Whether a robot may be moving, or a report is being written: a further request to leave changes
            nothing then. Before, while the program is loaded, it ends the program.
    """

    def __init__(self) -> None:
        self.leave = ""
        self.acknowledge = False
        self.driving = False

    @contextmanager
    def heard(self) -> Iterator[Requests]:
        """Listen to signals meanwhile. SIGHUP stays ignored where it was when the program started (nohup)."""
        before: dict[int, Any] = {}

        def leave(number: int, frame: FrameType | None) -> None:
            if self.leave and not self.driving:
                old = before[number]
                (old if callable(old) else signal.default_int_handler)(number, frame)
            self.leave = self.leave or _word(number)

        def acknowledge(number: int, frame: FrameType | None) -> None:
            self.acknowledge = True

        handlers: dict[int, Any] = dict.fromkeys(LEAVE, leave)
        if hasattr(signal, "SIGUSR1"):
            handlers[signal.SIGUSR1] = acknowledge
        if hasattr(signal, "SIGTTOU"):
            handlers[signal.SIGTTOU] = signal.SIG_IGN  # words from the background must not suspend the loop
        for number, handler in handlers.items():
            if number == getattr(signal, "SIGHUP", None) and signal.getsignal(number) is signal.SIG_IGN:
                continue
            before[number] = signal.signal(number, handler)
        try:
            yield self
        finally:
            for number, old in before.items():
                signal.signal(number, signal.SIG_DFL if old is None else old)


def _word(number: int) -> str:
    if number == signal.SIGINT:
        return "Ctrl-C"
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time one between the first and the last
        return f"signal {number}"
