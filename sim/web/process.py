"""The process of the simulation behind the page: 250 ticks a second, beside the process that serves the page.

Frames leave by one pipe, wishes come by another; neither keeps a tick waiting.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from qpsafe.irc5.process import realtime
from qpsafe.sim.web.channel import Inbound, Outbound, one_way
from qpsafe.sim.web.frame import Every
from qpsafe.sim.web.live import Live
from qpsafe.sim.web.setup import Setup
from qpsafe.sim.world.plant import SimulationFailedError

BEHIND = 0.1  # of the wall clock: more is not caught up with [s]
IDLE = 0.05  # between two frames while the clock stands [s]


def spawn(target: Callable[..., Any], *arguments: Any) -> BaseProcess:
    """Start a process anew, not forked, that leaves Ctrl-C to this one and ends with it."""
    process = multiprocessing.get_context("spawn").Process(target=target, args=arguments, daemon=True)
    process.start()
    return process


class LiveProcess:
    """The simulation in a process of its own.

    Args:
        setup: To begin with.
        folder: Where recordings go.

    Attributes:
        frames: Where its frames arrive.
        wishes: Where wishes are sent to it.
    """

    def __init__(self, setup: Setup, folder: Path) -> None:
        frames, told = one_way()
        asked, wishes = one_way()
        self._process = spawn(_run, setup, folder, told, asked)
        told.close()
        asked.close()
        self.frames, self.wishes = Inbound(frames), Outbound(wishes)

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.is_alive()

    @property
    def number(self) -> int:
        """Of the process."""
        return self._process.pid or 0

    def close(self) -> None:
        """End it: what is being recorded is written first."""
        self.wishes.close()
        self._process.join(10.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self.frames.close()


def _run(setup: Setup, folder: Path, told: Connection, asked: Connection) -> None:
    """Tick until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    frames, wishes = Outbound(told), Inbound(asked)
    live = Live(setup, folder)
    realtime.freeze_garbage()
    realtime.fine_timers()
    due, idle = time.perf_counter(), Every(IDLE)
    while True:
        asked_for = wishes.received()
        if wishes.closed:
            break
        if asked_for:
            run = live.run
            live.follow(asked_for[-1])
            if live.run != run:
                due = time.perf_counter()
        if live.standing:
            if idle() and (frame := live.frame()) is not None:
                frames.offer(frame)
            time.sleep(0.1 * IDLE)
            due = time.perf_counter()
            continue
        try:
            solved = live.tick()
        except SimulationFailedError as error:
            live.begin_anew(str(error))
            continue
        if live.due_frame and (frame := live.frame()) is not None:
            frames.offer(frame)
        now = time.perf_counter()
        live.times.append((solved, now - due))
        due += live.period
        if now - due > BEHIND:
            due = now
        elif due > now:
            time.sleep(due - now)
    live.close()


def niced() -> None:
    """Lower this process's priority: pages may be late, loops may not."""
    if hasattr(os, "nice"):
        os.nice(10)
