"""Figures of a run: the four panels of the paper's Fig. 11, and true distances with and without the controller."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.activation import Activation
from qpsafe.sim.recording.log import RunLog
from qpsafe.text.figure_file import save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEDIUM, HIGH = "#fff2a8", "#f6b7ae"
_COMPONENT = (("#0b5fa5", "-"), ("#2a8c3c", "--"), ("#c0392b", "-."))
STYLE = {
    "font.size": 9,
    "axes.labelsize": 9,
    "axes.grid": True,
    "grid.color": "#d0d0d0",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "legend.fontsize": 8,
    "legend.framealpha": 1.0,
    "savefig.dpi": 160,
}


def figure_11(log: RunLog, path: Path, title: str = "", activation: Activation | None = None) -> None:
    """Distances, CDF_n with both thresholds, orientation and position error; medium shaded yellow, high red.

    Args:
        log: The run.
        path: PNG or PDF to write.
        title: Above the figure.
        activation: For the thresholds shown; the paper's by default.
    """
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure, axes = _figure(4, 7.2, 9.0, (1.75, 1.0, 1.0, 1.0))
        for axis in axes:
            shade(axis, log)
        _distances(axes[0], log)
        _danger(axes[1], log, activation or Activation())
        _components(axes[2], log, np.rad2deg(log.euler_error), ("φ", "θ", "ψ"), "(c) orientation\nerror [deg]")
        _components(axes[3], log, 1e3 * log.position_error, ("x", "y", "z"), "(d) position\nerror [mm]")
        axes[3].set_xlabel("time [s]")
        axes[3].set_xlim(log.time[0], log.time[-1])
        if title:
            figure.suptitle(plain(title), fontsize=10)
        save(figure, path)


def distance_figure(log: RunLog, without: NDArray[np.float64], path: Path) -> None:
    """True smallest distance robot-board with the controller and with the robot keeping its pose.

    Args:
        log: Of the run.
        without: That distance of a robot that keeps its pose, (ticks,) [m].
        path: The file to write.
    """
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure, (axis,) = _figure(1, 7.2, 3.0)
        shade(axis, log)
        axis.plot(log.time, log.board_distance, color="#0b5fa5", label="with the controller")
        axis.plot(log.time, without[: len(log.time)], color="#555555", linestyle="--", label="robot keeps its pose")
        axis.set(xlabel="time [s]", ylabel="robot to board [m]", xlim=(log.time[0], log.time[-1]), ylim=(0.0, None))
        _legend(axis)
        save(figure, path)


def _distances(axis: Axes, log: RunLog) -> None:
    colours = _palette(len(log.spot_names))
    for i, name in enumerate(log.spot_names):
        seen = np.where(np.isfinite(log.distances[:, i]), log.distances[:, i], np.nan)
        if np.isfinite(seen).any():
            axis.plot(log.time, seen, color=colours[i], linewidth=0.9, label=plain(name))
    axis.set_ylabel("(a) spot\ndistance [m]")
    axis.set_ylim(0.0, 0.85)
    _legend(axis, fontsize=6)


def _danger(axis: Axes, log: RunLog, activation: Activation) -> None:
    high, low = activation.levels
    axis.plot(log.time, log.cdf_n, color="#0b5fa5", label="CDF$_n$")
    axis.axhline(high.start, color="#c0392b", linestyle="--", label="Δ(1-ε)")
    axis.axhline(low.start, color="#2a8c3c", linestyle="-.", label="Δ$_f$(1-ε$_f$)")
    axis.set_ylabel("(b) danger\nCDF$_n$ [1/m]")
    axis.set_ylim(0.0, None)
    for name, colour in (("medium", MEDIUM), ("high", HIGH)):
        axis.fill_between([], [], color=colour, label=name)
    _legend(axis)


def _components(axis: Axes, log: RunLog, values: NDArray[np.float64], names: tuple[str, ...], label: str) -> None:
    if values.shape[1] > 3:  # several tools: the norm of each
        values = np.linalg.norm(values.reshape(len(values), -1, 3), axis=2)
        names = tuple(f"tool {i + 1}" for i in range(values.shape[1]))
    for i, name in enumerate(names):
        colour, style = _COMPONENT[i]
        axis.plot(log.time, np.abs(values[:, i]), color=colour, linestyle=style, linewidth=1.1, label=name)
    axis.set_ylabel(label)
    axis.set_ylim(0.0, None)
    _legend(axis)


def _legend(axis: Axes, **options: Any) -> None:
    """Beside the panel, where it covers no data."""
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0, **options)


def shade(axis: Axes, log: RunLog) -> None:
    """Medium danger yellow, high danger red."""
    for item in log.intervals():
        if item.name in ("medium", "high"):
            axis.axvspan(item.start, item.end, color=MEDIUM if item.name == "medium" else HIGH, linewidth=0)


def _palette(count: int) -> list[Any]:
    import matplotlib

    return [matplotlib.colormaps["turbo"](0.05 + 0.9 * i / max(count - 1, 1)) for i in range(count)]


def _figure(rows: int, width: float, height: float, ratios: tuple[float, ...] | None = None) -> tuple[Any, Any]:
    """A figure that no window system knows of, and its panels with a common time axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]


def plain(text: str) -> str:
    """A name from a file for a figure: matplotlib takes what stands between dollars for mathematics."""
    return text.replace("$", r"\$")
