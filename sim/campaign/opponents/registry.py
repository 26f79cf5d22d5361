"""The controllers of a campaign by name. A user adds one by `register`: a name, a sentence, a function of the station.

Every name also exists with the ending `_perfect_sight`: the same controller, told the true nearest points of everybody
instead of what the spots read: monitors every part of everybody within 0.8 m of a body of the robot, controllers with
a danger field, which add up what they are told, the nearest point to each link within 2 m.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.evasion import Evasion
from qpsafe.danger.separation_limit import SeparationLimit
from qpsafe.danger.thresholds import SOURCE, robot_activation, robot_thresholds
from qpsafe.errors import ConfigurationError, in_words
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.weighted import WeightedLaw
from qpsafe.sensing.rules import SensingRules
from qpsafe.sim.campaign.digests import State, state_of
from qpsafe.sim.campaign.opponents.as_in_paper import AS_IN_PAPER
from qpsafe.sim.campaign.opponents.fingerprint import fingerprint
from qpsafe.sim.campaign.opponents.scaling import PathScaling
from qpsafe.sim.campaign.opponents.separated import Separated
from qpsafe.sim.campaign.opponents.stop import StopOnly
from qpsafe.sim.campaign.trials.servo import DT

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController
    from qpsafe.sim.campaign.trials.station import Station
    from qpsafe.tick import Tick

PERFECT = "_perfect_sight"
#: What `brisk` multiplies the thresholds of position and orientation by: it loses less time than a stop at less harm.
BRISK = (15.0, 1.5)
SPOTS, POINTS, NOTHING = "spots", "points", "nothing"  # what a controller is told


class Controls(Protocol):
    """What a trial needs of a controller: `SafetyController.step`'s form."""

    def step(
        self, q: NDArray, qd: NDArray, distances: ArrayLike | None = None, *, points: Any = None, images: Any = None,
        now: Any = 0.0,
    ) -> Tick:  # fmt: skip
        """One tick; never raises on data.

        Args:
            q: Measured (n,) [rad].
            qd: Measured (n,) [rad/s].
            distances: Of the spots (k,) [m].
            points: Instead (p, 3) [m].
            images: Of range sensors.
            now: Present time on the clock of their stamps [s].
        """
        ...


class Opponent(NamedTuple):
    """A controller of the campaign.

    Attributes:
        name: In tables and files.
        sentence: What it is, for the report.
        make: A fresh one for a station; called once a trial.
        sight: ``spots``, ``points`` (perfect sight) or ``nothing``.
        edition: Tells `make` from another one that had this name before.
    """

    name: str
    sentence: str
    make: Callable[[Station], Controls]
    sight: str = SPOTS
    edition: str = ""


def _with(law: Any = None, **parts: Any) -> Callable[[Station], SafetyController]:
    def make(station: Station) -> SafetyController:
        return station.controller(law, **parts)

    return make


def _capped(station: Station) -> SafetyController:
    high = robot_thresholds(station.robot.with_parameters("paper"))[
        0
    ]  # the cap of docs/explanation/barrier.md, 9.5 on the IRB 140
    return station.controller(barrier=DangerBarrier(9.5 / SOURCE[0].delta * high.delta), **AS_IN_PAPER)


def _creeping(station: Station) -> SafetyController:
    own = Evasion.for_robot(station.robot, DT)
    return station.controller(evasion=Evasion(own.mass, own.damping, station.robot.nq, DT))


def _brisk(station: Station) -> SafetyController:
    count = len(station.robot.tool_frames)
    return station.controller(activation=robot_activation(station.robot, count, count).scaled(*BRISK))


def _apart(station: Station) -> SafetyController:
    return station.controller(HierarchicalLaw(), separation=SeparationLimit(station.separation), **AS_IN_PAPER)


