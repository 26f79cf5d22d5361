"""What suspension and return decide, written once for Python and for compiled code.

These functions know no arrays and no objects. `Recovery` runs them in Python for tasks and trajectories of any kind;
`qpsafe.batch` compiles them, by `inline`, for those whose numbers it has. What takes looking up is asked for by
`ask(question, of, time)`, and only when the answer matters: `of` is whatever is needed to answer.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

#: Phases by their code, and what they are called.
FOLLOWING, SUSPENDED, RECOVERING = range(3)
PHASES = ("following", "suspended", "recovering")

#: Questions: are all references finite; are all essential tasks met; is everything that is active back on the path; is
#: an event due at the given time?
FINITE, MET, BACK, DUE = range(4)
Ask = Callable[[int, Any, float], bool]

#: What a task on its way back does: it is held where it is, sets out, goes on.
HOLD, SET_OUT, GO_ON = range(3)


def phases_by(ask: Ask) -> tuple[Callable[..., tuple[int, bool]], Callable[..., tuple[float, float, bool]]]:
    """The steps of the state machine and of its clock, for whoever answers their questions."""

    def next_phase(phase: int, changed: bool, danger: bool, waits: bool, time: float, of: Any) -> tuple[int, bool]:
        """Phase of this tick, and whether all tasks have to come back from where they are then.

        Args:
            phase: Of the last tick.
            changed: Whether the tasks are others since.
            danger: Whether there is too much of it to go on.
            waits: Whether it has not been small for long enough to come back.
            time: On the path [s].
            of: Handed on to who answers.
        """
        left = changed and phase == FOLLOWING and not ask(MET, of, time)
        if danger:
            return SUSPENDED, True
        if waits and phase == SUSPENDED:
            return SUSPENDED, left
        if left or phase == SUSPENDED:
            return (RECOVERING if ask(FINITE, of, time) else SUSPENDED), left
        if phase == RECOVERING and not ask(BACK, of, time):
            return RECOVERING, False
        return FOLLOWING, False

    def advance(
        time: float, rate: float, paused: bool, step: float, dt: float, events: bool, of: Any
    ) -> tuple[float, float, bool]:
        """Time on the path and rate of its clock after a tick; and whether an event waits for its tasks.

        Args:
            time: On the path [s].
            rate: Of its clock, 0 to 1.
            paused: Whether it is to come to rest.
            step: Largest change of the rate.
            dt: Tick [s].
            events: Whether there are any.
            of: Handed on to who answers.
        """
        rate = max(rate - step, 0.0) if paused else min(rate + step, 1.0)
        ahead = time + rate * dt
        waits = events and ask(DUE, of, ahead) and not ask(MET, of, time)  # no grip beside the part
        return (time if waits else ahead), rate, waits

    return next_phase, advance


def quiet_after(quiet: float, cdf_n: float, calm: float, dt: float) -> float:
    """How long danger has been small [s].

    Args:
        quiet: Up to the last tick [s].
        cdf_n: Danger now.
        calm: Up to which it is small.
        dt: Tick [s].
    """
    return quiet + dt if cdf_n <= calm else 0.0  # false for NaN


def ways_by(too_fast: Callable[[Any], bool]) -> Callable[[bool, bool, Any], int]:
    """What pending tasks do, for whoever tells whether what is left of an evasive motion is faster than a return."""

    def way_on(returning: bool, active: bool, of: Any) -> int:
        """`HOLD`, `SET_OUT` or `GO_ON`.

        Args:
            returning: Whether the task is on its way.
            active: Whether it is fully active; a released task is not pulled.
            of: Handed on to `too_fast`.
        """
        if not active:
            return HOLD
        if returning:
            return GO_ON
        return HOLD if too_fast(of) else SET_OUT

    return way_on


def length(x: float, y: float, z: float) -> float:
    """Of a vector.

    Args:
        x, y, z: Its parts.
    """
    return sqrt(x * x + y * y + z * z)


def return_time(mean: float, shortest: float) -> float:
    """Duration of a return [s] that would take `mean` at its peak speed; that of `minimum_jerk` is 15/8 of the mean."""
    return max(15.0 / 8.0 * mean, shortest)


def minimum_jerk(tau: float) -> tuple[float, float]:
    """s(τ) = 10 τ³ - 15 τ⁴ + 6 τ⁵ and ds/dτ for τ in [0, 1]: from rest to rest."""
    tau = min(max(tau, 0.0), 1.0)
    left = 1.0 - tau
    return tau * tau * tau * (10.0 - 15.0 * tau + 6.0 * tau * tau), 30.0 * (tau * tau) * (left * left)


def run_out(tau: float) -> tuple[float, float]:
    """r(τ) = τ - 6 τ³ + 8 τ⁴ - 3 τ⁵ and dr/dτ for τ in [0, 1]: from speed 1 to rest where it began, as smoothly."""
    tau = min(max(tau, 0.0), 1.0)
    square = tau * tau
    return (
        tau - square * tau * (6.0 - 8.0 * tau + 3.0 * square),
        1.0 - square * (18.0 - 32.0 * tau + 15.0 * square),
    )


def fading(s: float, ds: float, r: float, dr: float, duration: float) -> tuple[float, float, float, float]:
    """Shares (a, b, c, d) of a return: its offset is now a o + b v, which changes by c o + d v; it began as o, v.

    Args:
        s, ds: `minimum_jerk` of the share of time that is over.
        r, dr: `run_out` of it.
        duration: Of the return [s].
    """
    return 1.0 - s, r * duration, -ds / duration, dr
