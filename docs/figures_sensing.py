"""Draw the figures of docs/reference/sensing.md: ``python docs/figures_sensing.py`` writes docs/img/sensing-*.png.

What the pages say of them goes into docs/data/sensing.json.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from noted import note

import qpsafe
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sharp import PEAK, SharpConverter, SharpCurve
from qpsafe.sensing.skin.calibration_plot import calibration_figure
from qpsafe.sim.world.sharp import SharpModel, SharpSensors

FOUND: dict[str, float] = {}
IMG = Path(__file__).resolve().parent / "img"
BLUE, RED, GREY, GREEN = "#0b5fa5", "#c0392b", "#777777", "#2a8c3c"
STYLE = {
    "font.size": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d0d0d0",
    "grid.linewidth": 0.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
}


def curve() -> plt.Figure:
    """Twenty units' voltage over distance, and what the converter makes of one voltage."""
    sensors = SharpSensors(20)
    typical = SharpSensors(1, SharpModel(spread=0.0, bias_spread=0.0))
    d = np.linspace(0.01, 1.5, 600)
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.3))
    left.axvspan(0, 100 * PEAK, color="#f6b7ae", label="ambiguous: nearer than the peak")
    left.axvspan(20, 80, color="#e4efe0", label="used: 20 to 80 cm")
    left.plot(100 * d, sensors.voltage(np.repeat(d[:, None], 20, axis=1)), color=GREY, linewidth=0.4)
    left.plot(100 * d, typical.voltage(d[:, None]), color=BLUE, linewidth=1.8, label="typical unit")
    left.set(xlabel="distance [cm]", ylabel="voltage [V]", xlim=(0, 150), ylim=(0, 3.3), title="20 simulated units")
    left.legend(loc="upper right", frameon=True, facecolor="white", framealpha=1.0)
    read = SharpConverter([SharpCurve()], stuck_after=None)
    seen = np.array([read.distances(v)[0] for v in typical.voltage(d[:, None])])
    right.plot([0, 100], [0, 100], color=GREY, linewidth=0.8, linestyle="--", label="true")
    near = d < PEAK
    right.plot(100 * d[near], 100 * seen[near], color=RED, linewidth=1.8, label="wrong: nearer than 15 cm")
    right.plot(100 * d[~near], 100 * seen[~near], color=BLUE, linewidth=1.8, label="read, +inf beyond 80 cm")
    right.set(xlabel="true distance [cm]", ylabel="distance read [cm]", xlim=(0, 100), ylim=(0, 100))
    right.set_title("what a voltage is taken for")
    right.legend(loc="upper left")
    return figure


def calibration() -> plt.Figure:
    """Twenty units identified from 13 noisy pairs each, checked with other noisy samples."""
    sensors = SharpSensors(20)
    names = tuple(f"spot {i}" for i in range(20))
    fits = sensors.identified(names)
    figure = calibration_figure(fits)
    right = figure.axes[1]
    converter = SharpConverter([fit.curve for fit in fits], range_max=2.0)
    errors, places = [], []
    for d in np.linspace(0.20, 0.80, 31):
        for k in range(60):
            read = converter.distances(sensors.sample(np.full(20, d)))
            if k >= 40:
                errors.append(read - d)
                places.append(np.full(20, d))
    e, x = np.concatenate(errors), np.concatenate(places)
    right.plot(100 * x, 100 * e, ".", color=GREY, markersize=1.0, zorder=0)
    share = float((np.abs(e) <= 0.01).mean())
    right.set_title(f"live samples (grey): {100 * share:.2f} % within 1 cm")
    right.set_ylim(-1.8, 1.8)
    FOUND["within_1_cm"], FOUND["error_95"] = share, float(np.percentile(np.abs(e), 95))
    return figure


