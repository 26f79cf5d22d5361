"""Draw docs/img/barrier.png: the first approach of the first experiment without and with caps on the danger field."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

import qpsafe
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment

HERE = Path(__file__).parent / "img"
STYLES = {None: ("#555555", "--"), 10.5: ("#0b5fa5", "-"), 9.5: ("#c0392b", "-.")}


def main() -> None:
    """Run the three experiments and draw them."""
    robot = qpsafe.load_robot("irb140")
    figure, axes = plt.subplots(3, 1, figsize=(7.2, 6.4), sharex=True, layout="constrained")
    for cap, (colour, style) in STYLES.items():
        log = FixedExperiment(robot, duration=15.0, cap=cap).run()
        label = "no cap" if cap is None else f"Δ$_{{max}}$ = {cap}"
        seen = log.time > 4.0
        speed = np.linalg.norm(log.qd_ref, axis=1)
        for axis, values in zip(axes, (log.cdf_n, speed, log.board_distance), strict=True):
            axis.plot(log.time[seen], values[seen], color=colour, linestyle=style, label=label)
        print(
            f"{label}: CDF_n above 9.5 for {(log.cdf_n > 9.5).sum() * log.dt:.2f} s, largest {log.cdf_n.max():.2f}; "
            f"largest |q̇| {speed.max():.2f} rad/s; smallest distance {log.board_distance.min():.3f} m; "
            f"status {sorted(set(log.status))}"
        )
    for axis, label in zip(axes, ("CDF$_n$ [1/m]", "|q̇| [rad/s]", "robot to board [m]"), strict=True):
        axis.set_ylabel(label)
        axis.set_ylim(0.0, None)
        axis.grid(color="#d0d0d0", linewidth=0.5)
    axes[2].set_xlabel("time [s]")
    axes[0].legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0)
    figure.savefig(HERE / "barrier.png", dpi=160)


if __name__ == "__main__":
    main()
