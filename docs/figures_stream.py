"""Draw the figure of docs/how-to/stream.md: ``python docs/figures_stream.py`` writes docs/img/stream-faults.png."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

import qpsafe
from qpsafe.sim.irc5.bench import Workbench
from qpsafe.sim.irc5.link import NO_FAULTS, WireFaults

IMG = Path(__file__).resolve().parent / "img"
COLOURS = {
    "idle": "#dddddd",
    "seeding": "#cfe3f5",
    "running": "#e4efe0",
    "degraded": "#fff2a8",
    "stopping": "#f8cfa0",
    "stopped": "#f6b7ae",
}
JOINT = 1
STYLE: dict[str, Any] = {"font.size": 9, "legend.fontsize": 8, "legend.frameon": False, "savefig.dpi": 160}


def faults() -> plt.Figure:
    """Motors off, a restart, a wire that is cut, and an acknowledgement, one after the other."""
    bench = Workbench(qpsafe.load_robot("irb140"))
    for _ in range(500):
        bench.turn()
    acts = {
        100: ("motors off", lambda: bench.irc5.motors(False)),
        250: ("motors on", lambda: bench.irc5.motors(True)),
        550: ("restart", lambda: bench.irc5.restart(0.1)),
        950: ("wire cut", lambda: setattr(bench.out, "faults", WireFaults(loss=1.0))),
        1025: ("wire mended", lambda: setattr(bench.out, "faults", NO_FAULTS)),
        1200: ("acknowledged", lambda: bench.here.loop.acknowledge()),
    }
    turns = []
    for k in range(1600):
        if k in acts:
            acts[k][1]()
        turns.append(bench.turn())
    time = 0.004 * np.arange(len(turns))
    q = np.rad2deg([turn.q[JOINT] for turn in turns])
    none = np.full(6, np.nan)
    q_ref = np.rad2deg([(none if turn.q_ref is None else turn.q_ref)[JOINT] for turn in turns])
    qd_ref = np.rad2deg([(none if turn.qd_ref is None else turn.qd_ref)[JOINT] for turn in turns])

    figure, axes = plt.subplots(2, 1, figsize=(8.4, 4.4), sharex=True, layout="constrained")
    axes[0].plot(time, q, color="#555555", linewidth=2.4, label="measured")
    axes[0].plot(time, q_ref, color="#0b5fa5", linewidth=1.0, label="reference sent")
    axes[1].plot(time, qd_ref, color="#0b5fa5", linewidth=1.0)
    axes[0].set_ylabel("joint 2 [deg]")
    axes[1].set_ylabel("its speed reference [deg/s]")
    axes[1].set_xlabel("time [s]")
    states = [turn.state for turn in turns]
    edges = [0, *(k for k in range(1, len(states)) if states[k] != states[k - 1]), len(states)]
    for axis in axes:
        for a, b in pairwise(edges):
            axis.axvspan(0.004 * a, 0.004 * b, color=COLOURS[states[a]], linewidth=0)
        for k in acts:
            axis.axvline(0.004 * k, color="black", linewidth=0.6, linestyle=":")
        axis.margins(x=0)
    for k, (name, _) in acts.items():
        axes[0].annotate(
            name, (0.004 * k, 1.0), (2, 3), xycoords=("data", "axes fraction"), textcoords="offset points", rotation=25
        )
    patches = [plt.Rectangle((0, 0), 1, 1, color=COLOURS[name]) for name in dict.fromkeys(states)]
    lines, names = axes[0].get_legend_handles_labels()
    figure.legend([*lines, *patches], [*names, *dict.fromkeys(states)], loc="outside lower center", ncols=7)
    return figure


if __name__ == "__main__":
    with plt.rc_context(STYLE):
        faults().savefig(IMG / "stream-faults.png")
