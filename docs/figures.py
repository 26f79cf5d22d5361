"""Draw the figures of the documentation: ``python docs/figures.py [NAME ...]`` writes docs/img/NAME.png.

What the pages say of them goes into docs/data/NAME.json.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import BoundaryNorm
from noted import note

import qpsafe
from qpsafe.danger.activation import regime_weights
from qpsafe.limits import stopping_speed

IMG = Path(__file__).resolve().parent / "img"
LOW, MEDIUM, HIGH = "#e4efe0", "#fff2a8", "#f6b7ae"  # regimes, as in the figures of the demo
BLUE, RED, GREY = "#0b5fa5", "#c0392b", "#555555"
STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d0d0d0",
    "grid.linewidth": 0.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}


def danger_field() -> plt.Figure:
    """The field in the vertical plane through the arm, at rest and with the tip moving forward at 0.5 m/s."""
    robot, field, activation = qpsafe.load_robot("irb140"), qpsafe.DangerField(), qpsafe.Activation()
    forward = np.linalg.pinv(robot.jacobian("tcp", robot.home)[:3]) @ [0.5, 0.0, 0.0]
    x, z = np.meshgrid(np.linspace(-0.8, 1.6, 241), np.linspace(-0.2, 1.6, 181))
    points = np.stack((x, np.zeros_like(x), z), axis=-1).reshape(-1, 3)
    levels = [2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 30, 50, 100]
    colours = matplotlib.colormaps["YlOrRd"]
    norm = BoundaryNorm(levels, colours.N, extend="both")

    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.3), sharey=True)
    for axis, qd, title in zip(axes, (0.0 * forward, forward), ("at rest", "tip moving at 0.5 m/s"), strict=True):
        wire = robot.wire(robot.home, qd)
        value = field.value(points, wire).reshape(x.shape)
        filled = axis.contourf(x, z, value, levels, cmap=colours, norm=norm, extend="both")
        for threshold, dash in zip(activation.thresholds, ("-", "--"), strict=True):
            line = axis.contour(x, z, value, [threshold.start], colors="black", linewidths=1.1, linestyles=dash)
            axis.clabel(line, fmt=f"{threshold.start:g}", fontsize=8, manual=[(0.9 if dash == "-" else 1.2, 1.2)])
        for start, end in zip(wire.starts, wire.ends, strict=True):
            axis.plot([start[0], end[0]], [start[2], end[2]], color=BLUE, linewidth=2.5, solid_capstyle="round")
        ends = np.vstack((wire.starts[:1], wire.ends))
        axis.plot(ends[:, 0], ends[:, 2], "o", color=BLUE, markersize=4, markeredgecolor="white", markeredgewidth=0.5)
        if qd.any():
            tip = wire.ends[-1]
            axis.annotate(
                "", (tip[0] + 0.3, tip[2]), (tip[0], tip[2]), arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 1.6}
            )
        axis.set(title=title, xlabel="x [m]", aspect="equal")
        axis.grid(False)
    axes[0].set_ylabel("z [m]")
    bar = figure.colorbar(filled, ax=axes, label="CDF [1/m]", ticks=levels, shrink=0.95)
    bar.ax.minorticks_off()
    return figure


def laws() -> plt.Figure:
    """Switches m and f, and the weights of the three regimes, over CDF_n."""
    activation = qpsafe.Activation()
    danger = np.linspace(4.0, 15.0, 1101)
    m, f = np.array([activation.switches(value) for value in danger]).T
    weights = np.array([regime_weights(activation.activations(value)) for value in danger]).T

    figure, (upper, lower) = plt.subplots(2, 1, figsize=(6.6, 4.4), sharex=True)
    upper.plot(danger, m, color=RED, label="m, position task (19)")
    upper.plot(danger, f, color=BLUE, linestyle="--", label="f, orientation task (21)")
    upper.set(ylabel="switch", ylim=(-0.05, 1.35), yticks=(0.0, 0.5, 1.0))
    upper.legend(loc="upper right", ncols=2, frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
    names = ("high danger: evasion", "medium: position, evasion", "low: position, orientation, evasion")
    lower.stackplot(danger, weights[::-1], colors=(LOW, MEDIUM, HIGH), edgecolor=GREY, linewidth=0.5)
    for name, place in zip(names, (13.9, 9.6, 5.1), strict=True):
        lower.text(place, 0.5, name.replace(": ", ":\n").replace(", ", ",\n"), ha="center", va="center", fontsize=8)
    lower.set(ylabel="weight of the regime", xlabel="CDF$_n$ [1/m]", ylim=(0.0, 1.0), xlim=(danger[0], danger[-1]))
    edges = [edge for threshold in activation.thresholds[::-1] for edge in (threshold.start, threshold.end)]
    sides = ("center", "right", "left", "center")
    texts = ("Δ$_f$(1-ε$_f$)", "Δ$_f$(1+ε$_f$)", "Δ(1-ε)", "Δ(1+ε)")
    for edge, text, side in zip(edges, texts, sides, strict=True):
        upper.axvline(edge, color=GREY, linewidth=0.6, linestyle=":")
        place = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        upper.annotate(f"{text}\n= {edge:g}", (edge, 1.0), (0, 4), ha=side, fontsize=8, **place)
    for axis in (upper, lower):
        axis.grid(False)
    return figure


def limits() -> plt.Figure:
    """Joint 2 of the IRB 140 driven at full speed against its limit: the exact formula and sqrt(2 a s)."""
    robot, dt = qpsafe.load_robot("irb140"), 0.004
    v_max, a = float(robot.max_velocity[1]), float(robot.max_acceleration[1])
    curves = {}
    for name, rule, hard in (
        ("stopping speed of the box", lambda s: stopping_speed(s, a, dt), True),
        ("√(2as), braking at most a", lambda s: np.sqrt(2.0 * a * s), True),
        ("√(2as), whatever it takes", lambda s: np.sqrt(2.0 * a * s), False),
    ):
        s, v, log = 1.0, v_max, []
        for _ in range(300):
            want = min(v_max, rule(s)) if s >= 0.0 else 0.0
            new = max(want, v - a * dt) if hard else want
            log.append((s, (v - new) / (a * dt)))
            s, v = s - new * dt, new
        curves[name] = np.array(log)
    _, late, hard = curves.values()
    note("limits", {"beyond": -late[:, 0].min(), "deceleration": hard[:, 1].max()})

    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.2))
    time = 1e3 * dt * (np.arange(300) - np.argmax(curves["stopping speed of the box"][:, 0] < 1e-9))
    for (name, log), colour, dash in zip(curves.items(), (BLUE, RED, GREY), ("-", "--", ":"), strict=True):
        left.plot(time, 1e3 * log[:, 0], dash, color=colour, marker=".", markersize=4, label=name)
        right.plot(time, log[:, 1], dash, color=colour, marker=".", markersize=4, label=name)
    left.axhline(0.0, color="black", linewidth=1.0)
    left.text(-98, -1.5, "beyond the limit", fontsize=8, va="top")
    left.set(xlim=(-100, 30), ylim=(-12, 60), xlabel="time [ms]", ylabel="distance to the limit [mrad]")
    left.legend(loc="upper right")
    right.axhline(1.0, color="black", linewidth=1.0)
    right.set(xlim=(-380, 30), ylim=(-0.05, 1.5), xlabel="time [ms]", ylabel="deceleration / a")
    figure.get_layout_engine().set(wspace=0.08)
    return figure


def controller() -> plt.Figure:
    """An obstacle comes and goes: danger, activations, errors and phases tick by tick."""
    robot = qpsafe.load_robot("irb140")
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    control = qpsafe.SafetyController(robot, tasks)
    q, qd, ticks = robot.home, np.zeros(6), []
    for k in range(2500):
        gap = np.interp(k * control.dt, (0.0, 0.5, 3.0, 4.5, 7.0), (1.1, 1.1, 0.2, 0.2, 1.1))
        ticks.append(control.step(q, qd, points=[here.pose[:3, 3] + [gap, 0.0, 0.1]]))
        q, qd = ticks[-1].reference.q, ticks[-1].reference.qd
    time = np.array([tick.reference.time for tick in ticks])
    phases = [tick.phase for tick in ticks]
    changes = [k for k in range(1, len(ticks)) if phases[k] != phases[k - 1]]
    note("controller", {"phases": [{"time": time[k], "phase": phases[k]} for k in changes]})

    figure, axes = plt.subplots(3, 1, figsize=(7.0, 6.0), sharex=True)
    regimes = [tick.regime for tick in ticks]
    cuts = [0, *(k for k in range(1, len(ticks)) if regimes[k] != regimes[k - 1]), len(ticks) - 1]
    for begin, end in pairwise(cuts):
        for axis in axes:
            axis.axvspan(time[begin], time[end], color={"low": LOW, "medium": MEDIUM, "high": HIGH}[regimes[begin]])
        if time[end] - time[begin] > 0.5:
            axes[0].text(0.5 * (time[begin] + time[end]), 15.0, regimes[begin], ha="center", fontsize=8)
    axes[0].plot(time, [tick.cdf_n for tick in ticks], color="black")
    for threshold, dash in zip(control.activation.thresholds, ("-", "--"), strict=True):
        axes[0].axhline(threshold.start, color=GREY, linestyle=dash, linewidth=0.8)
    axes[0].set(ylabel="CDF$_n$ [1/m]", ylim=(4.0, 16.0))
    axes[1].plot(time, [tick.activations[0] for tick in ticks], color=RED, label="a$_1$ = m")
    axes[1].plot(time, [tick.activations[1] for tick in ticks], color=BLUE, linestyle="--", label="a$_2$ = m f")
    axes[1].set(ylabel="activation", ylim=(-0.08, 1.08))
    axes[1].legend(loc="center right")
    norms = np.array([[np.linalg.norm(error) for error in tick.errors] for tick in ticks])
    axes[2].plot(time, 1e3 * norms[:, 0], color=RED, label="position [mm]")
    axes[2].plot(time, np.rad2deg(norms[:, 1]), color=BLUE, linestyle="--", label="orientation [deg]")
    axes[2].set(ylabel="error", xlabel="time [s]", xlim=(time[0], time[-1]))
    axes[2].legend(loc="center right")
    return figure


FIGURES = {"danger-field": danger_field, "laws": laws, "limits": limits, "controller": controller}

if __name__ == "__main__":
    with matplotlib.rc_context(STYLE):
        for name in sys.argv[1:] or FIGURES:
            FIGURES[name]().savefig(IMG / f"{name}.png")
