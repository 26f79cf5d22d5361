"""Draw docs/img/plugins.png and outside.png: mink alone and with qpsafe's tasks and limits.

What the pages say of them goes into docs/data/plugins.json.
"""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import mink
import mujoco
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from noted import note

import qpsafe
from qpsafe.plugins.mink import DangerLimit, DangerMonitor, EvasiveTask, JointLimit

HERE = Path(__file__).parent / "img"
DT, ROBOT = 0.004, qpsafe.load_robot("irb140")
MODEL = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))
STYLES = {"mink alone": ("#c0392b", "--"), "with EvasiveTask and DangerLimit": ("#0b5fa5", "-")}


def swing(evade: bool, duration: float = 14.0) -> np.ndarray:
    """The loop of examples/mink_evasion.py: time, hand to tool, tool to target, danger, largest joint speed."""
    start, rows = ROBOT.pose("tcp", ROBOT.home), []
    configuration, qd = mink.Configuration(MODEL, q=ROBOT.home), np.zeros(6)
    frame = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=0.3, gain=0.05)
    danger = DangerMonitor(ROBOT, DT)
    tasks, limits = [frame, mink.DampingTask(MODEL, 0.01)], [JointLimit(danger)]
    if evade:
        tasks, limits = [*tasks, EvasiveTask(danger)], [*limits, DangerLimit(danger, delta_max=12.0)]
    for t in DT * np.arange(round(duration / DT)):
        pose = start.copy()
        pose[1, 3] += 0.2 * np.sin(0.5 * np.pi * t)
        hand = start[:3, 3] + [0.05, np.interp(t, (4.0, 6.0, 10.0, 12.0), (1.2, 0.25, 0.25, 1.2)), 0.05]
        frame.set_target(mink.SE3.from_matrix(pose))
        danger.update(configuration.q, qd, [hand])
        tool = ROBOT.pose("tcp", configuration.q)[:3, 3]
        rows.append((t, np.linalg.norm(tool - hand), np.linalg.norm(tool - pose[:3, 3]), danger.cdf_n, abs(qd).max()))
        qd = mink.solve_ik(configuration, tasks, DT, "daqp", limits=limits)
        configuration.integrate_inplace(qd, DT)
    return np.array(rows).T


def draw_swing() -> dict[str, Any]:
    """Both loops over time."""
    found = {}
    figure, axes = plt.subplots(3, 1, figsize=(7.2, 6.2), sharex=True, layout="constrained")
    for (label, (colour, style)), evade in zip(STYLES.items(), (False, True), strict=True):
        t, gap, off, danger, speed = swing(evade)
        for axis, values in zip(axes, (gap, 1e3 * off, danger), strict=True):
            axis.plot(t, values, color=colour, linestyle=style, label=label)
        found[label] = {"distance": gap.min(), "danger": danger.max(), "speed": speed.max(), "error_at_end": off[-1]}
    for axis, label in zip(axes, ("hand to tool [m]", "tool off target [mm]", "CDF$_n$ [1/m]"), strict=True):
        axis.set_ylabel(label)
        axis.set_ylim(0.0, None)
        axis.grid(color="#d0d0d0", linewidth=0.5)
    axes[2].set_xlabel("time [s]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(HERE / "plugins.png", dpi=160)
    return found


def back(excess: float) -> tuple[np.ndarray, np.ndarray]:
    """Joint 2 started outside its upper limit, JointLimit in mink: position beyond the limit [rad], speed [rad/s]."""
    q = ROBOT.home.copy()
    q[1] = ROBOT.upper[1] + excess
    stay = mink.PostureTask(MODEL, cost=1.0, gain=0.1)
    stay.set_target(q)
    configuration, danger, qd, rows = mink.Configuration(MODEL, q), DangerMonitor(ROBOT, DT), np.zeros(6), []
    for _ in range(250):
        rows.append((configuration.q[1] - ROBOT.upper[1], qd[1]))
        danger.update(configuration.q, qd, [])
        qd = mink.solve_ik(configuration, [stay], DT, "daqp", limits=[JointLimit(danger)])
        configuration.integrate_inplace(qd, DT)
    return tuple(np.array(rows).T)


def mink_raises(excess: float) -> bool:
    """Whether `mink.solve_ik` with its own limits finds nothing from the same state."""
    q = ROBOT.home.copy()
    q[1] = ROBOT.upper[1] + excess
    stay = mink.PostureTask(MODEL, cost=1.0, gain=0.1)
    stay.set_target(q)
    speeds = dict(zip(ROBOT.joint_names, ROBOT.max_velocity, strict=True))
    try:
        limits = [mink.ConfigurationLimit(MODEL), mink.VelocityLimit(MODEL, speeds)]
        mink.solve_ik(mink.Configuration(MODEL, q), [stay], DT, "daqp", limits=limits)
    except mink.NoSolutionFound:
        return True
    return False


def draw_outside() -> dict[str, Any]:
    """Ways back inside from several starts; crosses where mink's own limits raise."""
    found = {}
    figure, axes = plt.subplots(2, 1, figsize=(7.2, 4.6), sharex=True, layout="constrained")
    for excess, colour in ((0.05, "#0b5fa5"), (0.02, "#2e8b57"), (0.01, "#8a5a00")):
        beyond, speed = back(excess)
        t, raises = DT * np.arange(len(beyond)), mink_raises(excess)
        axes[0].plot(t, 1e3 * beyond, color=colour, label=f"start {1e3 * excess:.0f} mrad outside")
        axes[1].plot(t, speed, color=colour)
        if raises:
            axes[0].plot(0.0, 1e3 * excess, "x", color="#c0392b", markersize=9, markeredgewidth=2, clip_on=False)
        found[f"{excess}"] = {
            "mink_raises": raises,
            "inside_after": t[np.argmax(beyond <= 1e-9)],
            "speed": np.abs(speed).max(),
            "acceleration": np.abs(np.diff(speed)).max() / DT,
        }
    axes[0].plot(
        [], [], "x", color="#c0392b", markersize=9, markeredgewidth=2, label="mink's own limits: NoSolutionFound"
    )
    axes[0].axhline(0.0, color="#555555", linewidth=0.8)
    axes[0].set_ylabel("joint 2 beyond\nits limit [mrad]")
    axes[1].set_ylabel("joint speed [rad/s]")
    axes[1].set_xlabel("time [s]")
    axes[1].set_xlim(-0.01, 0.7)
    for axis in axes:
        axis.grid(color="#d0d0d0", linewidth=0.5)
    axes[0].legend(loc="upper right")
    figure.savefig(HERE / "outside.png", dpi=160)
    return found


if __name__ == "__main__":
    note("plugins", {"swing": draw_swing(), "outside": draw_outside()})
