"""A check of a program over time: distances, joint margins, shares of speed and acceleration, singular value."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qpsafe.check.joints import position_margins
from qpsafe.check.singular import SINGULAR
from qpsafe.sim.drawing.plots import plain
from qpsafe.text.figure_file import save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from qpsafe.check.check import PathCheck

LIMIT = "#c0392b"


def check_figure(check: PathCheck, path: Path, title: str = "") -> None:
    """Four panels above each other; legends stand beside them.

    Args:
        check: What was found.
        path: PNG or PDF to write.
        title: Above the figure.
    """
    import matplotlib
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 8.6), layout="constrained")
    distances, margins, shares, values = figure.subplots(4, 1, sharex=True)
    way, robot = check.path, check.robot
    times = way.times
    for gap, series, name, colour in (
        (check.furniture, check.furniture_distances, "to the cell", "#0b5fa5"),
        (check.own, check.own_distances, "to itself", "#2a8c3c"),
    ):
        if gap is not None:
            distances.plot(times, 1e3 * series, color=colour, label=name)
            distances.plot(gap.time, 1e3 * gap.distance, "o", color=colour, markersize=4, label="smallest " + name)
    if check.furniture is not None:
        distances.axhline(1e3 * check.clearance, color=LIMIT, linestyle="--", linewidth=1.0, label="asked for")
    distances.set_ylabel("smallest distance\n[mm]")

    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, robot.nq))
    spans = np.where(robot.endless, 1.0, robot.upper - robot.lower)
    near = 100.0 * position_margins(robot, way) / (0.5 * spans)
    for j, name in enumerate(robot.joint_names):
        if not robot.endless[j]:
            margins.plot(times, near[:, j], color=colours[j], linewidth=1.0, label=plain(name))
    margins.axhline(0.0, color=LIMIT, linestyle="--", linewidth=1.0, label="limit")
    margins.set_ylabel("distance to a joint limit\n[% of half its range]")

    speed, rate = np.abs(way.qd) / robot.max_velocity, np.abs(way.qdd) / robot.max_acceleration
    shares.plot(times, 100.0 * speed.max(axis=1, initial=0.0), color="#0b5fa5", label="speed")
    shares.plot(times, 100.0 * rate.max(axis=1, initial=0.0), color="#2a8c3c", linewidth=0.8, label="acceleration")
    shares.axhline(100.0, color=LIMIT, linestyle="--", linewidth=1.0, label="limit")
    shares.set_ylabel("fastest joint\n[% of its limit]")

    values.plot(times, check.singular_values, color="#0b5fa5", label="smallest")
    values.axhline(SINGULAR, color=LIMIT, linestyle="--", linewidth=1.0, label="asked for")
    values.set(ylabel="singular value\n[m/rad, 1]", xlabel="time [s]")
    for axis in (distances, margins, shares, values):
        _finish(axis)
    if title:
        figure.suptitle(plain(title), fontsize=10)
    with matplotlib.rc_context({"savefig.dpi": 160}):
        save(figure, path)


def _finish(axis: Axes) -> None:
    axis.grid(True, color="#d0d0d0", linewidth=0.5)
    axis.set_axisbelow(True)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=7, borderaxespad=0.0)
    low, high = axis.get_ylim()
    axis.set_ylim(min(low, 0.0), high)
