"""What runs of the second experiment show, law by law: errors on the line, speeds on the way back, promises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.recovery.recovery import FOLLOWING
from qpsafe.sim.experiments.path.experiment import PathRun
from qpsafe.sim.experiments.shared.report import Check, all_kept, split
from qpsafe.text.json_text import plain

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

SETTLED = 0.5  # at constant speed for this long, a CLIK gain of 10 / s leaves exp(-5) of what was before [s]
CALM = 2.5  # in low danger for this long, a task that had been released has returned [s]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class PathFigures:
    """Figures of one run; None where it has no such moments.

    Attributes:
        line_orientation, line_position: Largest errors on the line at constant speed, in low danger, settled [rad, m].
        medium_position: Largest position error in medium danger while the path is followed [m].
        step: Largest change of q̇ in a tick, in units of a_max dt.
        clipped: Ticks in which the law's answer passed a limit and was clipped.
        return_speed, return_acceleration: Largest ones while returning to the path after high danger, in units of the
            limits; a return that the run cuts off within `CALM` is left out.
        smooth_speed, smooth_acceleration: The same once the evasive motion has been braked, 0.5 s after danger fell.
        resumed: Largest distance of the tool from the point where the path had stopped when it went on [m].
        suspensions: How often the path was suspended.
        travelled: How far the path's clock came [s].
    """

    line_orientation: float | None
    line_position: float | None
    medium_position: float | None
    step: float
    clipped: int
    return_speed: float | None
    return_acceleration: float | None
    smooth_speed: float | None
    smooth_acceleration: float | None
    resumed: float | None
    suspensions: int
    travelled: float


def figures(run: PathRun, robot: Robot) -> PathFigures:
    """Measure a run."""
    log, dt = run.log, run.log.dt
    position, orientation = (np.linalg.norm(e, axis=1) for e in (log.position_error, log.orientation_error))
    line, medium = on_line(run), (log.regime == "medium") & (log.phase == FOLLOWING) & (log.m >= 1.0)
    qd = log.qd_ref
    rise = np.abs(np.diff(qd, axis=0, prepend=qd[:1])) / (robot.max_acceleration * dt)
    step, speed = rise.max(axis=1), (np.abs(qd) / robot.max_velocity).max(axis=1)
    back, starts = _whole(returning(run), round(CALM / dt)), _starts(log.regime == "high", falling=True)
    braked = back & ~_after(starts, round(SETTLED / dt), len(back))
    went_on = _starts(log.phase == FOLLOWING) if (log.phase != FOLLOWING).any() else np.zeros(0, dtype=int)
    return PathFigures(
        _largest(orientation, line),
        _largest(position, line),
        _largest(position, medium),
        float(step.max()),
        len({tick for tick, message in log.messages if "exceeded the limits" in message}),
        _largest(speed, back),
        _largest(step, back),
        _largest(speed, braked),
        _largest(step, braked),
        float(position[went_on].max()) if len(went_on) else None,
        len(_starts(log.phase == "suspended")),
        float(run.path_time[-1]),
    )


def on_line(run: PathRun) -> Flags:
    """Ticks (N,) at constant speed for at least `SETTLED` seconds, after `CALM` of low danger or before any other."""
    log = run.log
    low = _lasting((log.regime == "low") & (log.phase == FOLLOWING), round(CALM / log.dt))
    first = np.flatnonzero(log.regime != "low")
    low[: first[0] if len(first) else len(low)] = True  # nothing has been released yet
    return low & _lasting(run.speed >= run.speed.max() * (1.0 - 1e-6), round(SETTLED / log.dt))


def returning(run: PathRun) -> Flags:
    """Ticks (N,) from the end of high danger until both tasks are back (1 mm, 0.01 rad), or danger is high again."""
    log = run.log
    position, orientation = (np.linalg.norm(e, axis=1) for e in (log.position_error, log.orientation_error))
    back, away = np.zeros(len(log.time), dtype=bool), False
    for k in range(len(back)):
        if log.regime[k] == "high":
            away = True
        elif away and position[k] < 1e-3 and orientation[k] < 1e-2:
            away = False
        back[k] = away and log.regime[k] != "high"
    return back


def promises(
    strict: PathFigures, without: PathFigures | None, others: Mapping[str, PathFigures], *, tuned: bool = True
) -> tuple[list[Check], list[str]]:
    """What the second experiment is to show.

    Args:
        strict: The hierarchical law with the strict projection.
        without: The same run without suspension and recovery.
        others: The other laws by name; the null-space law as ``nullspace``.
        tuned: Whether line and people were chosen for this robot; if not, what the paper reports of another one is
            shown and does not count.

    Returns:
        The promises, and the names of those that the runs can neither keep nor break, for want of such moments.
    """
    found = [
        _bound("strict: orientation error, low danger, constant speed", strict.line_orientation, 1e-3, "rad"),
        _bound("strict: position error in medium danger along the line", strict.medium_position, 2e-3, "m"),
        _bound("strict: the path goes on from where it stopped", strict.resumed, 1e-3, "m"),
    ]
    if "nullspace" in others:
        error, name = others["nullspace"].line_orientation, "null-space law: the same orientation error"
        promised = "> 1e-3 rad, as the paper reports"
        name = name if tuned else f"{name} (no promise)"
        found.insert(1, name if error is None else Check(name, f"{error:.3g} rad", promised, bool(error > 1e-3), tuned))
    for name, run in {"strict": strict, **others}.items():
        found.append(_bound(f"{name}: largest step of q̇ beyond a_max dt", run.step - 1.0, 1e-9, "a_max dt"))
    if without is not None:
        kinds = {
            "joint speed": (strict.return_speed, without.return_speed),
            "joint acceleration": (strict.return_acceleration, without.return_acceleration),
            "joint acceleration, evasion braked": (strict.smooth_acceleration, without.smooth_acceleration),
        }
        for kind, (with_it, without_it) in kinds.items():
            name = f"strict: {kind} on the way back"
            if with_it is None or without_it is None:
                found.append(name)
                continue
            # how far high danger drives the robot off depends on how near people come
            kept = bool((with_it < without_it or not tuned) and with_it <= 1.0 + 1e-9)
            promised = f"< {without_it:.3f} without recovery, and <= 1" if tuned else f"<= 1 ({without_it:.3f} without)"
            found.append(Check(name, f"{with_it:.3f} of the limit", promised, kept))
    return split(found)


def to_dict(found: Mapping[str, PathFigures], checks: list[Check], left_out: Sequence[str]) -> dict[str, Any]:
    """For JSON.

    Args:
        found: Figures of each law, by its name.
        checks: What was promised and measured.
        left_out: Promises that do not apply to this run, in words.
    """
    return {
        "laws": {name: plain(asdict(item)) for name, item in found.items()},
        "checks": [check._asdict() for check in checks],
        "left_out": list(left_out),
        "kept": all_kept(checks),
    }


def _largest(values: NDArray[np.float64], where: Flags) -> float | None:
    return float(values[where].max()) if where.any() else None


def _starts(flags: Flags, falling: bool = False) -> NDArray[np.intp]:
    """Ticks at which a flag rises, or falls."""
    change = np.diff(flags.astype(int))
    return np.flatnonzero(change == (-1 if falling else 1)) + 1


def _lasting(flags: Flags, count: int) -> Flags:
    """Where a flag has been up for `count` ticks."""
    seen = np.concatenate(([0], np.cumsum(flags)))
    whole = np.zeros(len(flags), dtype=bool)
    whole[count - 1 :] = seen[count:] - seen[:-count] == count
    return whole


def _whole(flags: Flags, count: int) -> Flags:
    """Without the last stretch, if the run's end cuts it off before `count` ticks: its peak may not have come yet."""
    whole, down = flags.copy(), np.flatnonzero(~flags)
    last = down[-1] + 1 if len(down) else 0
    if len(flags) - last < count:
        whole[last:] = False
    return whole


def _after(starts: NDArray[np.intp], count: int, n: int) -> Flags:
    flags = np.zeros(n, dtype=bool)
    for start in starts:
        flags[start : start + count] = True
    return flags


def _bound(name: str, value: float | None, bound: float, unit: str) -> Check | str:
    """A promise about a figure; lengths are shown in mm."""
    if value is None:
        return name
    size, shown = (1e3, "mm") if unit == "m" else (1.0, unit)
    return Check(name, f"{size * value:.3g} {shown}", f"< {size * bound:g} {shown}", bool(value < bound))
