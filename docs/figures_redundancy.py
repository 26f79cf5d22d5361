"""Draw docs/img/redundancy.png: the elbow of a seven-joint arm makes way in its null space, the tool stays.

What the page says of it goes into docs/data/redundancy.json.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from noted import note

import qpsafe

HERE = Path(__file__).parent / "img"
TIMES = (0.0, 4.0, 6.0, 8.0, 12.0)


def run(damping: float, duration: float = 12.0) -> dict[str, np.ndarray]:
    """Joint positions and what examples/redundant_elbow.py prints, tick by tick."""
    robot = qpsafe.load_robot("iiwa14")
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    controller = qpsafe.SafetyController(robot, tasks, evasion=qpsafe.Evasion(damping / 5.0, damping, robot.nq))
    q, qd, rows = robot.home, np.zeros(robot.nq), []
    for k in range(round(duration / controller.dt) + 1):
        t = k * controller.dt
        person = np.array([0.177, np.interp(t, (1.0, 4.0), (2.0, 1.15)), 0.741])
        tick = controller.step(q, qd, points=[person])
        assert tick.regime == "low"
        off = [np.linalg.norm(task.error(robot.pose("tcp", q), here.sample(0.0))) for task in tasks]
        rest, elbow = (np.linalg.norm(robot.pose("dh3", x)[:3, 3] - person) for x in (robot.home, q))
        rows.append((t, tick.cdf_n, elbow, rest, *off, *q))
        q, qd = tick.reference.q, tick.reference.qd
    table = np.array(rows).T
    return dict(zip(("t", "cdf_n", "elbow", "rest", "position", "orientation"), table, strict=False)) | {
        "q": table[6:].T
    }


def main() -> None:
    """The arm from the front, distances and errors."""
    robot, log = qpsafe.load_robot("iiwa14"), run(2.0)
    figure = plt.figure(figsize=(9.6, 4.4), layout="constrained")
    left, upper, lower = figure.subplot_mosaic("ab;ac", width_ratios=(1.0, 1.5)).values()
    colours = plt.get_cmap("viridis_r")(np.linspace(0.15, 1.0, len(TIMES)))
    for time, colour in zip(TIMES, colours, strict=True):
        ends = np.array([robot.pose(f, log["q"][round(time / 0.004)])[:3, 3] for f in robot.wire_end_frames])
        left.plot(ends[:, 1], ends[:, 2], "-o", color=colour, linewidth=2.0, markersize=4, label=f"{time:.0f} s")
    left.annotate("person", (0.08, 0.741), (0.24, 0.741), va="center", arrowprops={"arrowstyle": "->"})
    left.set_xlabel("y [m]")
    left.set_ylabel("z [m]")
    left.set_xlim(-0.42, 0.44)
    left.set_aspect("equal")
    left.legend(loc="lower left", title="time")
    upper.plot(log["t"], log["rest"], "--", color="#c0392b", label="elbow at rest")
    upper.plot(log["t"], log["elbow"], color="#0b5fa5", label="elbow makes way")
    upper.set_ylabel("person to elbow [m]")
    upper.set_ylim(0.0, None)
    upper.legend(loc="lower left")
    lower.plot(log["t"], 1e3 * log["position"], color="#0b5fa5", label="position [mm]")
    lower.plot(log["t"], 1e3 * log["orientation"], color="#2e8b57", label="orientation [mrad]")
    lower.axhline(1.0, color="#555555", linestyle=":", label="allowed")
    lower.set_yscale("log")
    lower.set_ylim(1e-6, 10.0)
    lower.set_ylabel("tool error")
    lower.set_xlabel("time [s]")
    lower.legend(loc="lower right", ncols=3, fontsize="small")
    for axis in (left, upper, lower):
        axis.grid(color="#d0d0d0", linewidth=0.5)
    figure.savefig(HERE / "redundancy.png", dpi=160)
    note("redundancy", {f"{damping:g}": figures(run(damping)) for damping in (2.0, 20.0)})


def figures(log: dict[str, np.ndarray]) -> dict[str, float]:
    """What the page says of a run."""
    return {
        "distance": log["elbow"][-1],
        "gained": log["elbow"][-1] - log["rest"][-1],
        "position": log["position"].max(),
        "orientation": log["orientation"].max(),
        "danger": log["cdf_n"].max(),
    }


if __name__ == "__main__":
    main()
