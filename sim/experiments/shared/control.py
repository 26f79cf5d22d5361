"""What a user of any experiment may put in the place of its own choices, and measure besides."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.danger.activation import Activation
    from qpsafe.danger.evasion import Evasion
    from qpsafe.gate.rules import VerifiedMotion
    from qpsafe.sim.world.plant import Plant
    from qpsafe.sim.world.scene import Scene
    from qpsafe.tasks.task import Task
    from qpsafe.tick import Tick

#: A number, or (k,) of them, of one tick.
Metric = Callable[["Tick", "Scene", "Plant"], ArrayLike]


@dataclass(kw_only=True)
class Control:
    """Parts of the controller, and what is measured of every tick.

    Attributes:
        tasks: What the robot is asked to do, highest priority first; by default every tool's position, then every
            tool's orientation. Errors in the log are of the tools all the same.
        activation: Thresholds of the tasks; by default the robot's.
        evasion: The admittance (16), None for the controller's default. Every run begins with one at rest.
        gate: The last step, None for the controller's default, "off" for none.
        metrics: What else to write down at every tick, by name: functions of the tick, the scene and the plant. See
            `RunLog.metrics`.
    """

    tasks: Sequence[Task] | None = None
    activation: Activation | None = None
    evasion: Evasion | None = None
    gate: VerifiedMotion | str | None = None
    metrics: Mapping[str, Metric] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, metric in self.metrics.items():
            if not callable(metric):
                expected = "a function of (tick, scene, plant) that returns a number or (k,) of them"
                raise ConfigurationError(type(self).__name__, f"metrics[{name!r}]", metric, expected)

    def parts(self) -> dict[str, Any]:
        """Thresholds, evasion and gate as arguments of `SafetyController`."""
        evasion = copy.deepcopy(self.evasion)  # it remembers a velocity: no two runs share it
        return {"activation": self.activation, "evasion": evasion, "gate": self.gate}

    def measured(self, tick: Tick, scene: Scene, plant: Plant) -> dict[str, NDArray[np.float64]]:
        """All metrics of a tick.

        Args:
            tick: The tick.
            scene: What is simulated.
            plant: The state of it.
        """
        return {name: np.array(metric(tick, scene, plant), dtype=float) for name, metric in self.metrics.items()}