_BUNDLED = (
    Opponent("none", "follows its path whatever happens", _with(**AS_IN_PAPER), NOTHING),
    Opponent("stop", "stops while somebody is nearer than S_p, speed and separation monitoring", StopOnly),
    Opponent("scaling", "slows down along its path so that nobody is approached faster than v_max", PathScaling),
    Opponent("nullspace", "the paper's law (22) by null-space projections, limits by clipping",
             _with(NullspaceLaw(), **AS_IN_PAPER)),
    Opponent("weighted", "one weighted QP, soft priorities", _with(WeightedLaw(), **AS_IN_PAPER)),
    Opponent("paper", "the paper's law as hierarchical QPs", _with(HierarchicalLaw(projection="paper"), **AS_IN_PAPER)),
    Opponent("strict", "lexicographic QPs, everything else as in the paper", _with(HierarchicalLaw(), **AS_IN_PAPER)),
    Opponent("barrier", "strict, with a cap on the danger field", _capped),
    Opponent("velocities", "strict, with approach velocities in the field",
             _with(HierarchicalLaw(), **AS_IN_PAPER | {"sensing": SensingRules(velocities=True)})),
    Opponent("unverified", "default without gate and rows for furniture", _with(gate="off", clearance="off")),
    Opponent("unheld", "default, but a link that cannot get away goes on",
             _with(gate=VerifiedMotion(escape=0.0))),
    Opponent("creeping", "default, but its evasion has no friction", _creeping),
    Opponent("separation", "rows for v_max under the joint limits, no evasion, the path waits", Separated),
    Opponent("strict_separation", "strict, with rows for v_max above all tasks", _apart),
    Opponent("brisk", "default, but work goes on up to 15 times, orientation up to 1.5 times the danger", _brisk),
    Opponent("default", "SafetyController as it comes", _with()),
)  # fmt: skip
_known: dict[str, Opponent] = {entry.name: entry for entry in _BUNDLED}
_editions = count()
#: Of modules that were imported for a controller: what their files were then.
_read: dict[str, State] = {}


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
        ConfigurationError: The name is taken, or not a valid name.
    """
    if not name or name.endswith(PERFECT) or name in _known or ":" in name:
        raise ConfigurationError("campaign", "controllers", name, "a new name, without ':' and " + PERFECT)
    if not callable(make):
        raise ConfigurationError("campaign", f"controllers.{name}", make, "a function of the station")
    _known[name] = Opponent(name, sentence, make, edition=str(next(_editions)))


def maker_digest(name: str) -> str | None:
    """64 hexadecimal digits that stand for what was registered under a name; None for the bundled ones, who are code.

    Raises:
        ConfigurationError: It cannot be told from another one.
    """
    found = _known.get(name)
    return None if found is None or found in _BUNDLED else fingerprint(name, found.make)


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


def _imported(place: str) -> Opponent:
    """A user's own, as the file says now: one that was edited since is read again."""
    name, _, function = place.rpartition(":")
    try:
        module, edition = _from_file(name) if name.endswith(".py") else _from_module(name)
        make = getattr(module, function)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a user's module may raise anything, even end the process
        expected = f"module:function or file.py:function ({in_words(error)})"
        raise ConfigurationError("campaign", "controllers", place, expected) from None
    if not callable(make):
        raise ConfigurationError("campaign", "controllers", place, "a function of the station")
    said = make.__doc__.strip() if isinstance(make.__doc__, str) else ""
    sentence = (said or "a controller of the user's").splitlines()[0]
    return Opponent(place, sentence, make, edition=edition)


def _from_file(path: str) -> tuple[ModuleType, str]:
    source = Path(path).read_bytes()
    return _executed(path, source), sha256(source).hexdigest()


@cache
def _executed(path: str, source: bytes) -> ModuleType:
    """A module of its own; not by the cache of bytecode, which takes two files of one second and size for the same."""
    spec = spec_from_file_location(Path(path).stem, path)
    if spec is None:
        raise ImportError(f"{path} is no Python file")
    loaded = module_from_spec(spec)
    exec(compile(source, path, "exec", dont_inherit=True), loaded.__dict__)
    return loaded


def _from_module(name: str) -> tuple[ModuleType, str]:
    module = importlib.import_module(name)
    origin = getattr(module, "__file__", None) or ""
    now = state_of(origin)
    if _read.setdefault(name, now) != now:
        # as importlib.reload, see above
        exec(compile(Path(origin).read_bytes(), origin, "exec", dont_inherit=True), module.__dict__)
        _read[name] = now
    return module, str(now)
