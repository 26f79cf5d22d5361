"""Watches a run: draws the danger into the scene, as a video or in MuJoCo's viewer."""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.errors import QpsafeError
from qpsafe.sim.drawing.caption import Caption
from qpsafe.sim.drawing.overlay import DangerOverlay
from qpsafe.sim.drawing.render import VideoWriter
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.robot_spec import shown_groups
from qpsafe.sim.world.scene import Scene
from qpsafe.tick import Tick

if TYPE_CHECKING:
    from qpsafe.danger.activation import Activation
    from qpsafe.sensing.skin.spots import SpotArray


class ViewerUnavailableError(QpsafeError, RuntimeError):
    """MuJoCo's viewer cannot open a window here."""


def overlay(tick: Tick, plant: Plant, spots: SpotArray, thresholds: tuple[float, float]) -> DangerOverlay:
    """What to draw for one tick: all rays, the points that count and their danger vectors.

    Args:
        tick: The tick.
        plant: The robot and its surroundings, as the tick found them.
        spots: The distance sensors.
        thresholds: From where danger is medium, and high.
    """
    origins, directions = spots.rays(plant.scene.robot.at(plant.q))
    ends = origins + spots.range_max[:, None] * directions
    # a ray hits where it passes through a detected point
    hits = np.zeros(len(spots), dtype=bool)
    for point in tick.points:
        along = np.sum((point - origins) * directions, axis=1)
        apart = np.linalg.norm(point - origins - along[:, None] * directions, axis=1)
        here = (apart < 5e-3) & (along > 0.0) & (along <= spots.range_max + 5e-3)
        hits |= here
        ends[here] = point
    return DangerOverlay(tick.points, tick.vectors, origins, ends, hits, thresholds)


class Film:
    """Records a run as mp4: pass `film.observe` as the run's observer, inside a `with` block.

    Args:
        path: The mp4; appears only when complete.
        scene: Scene of the run.
        spots: Its sensors.
        activation: For the thresholds shown.
        fps: Frames per second of video and of simulated time.
        dt: Tick [s].
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        spots: SpotArray,
        activation: Activation,
        fps: int = 25,
        dt: float = 0.004,
    ) -> None:
        self._writer = VideoWriter(path, scene, fps=fps)
        self._spots = spots
        self._thresholds = medium_and_high(activation)
        self.every = max(round(1.0 / (fps * dt)), 1)

    def __enter__(self) -> Film:
        self._writer.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.__exit__(kind, error, trace)

    def observe(self, tick: Tick, scene: Scene, plant: Plant) -> Any:
        """Add a frame if one is due and return it, else None.

        Args:
            tick: The tick.
            scene: What is filmed.
            plant: The state of it.
        """
        if tick.reference.seq % self.every:
            return None
        drawn = overlay(tick, plant, self._spots, self._thresholds)
        caption = Caption(
            tick.reference.time,
            tick.regime,
            tick.cdf_n,
            self._thresholds,
            tick.m,
            tick.f,
            tick.phase,
        )
        return self._writer.add(plant.data, drawn, caption)


class Viewer:
    """Shows a run in MuJoCo's viewer in real time, with points, rays and vectors; needs a display.

    Args:
        scene: What is shown.
        spots: The distance sensors.
        activation: Its thresholds colour the points.
        dt: Tick [s].
    """

    def __init__(self, scene: Scene, spots: SpotArray, activation: Activation, dt: float = 0.004) -> None:
        self._scene, self._spots, self._dt = scene, spots, dt
        self._thresholds = medium_and_high(activation)
        self._handle: Any = None

    def observe(self, tick: Tick, scene: Scene, plant: Plant) -> None:
        """Show the state, at most 50 times a second, and keep pace with the clock.

        Args:
            tick: The tick.
            scene: What is shown.
            plant: The state of it.

        Raises:
            ViewerUnavailableError: There is no display.
            KeyboardInterrupt: The window was closed.
        """
        if self._handle is None:
            self._open(plant)
        if not self._handle.is_running():
            raise KeyboardInterrupt
        if tick.reference.seq % 5 == 0:
            with self._handle.lock():
                self._handle.user_scn.ngeom = 0
                overlay(tick, plant, self._spots, self._thresholds).draw(self._handle.user_scn)
            self._handle.sync()
        time.sleep(max(self._start + tick.reference.time - time.perf_counter(), 0.0))

    def close(self) -> None:
        """Close the window."""
        if self._handle is not None:
            self._handle.close()

    def _open(self, plant: Plant) -> None:
        try:
            import glfw
            import mujoco.viewer

            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if not glfw.init():  # MuJoCo would end the whole process
                    raise RuntimeError("no display")
            self._handle = mujoco.viewer.launch_passive(plant.scene.model, plant.data)
            self._handle.opt.geomgroup[:] = shown_groups(plant.scene.model)
        except Exception as error:
            raise ViewerUnavailableError(f"MuJoCo's viewer cannot open a window here: {error}") from error
        self._start = time.perf_counter()


def medium_and_high(activation: Activation) -> tuple[float, float]:
    """Danger at which medium and high begin."""
    return activation.thresholds[-1].start, activation.thresholds[0].start
