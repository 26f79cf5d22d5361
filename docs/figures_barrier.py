"""Draw docs/img/barrier.png: the first approach of the first experiment without and with caps on the danger field.

What the page says of it goes into docs/data/barrier.json.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from noted import note

import qpsafe
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment

HERE = Path(__file__).parent / "img"
STYLES = {None: ("#555555", "--"), 10.5: ("#0b5fa5", "-"), 9.5: ("#c0392b", "-.")}


def main() -> None:
    """Run the three experiments and draw them."""
    robot, found = qpsafe.load_robot("irb140"), {}
    figure, axes = plt.subplots(3, 1, figsize=(7.2, 6.4), sharex=True, layout="constrained")
    for cap, (colour, style) in STYLES.items():
        experiment = FixedExperiment(robot, duration=15.0, cap=cap)
        log, board = experiment.run(), experiment.board_distance_without_controller()
        label = "no cap" if cap is None else f"Δ$_{{max}}$ = {cap}"
        seen = log.time > 4.0
        speed = np.linalg.norm(log.qd_ref, axis=1)
        for axis, values in zip(axes, (log.cdf_n, speed, log.board_distance), strict=True):
            axis.plot(log.time[seen], values[seen], color=colour, linestyle=style, label=label)
        still = (np.diff(board, prepend=np.nan) == 0.0) & (board < board.min() + 1e-6)  # the nearest pause
        found["none" if cap is None else str(cap)] = {
            "danger": log.cdf_n.max(),
            "danger_in_pause": log.cdf_n[still].max(),
            "distance": log.board_distance.min(),
            "speed": speed.max(),
        }
    for axis, label in zip(axes, ("CDF$_n$ [1/m]", "|q̇| [rad/s]", "robot to board [m]"), strict=True):
        axis.set_ylabel(label)
        axis.set_ylim(0.0, None)
        axis.grid(color="#d0d0d0", linewidth=0.5)
    axes[2].set_xlabel("time [s]")
    axes[0].legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0)
    figure.savefig(HERE / "barrier.png", dpi=160)
    note("barrier", found)


if __name__ == "__main__":
    main()
