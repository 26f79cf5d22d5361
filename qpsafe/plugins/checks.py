"""Arguments of the plug-ins, checked: a mistake is an error that names the argument."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.text.given import numbers, whole

Array = NDArray[np.float64]

#: No row may cost more: solvers square it.
DEAREST = 1e100


def checked_danger(where: str, danger: DangerMonitor) -> DangerMonitor:
    """The monitor, if it is one.

    Args:
        where: Who asks, for the error.
        danger: As given.
    """
    if not isinstance(danger, DangerMonitor):
        raise ConfigurationError(where, "danger", danger, "a DangerMonitor")
    return danger


def updated(danger: DangerMonitor) -> DangerMonitor:
    """The monitor, if it has ever been told anything: silence is not safety."""
    if danger.ticks == 0:
        expected = "danger.update(q, qd, points) before solve_ik, with points=[] where nothing is in sight"
        raise ConfigurationError("DangerMonitor", "ticks", 0, expected)
    return danger


def same_tick(danger: DangerMonitor, dt: float, where: str) -> DangerMonitor:
    """The monitor, if it has the tick that `solve_ik` was called with.

    Args:
        danger: The monitor.
        dt: That tick [s].
        where: Who asks, for the error.
    """
    check_tick(danger, dt, where)
    return danger


def check_tick(part: Any, dt: float, where: str) -> None:
    """Refuse a `solve_ik` with another tick than that of a part.

    Args:
        part: A monitor, or a `ClikTask`.
        dt: The tick of the call [s].
        where: Who asks, for the error.
    """
    if not math.isclose(dt, part.dt, rel_tol=1e-9):
        raise ConfigurationError(where, "dt", dt, f"the tick of its {type(part).__name__}, {part.dt} s")


def checked_priority(danger: DangerMonitor, priority: int) -> int:
    """The priority of a task that danger releases, if the monitor has a threshold for it.

    Args:
        danger: The monitor.
        priority: As given, from 1.
    """
    checked_danger("ReleasableTask", danger)
    count = len(danger.activation.levels)
    return whole("ReleasableTask", "priority", priority, f"1 to {count}, one a threshold", 1, count)


def checked_cost(where: str, cost: ArrayLike, rows: int) -> Array:
    """A cost for every row (rows,), from one number or as many.

    Args:
        where: Who asks, for the error.
        cost: As given.
        rows: How many there are.
    """
    expected = f"a number from 0 to {DEAREST:g}, or {rows} of them"
    array = numbers(where, "cost", cost, expected)
    if array.shape not in ((), (1,), (rows,)) or not ((array >= 0.0) & (array <= DEAREST)).all():  # false for NaN
        raise ConfigurationError(where, "cost", cost, expected)
    return np.broadcast_to(array, rows).copy()


def checked_prefix(where: str, prefix: str) -> str:
    """What stands before names in a model, if it is text.

    Args:
        where: Who asks, for the error.
        prefix: As given.
    """
    if not isinstance(prefix, str):
        raise ConfigurationError(where, "prefix", prefix, 'text before names of the model, e.g. "arm_"; "" for none')
    return prefix