def hold() -> plt.Figure:
    """What counts when readings jump: the hold in action."""
    robot = qpsafe.load_robot("irb140")
    spots = qpsafe.load_spots(robot)
    from qpsafe.sensing.sensing import DistanceSensing

    sensing = DistanceSensing(robot, spots, 0.004)
    state, wire = robot.at(robot.home), robot.wire(robot.home, np.zeros(6))
    origin = spots.rays(state)[0][19]
    t = np.arange(0.0, 2.0, 0.004)
    d = np.where(t < 0.3, 0.6, np.where(t < 0.32, np.inf, np.where(t < 0.6, 0.6, np.inf)))
    d[(t >= 0.9) & (t < 1.3)] = 0.7
    d[np.searchsorted(t, 1.1)] = 0.35
    d[(t >= 1.3) & (t < 1.34)] = np.nan
    d[(t >= 1.34) & (t < 1.6)] = 0.7
    d[t >= 1.6] = np.nan
    counted, capped = np.full(len(t), np.nan), np.zeros(len(t), dtype=bool)
    for k, value in enumerate(d):
        distances = np.full(20, np.inf)
        distances[19] = value
        seen = sensing.update(state, wire, distances)
        if len(seen.points):
            counted[k] = np.linalg.norm(seen.points[0] - origin)
        capped[k] = seen.severity != "clear"
    figure, axis = plt.subplots(figsize=(8.4, 2.9))
    axis.fill_between(t, 0, 1, where=capped, color="#fff2a8", label="speed capped, until acknowledged")
    axis.fill_between(t, 0, 1, where=np.isnan(d), color="#f6b7ae", label="not a number")
    axis.plot(t, np.where(np.isfinite(d), d, np.nan), ".", color=GREY, markersize=2.5, label="read (+inf: nothing)")
    axis.plot(t, counted, color=BLUE, linewidth=1.6, label="counts")
    axis.set(xlabel="time [s]", ylabel="distance from spot [m]", xlim=(0, 2), ylim=(0, 0.85))
    for x, text in (
        (0.31, "20 ms nothing"),
        (0.62, "gone"),
        (1.1, "spike nearer"),
        (1.3, "40 ms NaN"),
        (1.62, "dead"),
    ):
        axis.annotate(text, (x, 0.76), fontsize=8, ha="center" if x < 1.5 else "left")
    axis.legend(loc="lower left", ncols=2)
    return figure


def velocity() -> plt.Figure:
    """A hand comes at 0.8 m/s to the tool of a resting robot: danger with and without the velocity estimate."""
    from qpsafe.sensing.sensing import DistanceSensing

    robot = qpsafe.load_robot("irb140")
    spots = qpsafe.load_spots(robot)
    state, wire = robot.at(robot.home), robot.wire(robot.home, np.zeros(6))
    field, activation = qpsafe.DangerField(), qpsafe.Activation()
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 2.4, 0.004)
    true = np.interp(t, [0.0, 0.4, 0.9, 1.4, 1.9, 2.4], [0.75, 0.75, 0.35, 0.35, 0.75, 0.75])
    figure, axes = plt.subplots(3, 1, figsize=(8.4, 5.2), sharex=True)
    axes[0].plot(t, true, color=GREY)
    axes[0].set_ylabel("true distance\n[m]")
    for name, colour, noise in (("ideal distances", BLUE, 0.0), ("5 mm of noise", RED, 0.005)):
        sensing = DistanceSensing(robot, spots, 0.004, SensingRules(velocities=True))
        speed, still, moving = [], [], []
        for d in true:
            distances = np.full(20, np.inf)
            distances[19] = d + rng.normal(0.0, noise)
            seen = sensing.update(state, wire, distances)
            assert seen.velocities is not None
            speed.append(np.linalg.norm(seen.velocities[0]))
            still.append(field.value(seen.points, wire)[0])
            moving.append(field.value(seen.points, wire, seen.velocities)[0])
        axes[1].plot(t, speed, color=colour, linewidth=1.2, label=f"estimate, {name}")
        axes[2].plot(t, moving, color=colour, linewidth=1.2, label=f"with the estimate, {name}")
        if not noise:
            first = {
                key: t[np.argmax(np.array(v) > activation.suspend_above)] for key, v in (("s", still), ("m", moving))
            }
            FOUND["earlier"] = first["s"] - first["m"]
            axes[2].plot(t, still, color=GREY, linewidth=1.6, label="obstacle taken as standing still (paper)")
    approach = np.maximum(-np.gradient(true, t), 0.0)
    axes[1].plot(t, approach, color=GREY, linestyle="--", linewidth=1.0, label="true")
    axes[1].set_ylabel("approach\n[m/s]")
    axes[2].axhline(activation.suspend_above, color=GREEN, linestyle="--", label="Δ(1-ε): high danger")
    axes[2].set(ylabel="danger at the\npoint [1/m]", xlabel="time [s]", xlim=(0, 2.4))
    for axis in axes[1:]:
        axis.legend(loc="upper right")
    return figure


def main() -> None:
    """Draw them all."""
    with matplotlib.rc_context(STYLE):
        for name, draw in (("curve", curve), ("calibration", calibration), ("hold", hold), ("velocity", velocity)):
            draw().savefig(IMG / f"sensing-{name}.png", dpi=160)
    note("sensing", FOUND)


if __name__ == "__main__":
    main()
