"""The gripper at the tool's tip: it holds a screw by a weld that closes only where there is a screw to hold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.experiments.pick_place.cell import Parts
from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]


class Gripper:
    """Grips what its tip touches.

    Args:
        scene: With the screws in it.
        parts: The screws.
        tolerance: Farther than this from the middle of a head the tip misses it [m].
        tilt: So does a tool more oblique to its axis [rad].
    """

    def __init__(self, scene: Scene, parts: Parts, tolerance: float = 2e-3, tilt: float = math.radians(3.0)) -> None:
        self._site, self._parts = scene.tcp_site, parts
        self.tolerance, self.tilt = tolerance, tilt
        #: Screw that is held, None if none.
        self.holding: int | None = None

    def grip(self, data: Any) -> int | None:
        """Close; the screw that is held now, None for a miss. Site poses of `data` must be up to date."""
        if self.holding is not None:
            return self.holding
        away = np.linalg.norm(self._parts.positions(data) - data.site_xpos[self._site], axis=1)
        nearest = int(np.argmin(away))
        tool = data.site_xmat[self._site].reshape(3, 3)[:, 2]  # out of the tip
        slant = math.acos(min(max(-float(tool @ self._parts.axes(data)[nearest]), -1.0), 1.0))
        if away[nearest] <= self.tolerance and slant <= self.tilt:
            self.holding = nearest
            self._parts.hold(data, nearest)
        return self.holding

    def release(self, data: Any) -> int | None:
        """Open; the screw that was held, None if none."""
        held, self.holding = self.holding, None
        if held is not None:
            self._parts.drop(data, held)
        return held
