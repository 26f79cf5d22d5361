"""What `qpsafe stream` says while it runs, a line a cause; through an outlet: the loop never waits for a screen."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from qpsafe.irc5.supervisor import State
from qpsafe.irc5.transport.inbox import REFUSALS

if TYPE_CHECKING:
    from qpsafe.irc5.distances import SensorInput
    from qpsafe.irc5.loop import StreamLoop
    from qpsafe.irc5.process.outlet import Outlet
    from qpsafe.irc5.run import StreamRun
    from qpsafe.irc5.streamer import EgmStreamer
    from qpsafe.irc5.supervisor import Transition

PERIOD = 0.004  # an answer that takes longer comes after the robot's next packet [s]
PAUSE = 5  # seconds between two lines about what is waited for
LONGEST = 400  # characters of a line


class Speaker:
    """Transitions as they come; each second a status line, or what is waited for and why it does not count.

    Args:
        outlet: Where it is said.
        streamer: The robot's end.
        inlet: Where distances arrive, None without.
        status: Whether to keep a status line, for a person at a screen.
        day: Tells the time of the day in words.
    """

    def __init__(
        self,
        outlet: Outlet,
        streamer: EgmStreamer,
        inlet: SensorInput | None,
        status: bool,
        day: Callable[[], str] = lambda: time.strftime("%H:%M:%S"),
    ) -> None:
        self._outlet, self._streamer, self._inlet = outlet, streamer, inlet
        self._status, self._day = status, day
        self._pause, self._waiting = 0, ""

    def say(self, transition: Transition) -> None:
        """One line for a transition, with the time of the day."""
        self._line(str(transition)[13:])

    def second(self, run: StreamRun, loop: StreamLoop) -> None:
        """To be called once a second."""
        waiting = self._waited(run, loop)
        self._pause -= 1
        if waiting and waiting != self._waiting and self._pause < 0:
            self._line(waiting)
            self._waiting, self._pause = waiting, PAUSE - 1
        if self._status and run.answered:
            late = run.latency.above(PERIOD)
            where = f"\r{loop.supervisor.state:9s} {run.duration:8.0f} s  {run.latency.count} answers, {late} late "
            self._outlet.write(where, needed=False)

    def _waited(self, run: StreamRun, loop: StreamLoop) -> str:
        """What is waited for, and what came instead; empty if nothing is."""
        host, port = self._streamer.address
        if not run.answered or run.silent > 1.0:
            came = refused(self._streamer.counts, self._streamer.session.inbox.refusal)
            if came:
                return f"waiting for the robot at {host}:{port}: {came}"
            return f"waiting for the robot at {host}:{port}: nothing has come" if run.silent >= 10.0 else ""
        if self._inlet is not None and loop.tick is None and loop.supervisor.state is State.SEEDING:
            host, port = self._inlet.address
            counts = self._inlet.counts
            came = refused({"rejected": counts.rejected, "strangers": counts.strangers}, self._inlet.refusal)
            return f"the robot is held, waiting for distances at {host}:{port}: {came or 'nothing has come'}"
        return ""

    def _line(self, words: str) -> None:
        plain = "".join(letter if letter.isprintable() else " " for letter in words)
        line = " ".join(plain.split())
        line = line if len(line) <= LONGEST else line[: LONGEST - 3] + "..."
        self._outlet.write(f"{chr(13) if self._status else ''}{self._day()}  {line}\n")


def refused(counts: Mapping[str, int], last: str) -> str:
    """How many datagrams were refused, why, and the last refusal, in words; empty if none was."""
    found = {name: counts[name] for name in (*REFUSALS, "rejected", "strangers") if counts.get(name)}
    if not found:
        return ""
    why = ", ".join(f"{name} {count}" for name, count in found.items())
    total = sum(found.values())
    return f"{total} datagram{'s' * (total != 1)} refused ({why}); the last: {last}"
