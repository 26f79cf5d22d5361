"""Figure of the second experiment's runs side by side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qpsafe.danger.thresholds import robot_activation
from qpsafe.sim.drawing.plots import HIGH, MEDIUM, STYLE, shade
from qpsafe.sim.experiments.path.experiment import PathRun
from qpsafe.text.figure_file import save

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


def side_by_side(runs: Mapping[str, PathRun], robot: Robot, path: Path) -> None:
    """CDF_n, orientation and position error, place along the line and joint speed: a column a law.

    Args:
        runs: By name.
        robot: For its limits.
        path: PNG or PDF to write.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(3.4 * len(runs), 9.6), layout="constrained")
        axes = figure.subplots(5, len(runs), sharex=True, sharey="row", squeeze=False)
        high, low = robot_activation(robot).thresholds
        for column, (name, run) in zip(axes.T, runs.items(), strict=True):
            log = run.log
            position, orientation = (np.linalg.norm(e, axis=1) for e in (log.position_error, log.orientation_error))
            for axis in column:
                shade(axis, log)
            column[0].set_title(name)
            column[0].plot(log.time, log.cdf_n, color="#0b5fa5")
            column[0].axhline(high.start, color="#c0392b", linestyle="--")
            column[0].axhline(low.start, color="#2a8c3c", linestyle="-.")
            column[1].semilogy(log.time, np.maximum(orientation, 1e-9), color="#0b5fa5")
            column[2].semilogy(log.time, np.maximum(1e3 * position, 1e-6), color="#0b5fa5")
            column[3].plot(log.time, 1e3 * run.origin[:, 1], color="#555555", linestyle="--", label="path")
            tool = run.origin - log.position_error[:, :3]  # of the tool that follows the line
            column[3].plot(log.time, 1e3 * tool[:, 1], color="#0b5fa5", label="tool")
            column[4].plot(log.time, (np.abs(log.qd_ref) / robot.max_velocity).max(axis=1), color="#0b5fa5")
            column[4].set_xlabel("time [s]")
            column[4].set_xlim(log.time[0], log.time[-1])
        labels = ("CDF$_n$ [1/m]", "orientation error [rad]", "position error [mm]", "y [mm]", "fastest joint / limit")
        for axis, label in zip(axes[:, 0], labels, strict=True):
            axis.set_ylabel(label)
        axes[0, 0].set_ylim(0.0, None)
        axes[4, 0].set_ylim(0.0, None)
        low_end, high_end = axes[3, 0].get_ylim()
        axes[3, 0].set_ylim(low_end - 0.25 * (high_end - low_end), high_end)  # room for the legend
        axes[1, 0].axhline(1e-3, color="#c0392b", linewidth=0.8)
        axes[2, 0].axhline(2.0, color="#c0392b", linewidth=0.8)
        axes[3, 0].legend(loc="lower left", ncols=2)
        for word, colour in (("medium danger", MEDIUM), ("high danger", HIGH)):
            axes[0, 0].fill_between([], [], color=colour, label=word)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
        save(figure, path)
