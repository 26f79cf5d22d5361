"""What a run of the first experiment shows: regimes, errors, distances, and whether it kept its promises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.experiments.shared.following import LATE, OFF, farthest_off
from qpsafe.sim.recording.log import RunLog

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
Window = tuple[float, float]
LIMIT_TOLERANCE = 1e-9


class RegimeRow(NamedTuple):
    """One stretch in one regime: when it was entered and left [s], its largest danger and errors [m, rad]."""

    regime: str
    entered: float
    left: float
    cdf_n: float
    position_error: float
    orientation_error: float
    measured_position_error: float
    measured_orientation_error: float


class ApproachRow(NamedTuple):
    """One approach: its time [s], the smallest true distance links-board with and without the controller [m]."""

    start: float
    end: float
    with_controller: float
    without_controller: float


class Check(NamedTuple):
    """One promise.

    Attributes:
        name: What it is about.
        measured: In words.
        promised: In words.
        kept: Whether it was kept.
        counts: Whether the run is to keep it. What only figures of another robot justify is shown, and does not count.
    """

    name: str
    measured: str
    promised: str
    kept: bool
    counts: bool = True


def all_kept(checks: Sequence[Check]) -> bool:
    """Whether every promise that counts was kept."""
    return all(check.kept or not check.counts for check in checks)


def split(found: Sequence[Check | str]) -> tuple[list[Check], list[str]]:
    """Promises that could be judged, and the names of those that could not."""
    return [item for item in found if isinstance(item, Check)], [item for item in found if isinstance(item, str)]


@dataclass(frozen=True)
class Report:
    """Summary of a run.

    Attributes:
        regimes: Every stretch in one regime.
        approaches: Every approach that was complete.
        checks: The promises that the run could keep or break.
        left_out: Names of those that it could not: what they are about did not happen, as in a short run.
        tracking: Largest position (3D) and orientation difference of commanded and measured tool pose [m, rad].
        unusual: How many ticks had a message, and the most frequent one.
    """

    regimes: list[RegimeRow]
    approaches: list[ApproachRow]
    checks: list[Check]
    left_out: list[str]
    tracking: tuple[float, float]
    unusual: tuple[int, str]

    @property
    def kept(self) -> bool:
        """Whether every promise was kept."""
        return all_kept(self.checks)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        result = asdict(self)
        for key in ("regimes", "approaches", "checks"):
            result[key] = [row._asdict() for row in getattr(self, key)]
        return result | {"kept": self.kept}


def summarise(
    log: RunLog,
    without: Array,
    windows: tuple[Window, ...],
    robot: Robot,
    *,
    tuned: bool = True,
    within: Array | None = None,
) -> Report:
    """Make the report of a run.

    Args:
        log: The run.
        without: Distance robot-board at every tick if the robot keeps its pose (N,) [m].
        windows: Start and end of each approach; what is about one that the run does not complete is left out [s].
        robot: For its limits.
        tuned: Whether people's pauses were chosen for this robot, so that every approach shows all of Table I. If not,
            what depends on them is shown and does not count.
        within: Distance robot-board at every tick of the run, measured as `without`; by default the log's (N,) [m].
    """
    within = log.board_distance if within is None else within
    shown: list[Check | str] = [*_order(log, windows), *_released(log, windows)]
    if not tuned:
        shown = [c if isinstance(c, str) else c._replace(counts=False, name=f"{c.name} (no promise)") for c in shown]
    found = [*shown, *_errors(log, windows), *_limits(log, robot), _followed(log, robot)]
    approaches = []
    for start, end in windows:
        if not _complete(log, end):
            found.append(f"distance to the board, approach at {start:.1f} s")
            continue
        inside = _between(log, start, end)
        if (
            not tuned and not (log.regime[inside] == "high").any()
        ):  # nobody came near enough for sensors at a rule's places
            found.append(f"distance to the board, approach at {start:.1f} s")
            continue
        approaches.append(ApproachRow(start, end, float(within[inside].min()), float(without[inside].min())))
    found.extend(
        Check(
            f"distance to the board, approach at {row.start:.1f} s",
            f"{row.with_controller:.3f} m",
            f"> {row.without_controller:.3f} m without the controller",
            row.with_controller > row.without_controller,
        )
        for row in approaches
    )
    words = [message for _, message in log.messages]
    frequent = max(set(words), key=words.count) if words else ""
    tracking = (
        float(np.linalg.norm(log.position_error - log.measured_position_error, axis=1).max()),
        float(np.linalg.norm(log.orientation_error - log.measured_orientation_error, axis=1).max()),
    )
    unusual = (len({tick for tick, _ in log.messages}), frequent)
    return Report(_regimes(log), approaches, *split(found), tracking, unusual)


def _regimes(log: RunLog) -> list[RegimeRow]:
    rows = []
    for item in log.intervals():
        inside = _between(log, item.start, item.end)
        largest = [
            float(_norm(error[inside]).max())
            for error in (
                log.position_error,
                log.orientation_error,
                log.measured_position_error,
                log.measured_orientation_error,
            )
        ]
        rows.append(RegimeRow(item.name, item.start, item.end, float(log.cdf_n[inside].max()), *largest))
    return rows


def _complete(log: RunLog, end: float) -> bool:
    """Whether the run lasted to this time [s]."""
    return end <= log.time[-1] + log.dt + 1e-9


def _order(log: RunLog, windows: tuple[Window, ...]) -> list[Check | str]:
    """Table I: levels are entered and left one after the other, and every approach reaches high danger."""
    level = {"low": 0, "medium": 1, "high": 2}
    checks: list[Check | str] = []
    for start, end in windows:
        name = f"order of Table I, approach at {start:.1f} s"
        if not _complete(log, end):
            checks.append(name)
            continue
        inside = _between(log, start, end)
        names = [item.name for item in log.intervals() if item.end > start and item.start < end]
        levels = [level.get(word, 9) for word in names]
        steps = {abs(b - a) for a, b in pairwise(levels)}
        good = steps == {1} and levels[0] == levels[-1] == 0 and 2 in levels
        measured = " ".join(names) + f" (CDF_n up to {log.cdf_n[inside].max():.2f})"
        checks.append(Check(name, measured, "low, medium, high and back, one at a time", good))
    return checks


def _errors(log: RunLog, windows: tuple[Window, ...]) -> list[Check | str]:
    position, orientation = _norm(log.position_error), _norm(log.orientation_error)
    danger = np.flatnonzero(log.cdf_n > 0.0)  # of what stands by itself, a sensor's reading is none
    quiet = slice(0, danger[0] if len(danger) else len(log.time))
    checks = _pair("before anything is detected", position[quiet], orientation[quiet], (0.1, 0.001))
    for start, end in windows:
        medium = _before_high(log, start, end)
        name = f"position error in medium before high, approach at {start:.1f} s"
        whole = len(medium) and _complete(log, end)
        checks.append(_bound(name, 1e3 * position[medium].max(), 2.0, "mm") if whole else name)
    if windows:
        k = int(np.searchsorted(log.time, windows[-1][1] + 10.0))
        checks += _pair("10 s after the last withdrawal", position[k:], orientation[k:], (1.0, 0.01))
    return checks


def _released(log: RunLog, windows: tuple[Window, ...]) -> list[Check | str]:
    """In medium danger the tool turns: how far depends on how near people pause."""
    orientation, checks = _norm(log.orientation_error), list[Check | str]()
    for start, end in windows:
        medium, name = (
            _before_high(log, start, end),
            f"orientation error in medium before high, approach at {start:.1f} s",
        )
        if not (len(medium) and _complete(log, end)):
            checks.append(name)
            continue
        peak = orientation[medium].max()
        checks.append(Check(name, f"{peak:.3f} rad", "> 0.05 rad", bool(peak > 0.05)))
    return checks


def _before_high(log: RunLog, start: float, end: float) -> NDArray[np.intp]:
    """Ticks of an approach in medium danger, before any in high."""
    inside = np.flatnonzero(_between(log, start, end))
    high = inside[log.regime[inside] == "high"]
    return inside[(log.regime[inside] == "medium") & (inside < (high[0] if len(high) else len(log.time)))]


def _pair(when: str, position: Array, orientation: Array, bounds: tuple[float, float]) -> list[Check | str]:
    """Bounds of position and orientation error, largest values of some ticks [m, rad]; in [mm, rad]."""
    names = f"position error {when}", f"orientation error {when}"
    if not len(position):
        return [*names]
    return [
        _bound(names[0], 1e3 * position.max(), bounds[0], "mm"),
        _bound(names[1], orientation.max(), bounds[1], "rad"),
    ]


def _limits(log: RunLog, robot: Robot) -> list[Check | str]:
    velocity, acceleration = log.joint_rates()
    excesses = {
        "position": (np.maximum(robot.lower - log.q_ref, log.q_ref - robot.upper), "rad"),
        "velocity": (np.abs(velocity) - robot.max_velocity, "rad/s"),
        "acceleration": (np.abs(acceleration) - robot.max_acceleration, "rad/s²"),
    }
    checks: list[Check | str] = []
    for kind, (excess, unit) in excesses.items():
        name = f"joint {kind} limits"
        if not excess.size:  # rates need two and three ticks
            checks.append(name)
            continue
        most = excess.max()
        measured = f"passed by {most:.1e} {unit}" if most > 0.0 else f"{abs(most):.3g} {unit} to spare"
        checks.append(Check(name, measured, f"passed by at most {LIMIT_TOLERANCE:g}", bool(most <= LIMIT_TOLERANCE)))
    return checks


def _followed(log: RunLog, robot: Robot) -> Check:
    """The measured robot is where it was commanded to be."""
    off, joint = farthest_off(log)
    unit = "m" if robot.sliding[joint] else "rad"
    measured = f"{robot.joint_names[joint]} up to {off:.2g} {unit} off"
    promised = f"< {OFF:g} {unit} off all commands of the last {LATE:g} s"
    return Check("measured joints follow the commanded ones", measured, promised, bool(off < OFF))


def _bound(name: str, value: float, bound: float, unit: str) -> Check:
    return Check(name, f"{value:.3g} {unit}", f"< {bound:g} {unit}", bool(value < bound))


def _between(log: RunLog, start: float, end: float) -> NDArray[np.bool_]:
    return (log.time >= start - 1e-9) & (log.time < end - 1e-9)


def _norm(error: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(error, axis=1)
