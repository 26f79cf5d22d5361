"""The simulation behind the page: one tick after another, the page's wishes followed, frames made of it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qpsafe.errors import ConfigurationError, QpsafeError, in_words
from qpsafe.sim.experiments.fixed.experiment import Notes
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop, Moment
from qpsafe.sim.recording.run_file import StateRecorder, write_run
from qpsafe.sim.replay.settings import settings_of
from qpsafe.sim.web.frame import EVERY, Frame, Row, Worst
from qpsafe.sim.web.people import Crowd, Drag
from qpsafe.sim.web.setup import DT, LONGEST, Setup
from qpsafe.sim.world.distance import TrueDistances

RUNNING, PAUSED, RECORDING = "running", "paused", "recording"
PACES = (1.0, 0.5, 0.25, 0.1)  # of the simulation's clock


class Wish(NamedTuple):
    """All that the page asks for: the newest one counts, whatever became of earlier ones.

    Attributes:
        number: Each has a larger one.
        setup: What is simulated.
        drag: Where the mouse wants somebody.
        paused: Whether the clock stands.
        pace: Of the simulation's clock, one of `PACES`.
        steps: How many single ticks have been asked for so far.
        restarts: How often the run was to begin anew.
        record: Whether the run is to be recorded.
    """

    number: int = 0
    setup: Setup = Setup()
    drag: Drag = Drag()
    paused: bool = False
    pace: float = 1.0
    steps: int = 0
    restarts: int = 0
    record: bool = False


class Live:
    """A run that follows wishes; a wish for another run begins it anew.

    Args:
        setup: To begin with.
        folder: Where recordings go.

    Attributes:
        wish: The one that is followed.
        run: Number of the run.
        note: What was wrong with the newest wish, in words.
        due: Ticks to be taken although the clock stands.
        times: Of the ticks since the last frame, see `Frame`.

    Raises:
        ConfigurationError: Names what does not fit.
    """

    def __init__(self, setup: Setup, folder: Path) -> None:
        self.wish, self.run, self.note, self.due = Wish(setup=setup), 0, "", 0
        self.folder, self._since = folder, time.monotonic()
        self._notes: tuple[Notes, StateRecorder] | None = None
        self.times: list[tuple[float, float]] = []
        self._begin(setup)

    def _begin(self, setup: Setup) -> None:
        """A run from its start."""
        experiment = setup.experiment()
        loop, gaps = FixedLoop(experiment), TrueDistances(experiment.scene)
        assert experiment.story is not None
        crowd = Crowd(experiment.story, DT)
        loop.poses = crowd
        self.experiment, self.loop, self._gaps, self.crowd = experiment, loop, gaps, crowd
        self._worst, self._row = Worst(), Row(*(float("nan"),) * 7)
        self._moment: Moment | None = None
        self.run += 1
        self._notes = None

    def follow(self, wish: Wish) -> None:
        """Follow a wish; what cannot be done is said in `note`, and the rest of it is done."""
        before, self.note = self.wish, ""
        known = before.setup
        try:
            again = wish.restarts != before.restarts or (wish.record and not before.record)
            if again or not wish.setup.same_run(known):
                self._save()
                self._begin(wish.setup)
                self.due = 1  # that it may be seen
            elif wish.setup != known:
                if self._notes is not None:
                    raise ConfigurationError("qpsafe web", "setup", "changed", "one setup all through a recording")
                wish.setup.apply(self.loop.controller, self.experiment)
            known = wish.setup
            if wish.record and not before.record:
                self._notes = Notes(self.experiment, self.loop), StateRecorder(DT)
            elif before.record and not wish.record:
                self._save()
            if not 0.0 < wish.pace <= 1.0:
                raise ConfigurationError("qpsafe web", "pace", wish.pace, "above 0, at most 1")
        except Exception as error:  # whatever a browser may send, the loop goes on
            self.note = in_words(error, kind=not isinstance(error, QpsafeError))
            wish = wish._replace(setup=known, pace=before.pace, record=self._notes is not None)
        try:
            self.crowd.want(wish.drag)
        except Exception as error:
            self.note = in_words(error, kind=not isinstance(error, QpsafeError))
            wish = wish._replace(drag=before.drag)
        self.due = max(self.due + wish.steps - before.steps, 0) if wish.paused else 0
        self.wish, self._since = wish, 0.0

    @property
    def standing(self) -> bool:
        """Whether no tick is to be taken now."""
        return self.wish.paused and self.due <= 0

    @property
    def period(self) -> float:
        """From tick to tick, on the wall clock [s]."""
        return DT / self.wish.pace

    def begin_anew(self, why: str) -> None:
        """Put the robot back to where it started.

        Args:
            why: Said in `note`.
        """
        self._notes = None
        self._begin(self.wish.setup)
        self.note = why

    def tick(self) -> float:
        """Sense, decide, measure, move; returns the controller's time [s].

        Raises:
            SimulationFailedError: MuJoCo raised a warning.
        """
        moment = self.loop.step()
        self._moment = moment
        if not self._since:
            self._since = time.monotonic()
        gaps = self._gaps.measure(self.loop.plant.data)
        self._worst.add(moment.tick, min(gap.distance for gap in gaps))
        if self._notes is not None:
            notes, states = self._notes
            notes.add(moment, gaps)
            states.observe(moment.tick, self.loop.scene, self.loop.plant)
            if moment.tick.reference.time >= LONGEST:
                self._save()
                self.note += f"; that was {LONGEST:g} s, the longest there is"
        self.loop.advance()
        self.due -= self.due > 0
        return moment.tick.solve_time

    def frame(self) -> Frame | None:
        """What the page is told now; None before the first tick."""
        if self._moment is None:
            return None
        moment, data = self._moment, self.loop.plant.data
        row = self._row = self._worst.take() or self._row
        times = np.array(self.times).reshape(-1, 2)
        self.times.clear()
        state = PAUSED if self.wish.paused else RECORDING if self._notes is not None else RUNNING
        people = np.hstack((data.mocap_pos, data.mocap_quat))
        said, wish = self.note, self.wish
        return Frame(
            self.run, moment.tick, moment.q, people, row, times, self.period, state, said, wish.number, self._since,
            wish.setup,
        )  # fmt: skip

    @property
    def due_frame(self) -> bool:
        """Whether the page is to be told after this tick."""
        return self.loop.k % EVERY == 0 or self.wish.paused

    def close(self) -> None:
        """Write what is being recorded."""
        self._save()

    def _save(self) -> None:
        """End a recording, and write it."""
        if self._notes is None:
            return
        (notes, states), self._notes = self._notes, None
        if self._moment is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / time.strftime("run-%Y%m%d-%H%M%S.npz")
        log = notes.finish()
        write_run(path, log, settings_of(self.experiment), self.experiment.robot, states)
        self.note = f"{log.time[-1]:.1f} s written to {path}"
