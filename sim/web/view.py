"""A page that shows frames, wherever they come from: a simulation, a stream, a file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.thresholds import robot_activation
from qpsafe.sensing.skin.spots import load_spots
from qpsafe.sim.drawing.film import medium_and_high
from qpsafe.sim.web.bodies import Bodies
from qpsafe.sim.web.danger import Danger
from qpsafe.sim.web.figures import NUMBERS, PLOTS, WORDS, Numbers, Plots, Words
from qpsafe.sim.web.frame import Every

if TYPE_CHECKING:
    from qpsafe.danger.activation import Activation
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.web.frame import Frame
    from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]

EYE, LOOK = (3.3, -2.7, 1.8), (0.6, 0.15, 0.15)  # where the camera stands, and what it looks at [m]
ANGLE = 45.0  # of view, vertical [deg]
DRAWN = 1.0 / 30.0  # least time between two pictures [s]


class Looks(NamedTuple):
    """How a page looks at first; a machine without a graphics card is slow at shadows."""

    dark: bool = False
    shadows: bool = True


PLAIN = Looks()


class View:
    """Scene, plots, numbers and words of a page.

    Args:
        server: Viser's.
        scene: What is drawn first.
        looks: Dark or light, with shadows or without.
        distance: Whether the true distance to people is known.
    """

    def __init__(self, server: Any, scene: Scene, looks: Looks = PLAIN, distance: bool = True) -> None:
        self._server, self.dark, self.shadows = server, looks.dark, looks.shadows
        self._theme()
        server.scene.configure_default_lights(cast_shadow=looks.shadows)
        server.initial_camera.position, server.initial_camera.look_at = EYE, LOOK
        server.initial_camera.fov = np.radians(ANGLE)
        self.numbers = Numbers(server.gui)
        self.tabs = server.gui.add_tab_group()
        panel = server.gui.add_panel()
        with panel.add_tab("Plots"):
            self.plots = Plots(server.gui, distance)
        with panel.add_tab("In words"):
            self.words = Words(server.gui)
        panel.dock_left()
        panel.set_width(320)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(350)
        self._drawn, self._told, self._plotted, self._said = Every(DRAWN), Every(NUMBERS), Every(PLOTS), Every(WORDS)
        self.change(scene)

    def add_looks(self) -> None:
        """Switches of what is drawn, into the tab whose context this is in."""
        server, gui, danger = self._server, self._server.gui, self._danger
        for key, label in (
            ("rays", "sensors' rays"),
            ("points", "detected points"),
            ("vectors", "danger vectors"),
            ("colours", "links coloured by danger"),
        ):
            box = gui.add_checkbox(label, getattr(danger, key))
            box.on_update(lambda event, key=key: setattr(self._danger, key, bool(event.target.value)))
        shadows = gui.add_checkbox("shadows", self.shadows)
        shadows.on_update(lambda event: server.scene.configure_default_lights(cast_shadow=bool(event.target.value)))
        dark = gui.add_checkbox("dark", self.dark)
        dark.on_update(lambda event: self._darken(bool(event.target.value)))

    def change(self, scene: Scene, activation: Activation | None = None) -> None:
        """Draw another scene from now on.

        Args:
            scene: The scene.
            activation: Its thresholds; the robot's by default.
        """
        server, self._scene, self._data = self._server, scene, scene.make_data()
        looks = getattr(self, "_danger", None)
        with server.atomic():
            for name in ("/cell", "/floor", "/danger"):
                server.scene.remove_by_name(name)
            self._bodies = Bodies(server, scene, self.dark)
            robot = scene.robot
            thresholds = medium_and_high(activation or robot_activation(robot))
            spots = None if robot.spots_path is None else load_spots(robot)
            self._danger = Danger(server, scene, spots, self._bodies, thresholds)
        for key in ("rays", "points", "vectors", "colours") if looks is not None else ():
            setattr(self._danger, key, getattr(looks, key))
        self.plots.clear()

    @property
    def robot(self) -> Robot:
        """The robot that is drawn."""
        return self._scene.robot

    @property
    def thresholds(self) -> tuple[float, float]:
        """From where danger is medium, and high."""
        return self._danger.thresholds

    @thresholds.setter
    def thresholds(self, thresholds: tuple[float, float]) -> None:
        self._danger.thresholds = thresholds

    def take(self, frame: Frame) -> None:
        """Remember a frame for plots and numbers, even if it is never drawn."""
        self.plots.add(frame.row)
        self.numbers.take(frame)

    def show(self, frame: Frame, at_once: bool = False, asked: int = 0) -> None:
        """Draw those parts of a frame whose time has come.

        Args:
            frame: The frame.
            at_once: Draw all of it now.
            asked: Number of the newest wish.
        """
        if self._drawn() or at_once:
            data, scene = self._data, self._scene
            if frame.qpos is not None:
                data.qpos[:] = frame.qpos
            data.qpos[scene.q_addresses] = frame.q
            if len(frame.people) == scene.model.nmocap:
                data.mocap_pos[:], data.mocap_quat[:] = frame.people[:, :3], frame.people[:, 3:]
            mujoco.mj_kinematics(scene.model, data)
            with self._server.atomic():
                self._bodies.show(data)
                self._danger.show(frame.tick, frame.q)
        if self._told() or at_once:
            self.numbers.show(frame, self.thresholds, asked)
        if self._plotted() or at_once:
            self.plots.show(self.thresholds)
        if self._said() or at_once:
            self.words.show(frame)

    def _darken(self, dark: bool) -> None:
        self.dark = dark
        self._theme()
        self._bodies.darken(dark)

    def _theme(self) -> None:
        self._server.gui.configure_theme(
            dark_mode=self.dark, show_logo=False, show_share_button=False, brand_color=(47, 127, 209)
        )
