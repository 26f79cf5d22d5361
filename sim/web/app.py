"""`qpsafe web` from start to end: a simulation in one process, its page in this one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from qpsafe.danger.thresholds import robot_activation
from qpsafe.errors import QpsafeError
from qpsafe.sim.drawing.film import medium_and_high
from qpsafe.sim.web.controls import Controls, Wishes
from qpsafe.sim.web.handle import Handle
from qpsafe.sim.web.process import LiveProcess, niced
from qpsafe.sim.web.server import Page
from qpsafe.sim.web.view import PLAIN, Looks, View

if TYPE_CHECKING:
    from qpsafe.sim.web.frame import Frame
    from qpsafe.sim.web.setup import Setup

WAIT = 0.05  # for frames, before who asks to leave is listened to [s]
TITLE = "qpsafe"


class SimulationEndedError(QpsafeError):
    """The process of the simulation has ended."""


class App:
    """A simulation and its page.

    Args:
        setup: What is simulated first.
        page: Where it is served.
        folder: Where recordings go.
        looks: How the page looks at first.

    Attributes:
        live: The simulation.
        wishes: What the page asks of it.
        frame: The newest frame received; None before the first.

    Raises:
        ConfigurationError: The setup does not fit together.
    """

    def __init__(self, setup: Setup, page: Page, folder: Path, looks: Looks = PLAIN) -> None:
        scene = setup.experiment().scene  # what is wrong is said before anything starts
        self.live = LiveProcess(setup, folder)
        niced()
        server = page.server
        self.wishes, self._setup = Wishes(setup, self.live.wishes), setup
        self.frame: Frame | None = None
        self.view = View(server, scene, looks)
        tabs = self.view.tabs
        self.controls = Controls(server.gui, self.wishes, tabs)
        with tabs.add_tab("People"):
            self.handle = Handle(server, self.wishes)
        with tabs.add_tab("Show"):
            self.view.add_looks()
        self._page = page

    def serve(self, leave: Callable[[], bool] = lambda: False) -> None:
        """Show frames as they arrive until asked to leave.

        Args:
            leave: Asked repeatedly whether to stop.

        Raises:
            SimulationEndedError: Its process has died.
        """
        while not leave():
            self.turn()

    def turn(self) -> None:
        """Show the frames that have arrived meanwhile."""
        frames = self.live.frames.received(WAIT)
        if self.live.frames.closed:
            raise SimulationEndedError("the simulation has ended by itself; what it said stands above")
        self.wishes.remind()
        for frame in frames:
            self.view.take(frame)
        if not frames:
            return
        frame = self.frame = frames[-1]
        setup = frame.setup
        assert setup is not None
        if setup.scenery != self._setup.scenery:
            experiment = setup.experiment()
            self.view.change(experiment.scene)
            self.controls.fit(setup)
        if setup != self._setup:
            robot = self.view.robot
            self.view.thresholds = medium_and_high(setup.activation(robot) or robot_activation(robot))
            self._setup = setup
        self.controls.follow(frame)
        if self._page.watched:
            self.view.show(frame, asked=self.wishes.now.number)

    def close(self) -> None:
        """End the simulation."""
        self.live.close()
