"""A recorded run on a page, with a slider for the time."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.sim.recording.run_file import FPS, RunFile
from qpsafe.sim.replay.stage import Stage
from qpsafe.sim.web.figures import WINDOW
from qpsafe.sim.web.frame import Every, Frame, Worst
from qpsafe.sim.web.view import View
from qpsafe.sim.world.distance import TrueDistances

if TYPE_CHECKING:
    from qpsafe.sim.replay.settings import Experiment
    from qpsafe.sim.web.server import Page
    from qpsafe.tick import Tick

PACES = (1.0, 0.5, 0.25, 0.1, 2.0, 5.0)
IDLE = 0.02  # between two looks at the clock [s]
SLIDER = 0.15  # least time between two moves of the slider by itself [s]


class Kept:
    """Frames of a run, kept while it is replayed: pass `watch` as the replay's watcher.

    Args:
        run: The run.
        experiment: Of the run.

    Attributes:
        frames: One for each recorded state.

    Raises:
        RunFileError: The run holds no states.
    """

    def __init__(self, run: RunFile, experiment: Experiment) -> None:
        self._stage, self._gaps = Stage(run, experiment), TrueDistances(experiment.scene)
        self._worst, self.frames = Worst(), list[Frame]()
        self.scene, self.activation = experiment.scene, experiment.activation

    def watch(self, k: int, tick: Tick) -> None:
        """Keep a tick.

        Args:
            k: Its number.
            tick: The tick.
        """
        if not self._stage.show(k):
            self._worst.add(tick)
            return
        data = self._stage.data
        self._worst.add(tick, min(gap.distance for gap in self._gaps.measure(data)))
        row = self._worst.take()
        assert row is not None
        people = np.hstack((data.mocap_pos, data.mocap_quat))
        self.frames.append(Frame(0, tick, self._stage.q.copy(), people, row, state="recorded", qpos=data.qpos.copy()))


class Player:
    """Plays kept frames.

    Args:
        kept: The frames.
        page: Where they are shown.

    Attributes:
        view: What shows them.
        position: Number of the frame that is shown.
        playing: Whether time goes on.
    """

    def __init__(self, kept: Kept, page: Page) -> None:
        self._frames, self._page = kept.frames, page
        self.position, self.playing, self._pace = 0, True, 1.0
        self._lock = Lock()
        server = page.server
        self.view = View(server, kept.scene)
        self.view.change(kept.scene, kept.activation)
        with self.view.tabs.add_tab("Time"):
            last = self._frames[-1].tick.reference.time
            self._slider = server.gui.add_slider("time [s]", 0.0, round(last, 2), 1.0 / FPS, 0.0)
            self._slider.on_update(self._sought)
            paces = {f"{pace:g} x": pace for pace in PACES}
            choice = server.gui.add_dropdown("speed", tuple(paces))
            choice.on_update(lambda event: setattr(self, "_pace", paces[event.target.value]))
            button = server.gui.add_button("play or pause")
            button.on_click(lambda _: setattr(self, "playing", not self.playing))
        with self.view.tabs.add_tab("Show"):
            self.view.add_looks()
        self._moved, self._shown = Every(SLIDER), -1

    def _sought(self, event: Any) -> None:
        if event.client is not None:
            self.playing = False
            self.seek(float(event.target.value))

    def seek(self, at: float) -> None:
        """Go to the recorded frame nearest to a time [s]."""
        with self._lock:  # the page's thread seeks while another plays
            self.position = min(max(round(at * FPS), 0), len(self._frames) - 1)

    def serve(self, leave: Callable[[], bool]) -> None:
        """Play until asked to leave."""
        at, clock = 0.0, time.perf_counter()
        while not leave():
            now = time.perf_counter()
            with self._lock:
                if self.playing and self._page.watched:
                    at += (now - clock) * self._pace
                    if at * FPS >= len(self._frames):
                        at = 0.0
                    self.position = min(int(at * FPS), len(self._frames) - 1)
                else:
                    at = self.position / FPS
            clock = now
            self.show()
            time.sleep(IDLE)

    def show(self) -> None:
        """Show the frame at the present time, if it is not shown already."""
        if self.position == self._shown:
            return
        self._shown = position = self.position
        rows = [frame.row for frame in self._frames[max(0, position - round(WINDOW * FPS)) : position + 1]]
        self.view.plots.put(rows)
        self.view.show(self._frames[position], at_once=not self.playing)
        with self._lock:
            if self.playing and self._moved():
                self._slider.value = round(position / FPS, 2)
