"""A page beside a loop that must not be disturbed: what the loop writes into a pipe is shown, and nothing comes back.

The loop holds the end of a pipe that can only be written, the page's process the one that can only be read. What a
browser sends ends in that process, which has no other way to the loop.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.web.channel import Inbound, Outbound, one_way
from qpsafe.sim.web.frame import EVERY, NO_POSES, Frame, Worst
from qpsafe.sim.web.process import niced, spawn
from qpsafe.sim.web.server import check_port, need_viser

if TYPE_CHECKING:
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

WAIT = 0.1  # for frames [s]


class Watch:
    """The loop's end: a page that is told of ticks.

    Args:
        robot: As for `load_robot`.
        experiment: Whose cell is drawn, by name; None for a bare one.
        cell: File of the furniture that is drawn instead; None for none.
        host: To serve the page at.
        port: Likewise.
        token: That the page asks for; empty for none.

    Attributes:
        outbound: Where frames go.
        host, port: Where the page is served.

    Raises:
        ConfigurationError: The port is taken.
        MissingExtraError: Viser is not installed.
    """

    def __init__(
        self, robot: str, experiment: str | None, cell: Path | None, host: str, port: int, token: str = ""
    ) -> None:
        need_viser()
        check_port(host, port)
        reading, writing = one_way()
        self._process = spawn(_serve, reading, (robot, experiment, cell), host, port, token)
        reading.close()
        self.host, self.port = host, port
        self.outbound = Outbound(writing)
        self._worst, self._ticks, self._seq = Worst(), 0, -1
        self._times: list[tuple[float, float]] = []

    @property
    def number(self) -> int:
        """Of the page's process."""
        return self._process.pid or 0

    def observe(self, tick: Tick | None, q: Array | None, state: str, response: float) -> None:
        """Report a tick; never waits, and never learns whether anybody looks.

        Args:
            tick: The newest; None before the first.
            q: Measured joint position (n,) [rad].
            state: Of the loop, in a word.
            response: How long the answer has taken, since the packet arrived [s].
        """
        if tick is None or q is None:
            return
        self._ticks += 1
        if tick.reference.seq != self._seq:
            self._seq = tick.reference.seq
            self._worst.add(tick)
            self._times.append((tick.solve_time, response))
        if self._ticks % EVERY:
            return
        row = self._worst.take()
        if row is not None:
            self.outbound.offer(Frame(0, tick, q, NO_POSES, row, np.array(self._times), state=state))
            self._times.clear()

    def wait(self, patience: float = 60.0) -> bool:
        """Until the page answers, or its process has ended; before the loop begins. Returns whether it answers.

        Args:
            patience: At most so long [s].
        """
        end = time.monotonic() + patience
        while time.monotonic() < end and self._process.is_alive():
            with suppress(OSError), socket.create_connection((self.host, self.port), 1.0):
                return True
            time.sleep(0.1)
        return False

    def close(self) -> None:
        """Say that no more frames come; the page's process then ends."""
        self.outbound.close()
        self._process.join(1.0)
        if self._process.is_alive():
            self._process.kill()


def _serve(reading: Connection, shown: tuple[str, str | None, Path | None], host: str, port: int, token: str) -> None:
    """Show frames until nothing more comes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    niced()
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  for all there is; the loop's has its own words
    inbound = Inbound(reading)
    from qpsafe.sim.web.server import Page
    from qpsafe.sim.web.view import View

    page = Page(host, port, "qpsafe stream: to be looked at only", token)
    with suppress(KeyboardInterrupt):
        view = View(page.server, scene_of(*shown), distance=False)
        with view.tabs.add_tab("Show"):
            view.add_looks()
        show_all(inbound, view, page)
    page.close()


def show_all(inbound: Inbound, view: Any, page: Any) -> None:
    """Show frames until no more arrive; whoever opens the page later sees the newest one, however old it is.

    Args:
        inbound: Where frames arrive.
        view: What shows them.
        page: Whose.
    """
    newest: Frame | None = None  # that has not been shown as a whole
    while not inbound.closed:
        frames = inbound.received(WAIT)
        for frame in frames:
            view.take(frame)
            newest = frame
        if newest is not None and page.watched:
            pause = not frames  # nothing hurries: all of it is shown, and once
            view.show(newest, at_once=pause)
            newest = None if pause else newest


def scene_of(robot: str, experiment: str | None = None, cell: Path | None = None) -> Any:
    """The cell that is drawn: an experiment's, or one with a robot and known furniture only.

    Args:
        robot: As for `load_robot`.
        experiment: Its name, None for none.
        cell: File of the furniture, None for none; an experiment has its own.

    Raises:
        ConfigurationError: As `load_robot` and `load_cell`.
    """
    from qpsafe.robot.loader import load_robot
    from qpsafe.sensing.cell_file import load_cell
    from qpsafe.sim.experiments.by_name import experiment_loop
    from qpsafe.sim.experiments.fixed.stage import robot_stage
    from qpsafe.sim.world.furniture import add_obstacles
    from qpsafe.sim.world.scene import build_scene

    found = load_robot(robot)
    if experiment is not None:
        return experiment_loop(experiment, found)[0].scene
    known = () if cell is None else load_cell(cell)
    return build_scene(
        found, pedestal=robot_stage(found).pedestal, people=(), furnish=partial(add_obstacles, obstacles=known)
    )
