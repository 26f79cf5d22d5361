"""Controllers as policies of the environment of `qpsafe.sim.campaign.gym.environment`, and rows of policies."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.gym.environment import EncounterEnv, Observation, scale
from qpsafe.sim.campaign.opponents.registry import NOTHING, POINTS, opponent

if TYPE_CHECKING:
    from qpsafe.sim.campaign.opponents.registry import Controls
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tick import Tick

Array = NDArray[np.float64]
Policy = Callable[[Observation], Array]


class ControllerPolicy:
    """A controller as a policy: what it commands as an action.

    Args:
        controls: A `SafetyController`, or what has the same `step`; fresh for each episode.
        station: Of the environment.
        blind: Whether it is told of nobody, whatever the spots read.

    Attributes:
        tick: The last one, None before the first.
    """

    def __init__(self, controls: Controls, station: Station, blind: bool = False) -> None:
        self._controls, self._station, self._blind = controls, station, blind
        self.tick: Tick | None = None

    @classmethod
    def named(cls, name: str, station: Station) -> Self:
        """One of the campaign's, fresh.

        Args:
            name: Its name, without perfect sight: observations have what the spots read.
            station: Of the environment.

        Raises:
            ConfigurationError: There is none of this name, or it needs to know more than observations say.
        """
        entry = opponent(name)
        if entry.sight == POINTS:
            raise ConfigurationError("ControllerPolicy", "name", name, "a controller that sees by spots")
        return cls(entry.make(station), station, entry.sight == NOTHING)

    def __call__(self, observation: Observation) -> Array:
        """The action (n,) for an observation."""
        q, qd, d = (observation[key] for key in ("q", "qd", "distances"))
        if self._blind:
            self.tick = self._controls.step(q, qd, points=np.empty((0, 3)))
        else:
            d = np.where(d < 0.0, np.nan, np.where(d >= self._station.spots.range_max, np.inf, d))
            self.tick = self._controls.step(q, qd, d)
        return np.asarray(self.tick.reference.qd / scale(self._station.robot))


def episode(env: EncounterEnv, policy: Policy, seed: int, name: str = "policy") -> dict[str, Any]:
    """Play one encounter to its end; its row of measures.

    Args:
        env: The environment, without wrappers.
        policy: From an observation to an action; a controller's says its own clock and phases, as in a campaign.
        seed: Of the encounter.
        name: In the row.
    """
    observation, _ = env.reset(seed=seed)
    over = False
    while not over:
        action = policy(observation)
        if isinstance(policy, ControllerPolicy):
            assert policy.tick is not None
            env.tell(policy.tick)
        observation, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
    return env.measures(name)
