"""The controllers of a campaign by name. A user adds one by `register`: a name, a sentence, a function of the station.

Every name also exists with the ending `_perfect_sight`: the same controller, told the true nearest points of everybody
instead of what the spots read: monitors every part of everybody within 0.8 m of a body of the robot, controllers with
a danger field, which add up what they are told, the nearest point to each link within 2 m.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.thresholds import SOURCE, robot_thresholds
from qpsafe.errors import ConfigurationError
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.weighted import WeightedLaw
from qpsafe.recovery.returns import RecoveryRules
from qpsafe.sensing.rules import SensingRules
from qpsafe.sim.campaign.opponents.scaling import PathScaling
from qpsafe.sim.campaign.opponents.stop import StopOnly

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController
    from qpsafe.sim.campaign.station import Station
    from qpsafe.tick import Tick

PERFECT = "_perfect_sight"
SPOTS, POINTS, NOTHING = "spots", "points", "nothing"  # what a controller is told


class Controls(Protocol):
    """What a trial needs of a controller: `SafetyController.step`'s form."""

    def step(self, q: NDArray, qd: NDArray, distances: ArrayLike | None = None, *, points: Any = None) -> Tick:
        """One tick; never raises on data.

        Args:
            q: Measured (n,) [rad].
            qd: Measured (n,) [rad/s].
            distances: Of the spots (k,) [m].
            points: Instead (p, 3) [m].
        """
        ...


class Opponent(NamedTuple):
    """A controller of the campaign.

    Attributes:
        name: In tables and files.
        sentence: What it is, for the report.
        make: A fresh one for a station; called once a trial.
        sight: ``spots``, ``points`` (perfect sight) or ``nothing``.
    """

    name: str
    sentence: str
    make: Callable[[Station], Controls]
    sight: str = SPOTS


#: Everything else as in the paper: evasion tuned by hand, obstacles at rest, a return as soon as danger falls.
_REST: dict[str, Any] = {"sensing": SensingRules(velocities=False), "recovery": RecoveryRules.paper()}
_REST |= {"evasion": "paper"}


def _with(law: Any = None, **parts: Any) -> Callable[[Station], SafetyController]:
    def make(station: Station) -> SafetyController:
        return station.controller(law, **parts)

    return make


def _capped(station: Station) -> SafetyController:
    high = robot_thresholds(station.robot)[0]  # the cap of docs/barrier.md, 9.5 on the IRB 140
    return station.controller(barrier=DangerBarrier(9.5 / SOURCE[0].delta * high.delta), **_REST)


_BUNDLED = (
    Opponent("none", "follows its path whatever happens", _with(), NOTHING),
    Opponent("stop", "stops while somebody is nearer than S_p, speed and separation monitoring", StopOnly),
    Opponent("scaling", "slows down along its path so that nobody is approached faster than v_max", PathScaling),
    Opponent("nullspace", "the paper's law (22) by null-space projections, limits by clipping",
             _with(NullspaceLaw(), **_REST)),
    Opponent("weighted", "one weighted QP, soft priorities", _with(WeightedLaw(), **_REST)),
    Opponent("paper", "the paper's law as hierarchical QPs", _with(HierarchicalLaw(projection="paper"), **_REST)),
    Opponent("strict", "lexicographic QPs, everything else as in the paper", _with(HierarchicalLaw(), **_REST)),
    Opponent("barrier", "strict, with a cap on the danger field", _capped),
    Opponent("velocities", "strict, with approach velocities in the field",
             _with(HierarchicalLaw(), **_REST | {"sensing": SensingRules(velocities=True)})),
    Opponent("default", "SafetyController as it comes", _with()),
)  # fmt: skip
_known: dict[str, Opponent] = {entry.name: entry for entry in _BUNDLED}


def names() -> tuple[str, ...]:
    """All names, without those of perfect sight."""
    return tuple(_known)


def register(name: str, make: Callable[[Station], Controls], sentence: str = "a controller of the user's") -> None:
    """Add a controller to those that campaigns know in this process; workers see it as ``module:function``.

    Args:
        name: Of it, without the ending `_perfect_sight`.
        make: A function of the station that makes a fresh controller.
        sentence: What it is, for the report.

    Raises:
        ConfigurationError: The name is taken, or is none.
    """
    if not name or name.endswith(PERFECT) or name in _known or ":" in name:
        raise ConfigurationError("campaign", "controllers", name, "a new name, without ':' and " + PERFECT)
    if not callable(make):
        raise ConfigurationError("campaign", f"controllers.{name}", make, "a function of the station")
    _known[name] = Opponent(name, sentence, make)


def opponent(name: str) -> Opponent:
    """A controller by name, or by ``module:function`` or ``file.py:function``, with or without `_perfect_sight`.

    Raises:
        ConfigurationError: There is none of this name.
    """
    base = name.removesuffix(PERFECT)
    found = _imported(base) if ":" in base else _known.get(base)
    if found is None:
        expected = f"one of {', '.join(_known)}, any of them with {PERFECT}, or module:function"
        raise ConfigurationError("campaign", "controllers", name, expected)
    if base != name and found.sight == SPOTS:
        return found._replace(name=name, sentence=found.sentence + ", told the true nearest points", sight=POINTS)
    return found


@cache
def _imported(place: str) -> Opponent:
    module, _, function = place.rpartition(":")
    try:
        if module.endswith(".py"):
            from importlib.util import module_from_spec, spec_from_file_location

            spec = spec_from_file_location(Path(module).stem, module)
            if spec is None or spec.loader is None:
                raise ImportError(f"{module} is no Python file")
            loaded = module_from_spec(spec)
            spec.loader.exec_module(loaded)
        else:
            loaded = importlib.import_module(module)
        make = getattr(loaded, function)
    except (ImportError, OSError, AttributeError) as error:
        raise ConfigurationError("campaign", "controllers", place, f"module:function ({error})") from None
    if not callable(make):
        raise ConfigurationError("campaign", "controllers", place, "a function of the station")
    return Opponent(place, (make.__doc__ or "a controller of the user's").strip().splitlines()[0], make)
