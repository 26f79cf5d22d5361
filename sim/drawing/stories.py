"""Figures of stories: who walks where, seen from above, and how near people came to the robot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.sim.drawing.plots import HIGH, MEDIUM, STYLE, plain, shade
from qpsafe.sim.recording.log import RunLog
from qpsafe.text.figure_file import save

if TYPE_CHECKING:
    from qpsafe.sim.stories.story import Story

COLOURS = ("#0b5fa5", "#c0392b", "#2a8c3c", "#8e44ad", "#d35400")


def plan_figure(story: Story, path: Path, title: str = "") -> None:
    """Ways, footprints, and what hands reach for, seen from above; times along the ways.

    Args:
        story: To be drawn, from its beginning to its end.
        path: PNG or PDF to write.
        title: Above the figure; the story's own by default.
    """
    import matplotlib

    with matplotlib.rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.2, 5.4), layout="constrained")
        axis = figure.subplots()
        circle = np.linspace(0.0, 2.0 * np.pi, 61)
        axis.fill(0.17 * np.cos(circle) - 0.06, 0.17 * np.sin(circle), color="#555555")
        axis.plot(0.81 * np.cos(circle), 0.81 * np.sin(circle), color="#555555", linestyle=":", linewidth=0.9)
        axis.text(0.0, -0.84, "reach 0.81 m", ha="center", va="top", fontsize=7, color="#555555")
        for actor, colour in zip(story.people, _colours(len(story.people)), strict=True):
            _draw(axis, actor, story.duration, colour)
        axis.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title=plain(title or story.table.title))
        figure.legend(loc="outside lower center", ncols=len(story.people))
        save(figure, path)


def _draw(axis: Any, actor: Any, duration: float, colour: str) -> None:
    times = np.arange(0.0, duration + 1e-9, 0.05)
    roots = np.array([actor.root(t) for t in times])
    axis.plot(roots[:, 0], roots[:, 1], color=colour, linewidth=1.4, label=f"{plain(actor.name)}, {actor.end:.1f} s")
    axis.plot(*roots[0, :2], "o", color=colour, markersize=5)
    for side in actor.footprints(duration):
        for foot in side:
            toe = (foot.x + 0.13 * math.cos(foot.yaw), foot.y + 0.13 * math.sin(foot.yaw))
            heel = (foot.x - 0.05 * math.cos(foot.yaw), foot.y - 0.05 * math.sin(foot.yaw))
            axis.plot(*zip(heel, toe, strict=True), color=colour, alpha=0.3, linewidth=4.0, solid_capstyle="round")
    last = -math.inf
    for step in actor.steps:
        if step.do == "walk" and step.start - last > 1.0:
            x, y, _ = actor.root(step.start)
            axis.annotate(f"{step.start:.0f} s", (x, y), (3, 5), textcoords="offset points", fontsize=7, color=colour)
            last = step.start
        if step.do == "reach":
            for hand in actor.reached(step):
                axis.plot(*hand[:2], "x", color=colour, markersize=7)


def encounter_figure(log: RunLog, path: Path, title: str = "") -> None:
    """True distances of robot to people and boards, danger, and how fast the robot moves, over time.

    Args:
        log: Of the run.
        path: The file to write.
        title: Of the figure.
    """
    import matplotlib

    with matplotlib.rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.2, 5.4), layout="constrained")
        axes = figure.subplots(3, 1, sharex=True)
        for axis in axes:
            shade(axis, log)
        axes[0].plot(log.time, log.person_distance, color=COLOURS[0], label="people")
        if np.isfinite(log.board_distance).any():
            axes[0].plot(log.time, log.board_distance, color=COLOURS[4], linestyle="--", label="boards")
        axes[0].axhline(0.0, color="#c0392b", linewidth=0.9)
        axes[0].set(ylabel="distance\nto robot [m]", ylim=(min(-0.05, 1.1 * float(log.person_distance.min())), 2.0))
        axes[1].plot(log.time, log.cdf_n, color=COLOURS[0])
        axes[1].set(ylabel="CDF$_n$ [1/m]", yscale="symlog", ylim=(0.0, None))
        axes[2].plot(log.time, np.abs(log.qd).max(axis=1), color=COLOURS[0])
        axes[2].set(ylabel="fastest joint\n[rad/s]", xlabel="time [s]", ylim=(0.0, None))
        axes[2].set_xlim(log.time[0], log.time[-1])
        for name, colour in (("medium", MEDIUM), ("high", HIGH)):
            axes[0].fill_between([], [], color=colour, label=f"{name} danger")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0)
        if title:
            figure.suptitle(plain(title), fontsize=10)
        save(figure, path)


def _colours(count: int) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k in range(count)]
