"""Draw docs/img/irc5.png: one joint through the life of an EGM session, with the robot's packets made here."""

from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from qpsafe import JointLimits, JointReference
from qpsafe.irc5.messages import RobotPacket, decode_sensor, encode_robot
from qpsafe.irc5.session import EgmSession, Phase

HERE = Path(__file__).parent / "img"
DT, ROBOT = 0.004, ("127.0.0.1", 5000)
#: From, to [s], what happens.
STOPPED, LOST, OFF, STOP = (0.0, 0.3), (1.6, 1.72), (2.5, 2.9), 4.1
SHADES = {Phase.HOLDING: "#f2c9c4", Phase.RAMPING: "#f7e6b5", Phase.STOPPING: "#f7e6b5", Phase.STOPPED: "#f2c9c4"}


def run(duration: float = 5.0) -> dict[str, np.ndarray]:
    """Time, source, answered position and speed, measured position, phase; NaN where there is none."""
    session = EgmSession(JointLimits([-2.0], [2.0], [3.0], [12.0], DT))
    q = goal = source = 0.4
    speed, start, rows = 0.0, 0.0, []
    for k in range(round(duration / DT)):
        t = k * DT
        off, lost = OFF[0] <= t < OFF[1], LOST[0] <= t < LOST[1]
        q += DT * (-0.15 if off else 5.0 * (goal - q) + speed)  # EGM's motion law; without motors it sinks a little
        if t >= STOP and session.phase == Phase.RUNNING:
            session.stop("asked to")
        answered = (np.nan, np.nan)
        if not lost:
            rapid = "stopped" if t < STOPPED[1] else "running"
            said = RobotPacket(k, 4 * k, np.array([q]), motors_on=not off, rapid=rapid, clock=t)
            session.offer(encode_robot(said), ROBOT, t)
            cycle = session.take()
            assert cycle is not None
            source, start = (q, t) if cycle.seeded else (source, start)
            qd = 0.9 * np.sin(2.0 * (t - start)) if cycle.moving else 0.0
            source += qd * DT
            data = session.answer(JointReference(k, t, np.array([source]), np.array([qd])))
            assert data is not None
            answer = decode_sensor(data, 1)
            goal, speed = answered = float(answer.q_ref[0]), float(answer.qd_ref[0])
        rows.append(
            (t, source if session.phase in (Phase.RAMPING, Phase.RUNNING) else np.nan, *answered, q, session.phase)
        )
    names = ("time", "source", "q", "qd", "measured", "phase")
    return {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}


def main() -> None:
    """Draw position and speed over time, the phases behind them."""
    log = run()
    time = log["time"]
    figure, axes = plt.subplots(2, 1, figsize=(7.2, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2))
    axes[0].plot(time, log["source"], color="#c0392b", linestyle=":", linewidth=2, label="source")
    axes[0].plot(time, log["q"], color="#0b5fa5", label="answered")
    axes[0].plot(time, log["measured"], color="#555555", linestyle="--", linewidth=1, label="measured")
    axes[1].plot(time, log["qd"], color="#0b5fa5")
    changes = [0, *(np.flatnonzero(log["phase"][1:] != log["phase"][:-1]) + 1), len(time)]
    for first, end in pairwise(changes):
        phase = Phase(log["phase"][first])
        since, until = time[first], time[end - 1] + DT
        for axis in axes:
            axis.axvspan(since, until, color=SHADES.get(phase, "white"), linewidth=0)
        place = (until - 0.02, "right") if phase == Phase.STOPPED else ((since + until) / 2, "center")
        axes[0].text(place[0], 1.02, phase, ha=place[1], transform=axes[0].get_xaxis_transform(), fontsize=7)
    for axis in axes:
        axis.axvspan(*LOST, color="#d9d9d9", linewidth=0)
        axis.grid(color="#d0d0d0", linewidth=0.5)
        axis.set_xlim(0.0, time[-1])
    for at, text in (
        (STOPPED[0], "RAPID stopped"),
        (LOST[0], "30 packets lost"),
        (OFF[0], "motors off"),
        (STOP, "stop()"),
    ):
        axes[1].annotate(text, (at + 0.02, 0.04), xycoords=("data", "axes fraction"), fontsize=7)
    axes[0].set_ylabel("joint [rad]")
    axes[1].set_ylabel("speedRef [rad/s]")
    axes[1].set_ylim(-1.25, 1.1)
    axes[1].set_xlabel("time [s]")
    axes[0].legend(loc="upper left", bbox_to_anchor=(1.005, 1.0), borderaxespad=0.0)
    figure.savefig(HERE / "irc5.png", dpi=160)


if __name__ == "__main__":
    main()
