"""Timing: rows take turns, block by block, so that what disturbs the machine disturbs all of them."""

from __future__ import annotations

import gc
import platform
import time
from collections.abc import Callable, Mapping
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np

#: Calls in a block; short against what disturbs a machine, long enough to fill the caches again.
BLOCK = 50


class Row(NamedTuple):
    """Something to time.

    Attributes:
        call: `call(k)` is the k-th call.
        collector: The garbage collector while timing: "off", as a 250 Hz loop would have it; "on"; or "frozen", on, but
            after `gc.freeze` it does not look at what was there before.
        share: How many things of the kind that is timed a call does, such as ticks of so many robots; times are of one.
    """

    call: Callable[[int], Any]
    collector: str = "off"
    share: int = 1

    @property
    def calls(self) -> int:
        """Calls in a block."""
        return max(BLOCK // self.share, 1)


class Times(NamedTuple):
    """Wall times [s], and what they are of the row that all are compared with.

    Attributes:
        runs: Number of calls.
        median, p99, p999, maximum: Percentiles of single calls.
        ratio: Median of the ratios of the blocks' medians, block by block; NaN where nothing is compared with.
        ratio_low, ratio_high: Their quartiles.
    """

    runs: int
    median: float
    p99: float
    p999: float
    maximum: float
    ratio: float = float("nan")
    ratio_low: float = float("nan")
    ratio_high: float = float("nan")


def time_rows(
    rows: Mapping[str, Row],
    runs: int,
    peer: str | None = None,
    warm_up: int = 200,
    progress: Callable[[int], None] | None = None,
) -> dict[str, Times]:
    """Time the calls of all rows one by one, a block of each in turn, after `warm_up` calls that do not count.

    Args:
        rows: What is timed, by name.
        runs: Calls of each row, rounded up to whole blocks.
        peer: The row that the others are compared with.
        warm_up: Calls before.
        progress: Told after every round how many calls have been made since it was told last.
    """
    blocks = -(-runs // BLOCK)
    taken = {name: np.empty((blocks, row.calls)) for name, row in rows.items()}
    for row in rows.values():
        for k in range(-max(warm_up // row.share, min(warm_up, 1)), 0):
            row.call(k)
    gc.collect()
    try:
        for block in range(blocks):
            for name, row in rows.items():
                _collect(row.collector)
                times = taken[name][block]
                for i in range(row.calls):
                    start = time.perf_counter()
                    row.call(block * row.calls + i)
                    times[i] = (time.perf_counter() - start) / row.share
                gc.unfreeze()
            if progress is not None:
                progress(BLOCK * len(rows))
    finally:
        gc.enable()
        gc.unfreeze()
    return {name: _summary(times, None if peer is None else taken[peer]) for name, times in taken.items()}


def _collect(how: str) -> None:
    if how == "off":
        gc.disable()
        return
    gc.enable()
    if how == "frozen":
        gc.freeze()


def _summary(times: np.ndarray, peer: np.ndarray | None) -> Times:
    figures = [float(value) for value in np.percentile(times, (50.0, 99.0, 99.9, 100.0))]
    if peer is None:
        return Times(times.size, *figures)
    ratios = np.median(times, axis=1) / np.median(peer, axis=1)
    return Times(times.size, *figures, *(float(value) for value in np.percentile(ratios, (50.0, 25.0, 75.0))))


def machine() -> dict[str, str]:
    """What the figures were measured on."""
    packages = ("numpy", "numba", "pin", "qpsolvers", "daqp", "mujoco")
    return {
        "processor": _processor(),
        "system": platform.platform(),
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
