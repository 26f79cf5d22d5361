"""The danger, drawn into the scene: detected points, danger vectors, sensor rays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GREEN, YELLOW, RED = np.array([0.20, 0.68, 0.32]), np.array([0.98, 0.78, 0.10]), np.array([0.86, 0.12, 0.12])


def danger_colour(value: float, medium: float, high: float) -> Array:
    """Green at zero danger, yellow at the medium threshold, red from the high one on; RGB, 0 to 1, (3,).

    Args:
        value: Danger; grey if it is NaN.
        medium: Threshold of medium danger.
        high: Threshold of high danger.
    """
    if not value >= 0.0:
        return np.array([0.5, 0.5, 0.5])
    if value <= medium:
        share = (value / medium) ** 2  # stay green for long: yellow shall mean something
        return (1.0 - share) * GREEN + share * YELLOW
    share = min((value - medium) / (high - medium), 1.0)
    return (1.0 - share) * YELLOW + share * RED


def _rows() -> Array:
    return np.empty((0, 3))


@dataclass(frozen=True)
class DangerOverlay:
    """What to draw into one frame.

    Attributes:
        points: Detected points, world frame, (p, 3) [m].
        vectors: Danger vectors (6) in them, which point towards the robot, (p, 3).
        ray_starts: Where the sensors' rays begin, (r, 3) [m].
        ray_ends: Where they end: at what they hit, or at the end of their range, (r, 3) [m].
        ray_hits: Which of them hit something, (r,) bool; default none.
        thresholds: Danger at which medium and high begin; sets the colours.
        arrow_scale: Length of an arrow per unit of danger [m].
    """

    points: Array = field(default_factory=_rows)
    vectors: Array = field(default_factory=_rows)
    ray_starts: Array = field(default_factory=_rows)
    ray_ends: Array = field(default_factory=_rows)
    ray_hits: NDArray[np.bool_] | None = None
    thresholds: tuple[float, float] = (7.5 * 0.75, 11.5 * 0.85)
    arrow_scale: float = 0.025

    def draw(self, scene: Any) -> None:
        """Append the geoms to an updated `MjvScene`; what no longer fits or is not finite is left out."""
        shape = mujoco.mjtGeom
        hits = np.zeros(len(self.ray_starts), bool) if self.ray_hits is None else self.ray_hits
        for start, end, hit in zip(self.ray_starts, self.ray_ends, hits, strict=True):
            rgba = (0.80, 0.12, 0.20, 0.9) if hit else (0.10, 0.35, 0.65, 0.35)
            _connect(scene, shape.mjGEOM_LINE, 2.0 if hit else 1.0, start, end, rgba)  # width in pixels
        for point, vector in zip(self.points, self.vectors, strict=True):
            magnitude = float(np.linalg.norm(vector))
            rgba = (*danger_colour(magnitude, *self.thresholds), 1.0)
            if scene.ngeom < scene.maxgeom and np.isfinite(point).all():
                mujoco.mjv_initGeom(
                    scene.geoms[scene.ngeom],
                    shape.mjGEOM_SPHERE,
                    np.full(3, 0.020),
                    np.asarray(point, dtype=np.float64),
                    np.eye(3).ravel(),
                    np.asarray(rgba, dtype=np.float32),
                )
                scene.geoms[scene.ngeom].emission = 0.20
                scene.ngeom += 1
            # MuJoCo draws an arrow half as long as the segment it connects
            tip = point + 2.0 * self.arrow_scale * vector
            _connect(scene, shape.mjGEOM_ARROW, 0.011, point, tip, rgba)


def _connect(scene: Any, shape: Any, width: float, start: Array, end: Array, rgba: tuple[float, ...]) -> None:
    if not (scene.ngeom < scene.maxgeom and np.isfinite(start).all() and np.isfinite(end).all()):
        return
    geom = scene.geoms[scene.ngeom]
    colour = np.asarray(rgba, dtype=np.float32)
    mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.zeros(9), colour)
    mujoco.mjv_connector(geom, shape, width, np.asarray(start, np.float64), np.asarray(end, np.float64))
    geom.emission = 0.20
    scene.ngeom += 1
