"""What a run leaves behind: one row a tick, the intervals of its regimes, and a CSV file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.text.whole_file import whole_file
from qpsafe.text.words import counted
from qpsafe.tick import Tick

Array = NDArray[np.float64]


class Interval(NamedTuple):
    """A stretch of time [start, end) in one regime; `end` is the start of the next one [s]."""

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class RunLog:
    """A finished run, N ticks, k spots, n joints. Errors are of the commanded pose unless said otherwise.

    Attributes:
        dt: Tick [s].
        time: (N,) [s].
        distances: Readings of the spots, and the nearest in each range sensor's last image (N, k) [m]; +inf where
            nothing was seen.
        cdf_n: (N,).
        m, f: Switches (N,).
        regime, phase, status: (N,) words.
        q_ref, qd_ref: Commanded joint position and velocity (N, n) [rad, rad/s].
        q, qd: Measured ones, at the start of the tick (N, n).
        orientation_error, position_error: Commanded pose against the reference (N, 3) [rad, m]; of a robot with several
            tools one after the other (N, 3 tools), as in the next three.
        measured_orientation_error, measured_position_error: The plant's pose against it (N, 3) [rad, m].
        euler_error: The paper's orientation error, difference of ZYX Euler angles (N, 3) [rad].
        board_distance, person_distance: Smallest true distance robot-board, robot-person (N,) [m].
        solve_time: Wall time of `step` (N,) [s]; the only part that differs between equal runs.
        messages: (tick, message) of everything unusual.
        spot_names: Of the spots, then of the range sensors (k,).
        metrics: What the user measured, (N,) or (N, k) by name; see `Control.metrics`.
    """

    dt: float
    time: Array
    distances: Array
    cdf_n: Array
    m: Array
    f: Array
    regime: NDArray[np.str_]
    phase: NDArray[np.str_]
    status: NDArray[np.str_]
    q_ref: Array
    qd_ref: Array
    q: Array
    qd: Array
    orientation_error: Array
    position_error: Array
    measured_orientation_error: Array
    measured_position_error: Array
    euler_error: Array
    board_distance: Array
    person_distance: Array
    solve_time: Array
    messages: tuple[tuple[int, str], ...]
    spot_names: tuple[str, ...]
    metrics: Mapping[str, Array] = field(default_factory=dict)

    def __repr__(self) -> str:
        regimes = {name: int((self.regime == name).sum()) for name in dict.fromkeys(self.regime.tolist())}
        rows, odd = counted(len(self.time), "tick"), int((self.status != "ok").sum())
        return f"RunLog({rows}, dt={self.dt:.4g}, {regimes}, cdf_n<={self.cdf_n.max():.4g}, {odd} not ok)"

    def intervals(self, shortest: float = 0.0) -> list[Interval]:
        """Regimes in the order they were entered; those shorter than `shortest` [s] are merged into the one before."""
        return intervals(self.time, self.regime, self.dt, shortest)

    def joint_rates(self) -> tuple[Array, Array]:
        """Velocity (N-1, n) and acceleration (N-2, n) of the commanded positions, by differences."""
        qd = np.diff(self.q_ref, axis=0) / self.dt
        return qd, np.diff(qd, axis=0) / self.dt

    def write_csv(self, path: Path) -> None:
        """Write everything but the wall times as CSV, whole or not at all."""
        names, columns = self._columns()
        with whole_file(path) as part, part.open("w", encoding="utf-8") as file:
            file.write(",".join(names) + "\n")
            for row in zip(*columns, strict=True):
                file.write(",".join(row) + "\n")

    def _columns(self) -> tuple[list[str], list[list[str]]]:
        names, columns = [], []

        def add(name: str, values: NDArray, unit: str = "") -> None:
            label = f"{name} [{unit}]" if unit else name
            if values.ndim == 1:
                names.append(label)
                columns.append([str(v) if values.dtype.kind == "U" else format(v, ".9g") for v in values])
            else:
                for i in range(values.shape[1]):
                    add(f"{name}_{i + 1}", values[:, i], unit)

        for name, unit in _CSV:
            add(name, getattr(self, name), unit)
        for name, values in self.metrics.items():
            add(name, values.reshape(len(values), -1) if values.ndim > 1 else values)
        return names, columns


_CSV = (
    ("time", "s"),
    ("cdf_n", "1/m"),
    ("m", ""),
    ("f", ""),
    ("regime", ""),
    ("phase", ""),
    ("status", ""),
    ("position_error", "m"),
    ("orientation_error", "rad"),
    ("euler_error", "rad"),
    ("measured_position_error", "m"),
    ("measured_orientation_error", "rad"),
    ("board_distance", "m"),
    ("person_distance", "m"),
    ("q_ref", "rad"),
    ("qd_ref", "rad/s"),
    ("q", "rad"),
    ("qd", "rad/s"),
    ("distances", "m"),
)


def intervals(time: Array, names: Sequence[str] | NDArray, dt: float, shortest: float = 0.0) -> list[Interval]:
    """Stretches of equal names; those shorter than `shortest` [s] are merged into the one before them.

    Args:
        time: Of every tick (ticks,) [s].
        names: Of every tick (ticks,).
        dt: Tick [s].
        shortest: [s].
    """
    found: list[Interval] = []
    for t, name in zip(time, names, strict=True):
        if found and found[-1].name == name:
            found[-1] = found[-1]._replace(end=float(t) + dt)
        else:
            found.append(Interval(str(name), float(t), float(t) + dt))
    merged: list[Interval] = []
    for item in found:
        if merged and (item.end - item.start < shortest or merged[-1].name == item.name):
            merged[-1] = merged[-1]._replace(end=item.end)
        else:
            merged.append(item)
    return merged


#: Fields of `RunLog` in the order of a recorded row.
_RECORDED = tuple(f.name for f in fields(RunLog) if f.name not in ("dt", "messages", "spot_names", "metrics"))


class Recorder:
    """Collects ticks and turns them into a `RunLog`."""

    def __init__(self, dt: float, spot_names: tuple[str, ...]) -> None:
        self.dt = dt
        self.spot_names = spot_names
        self._rows: list[tuple] = []
        self._messages: list[tuple[int, str]] = []
        self._metrics: dict[str, list[Array]] = {}

    def add(
        self,
        tick: Tick,
        q: Array,
        qd: Array,
        distances: Array,
        measured: tuple[Array, Array],
        euler: Array,
        gaps: tuple[float, float],
        *,
        errors: tuple[Array, Array] | None = None,
        metrics: Mapping[str, Array] | None = None,
    ) -> None:
        """Record one tick.

        Args:
            tick: From the controller.
            q, qd: Measured joints (n,).
            distances: Readings of the spots (k,).
            measured: Position (3 tools,) and orientation error (3 tools,) of the measured pose.
            euler: Euler-angle error of the commanded pose (3 tools,).
            gaps: Smallest true distances robot-board, robot-person [m].
            errors: Position (3 tools,) and orientation error (3 tools,) of the commanded pose; by default the tick's,
                whose tasks are then a position for each tool and an orientation for each.
            metrics: Of this tick, by name; the same names at every tick.
        """
        self._messages.extend((len(self._rows), message) for message in tick.messages)
        if errors is None:
            tools = len(tick.activations) // 2
            own = tick.errors or (np.full(3, np.nan),) * 2 * tools
            errors = np.concatenate(own[:tools]), np.concatenate(own[tools:])
        position, orientation = errors
        for name, value in (metrics or {}).items():
            self._metrics.setdefault(name, []).append(value)
        self._rows.append(
            (
                tick.reference.time,
                distances,
                tick.cdf_n,
                tick.m,
                tick.f,
                tick.regime,
                tick.phase,
                tick.status,
                tick.reference.q,
                tick.reference.qd,
                q,
                qd,
                orientation,
                position,
                measured[1],
                measured[0],
                euler,
                *gaps,
                tick.solve_time,
            )
        )

    def finish(self) -> RunLog:
        """The run so far as arrays."""
        columns = (np.array(column) for column in zip(*self._rows, strict=True))
        arrays: dict[str, Any] = dict(zip(_RECORDED, columns, strict=True))
        metrics = {name: np.array(values) for name, values in self._metrics.items()}
        return RunLog(dt=self.dt, messages=tuple(self._messages), spot_names=self.spot_names, metrics=metrics, **arrays)
