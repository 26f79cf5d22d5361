"""The closed loop over the wire, with two processes, against the same loop in one process.

python benchmarks/bench_wire.py [--experiment fixed] [--duration 60] [--real-time] [--json FILE]

In lock-step the robot waits for every answer, so that the wire has no delay. In real time an answer acts one cycle
after the packet that it answers, so the run in one process is given the same delay; what is left are cycles without
an answer in time.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from qpsafe.irc5.realtime import fifo
from qpsafe.robot.loader import load_robot
from qpsafe.sim.irc5_compare import agreement, in_one_process, over_the_wire
from qpsafe.sim.irc5_motion import EgmSettings


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--experiment", default="fixed")
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--real-time", action="store_true", help="SCHED_FIFO for both processes")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    name, duration = arguments.experiment, arguments.duration
    robot, settings = load_robot("irb140"), EgmSettings(ramp_in=0.05)
    here = in_one_process(name, robot, duration, settings)
    wire, seen, _ = over_the_wire(name, robot, duration, settings, lockstep=True)
    exact = agreement(wire, here)
    print(f"{name}, {duration:g} s, joints move by up to {exact.moved:.3f} rad")
    print(f"lock-step, {seen.counts['answered']} answers: largest difference {exact.largest:.3g} rad")
    late = in_one_process(name, robot, duration, settings, delay=1)
    if arguments.real_time:
        print(fifo(70).line)
    options = ["--real-time"] if arguments.real_time else []
    wire, seen, report = over_the_wire(name, robot, duration, settings, *options, lockstep=False)
    free = agreement(wire, late, most=25)
    straight = agreement(wire, here, most=25)
    counts = f"{seen.counts['answered']} answered, {seen.counts['missed']} missed, {seen.late} cycles late themselves"
    print(f"in real time ({counts}):")
    for text, found in (("one cycle of delay built in", free), ("no delay", straight)):
        print(
            f"  against one process, {text}: largest {found.largest:.3g} rad, rms {found.rms:.3g} rad,"
            f" moved by {found.shift} cycles"
        )
    if arguments.json:
        content = {
            "lock_step": exact._asdict(),
            "real_time": free._asdict(),
            "real_time_against_no_delay": straight._asdict(),
            "robot": seen.to_dict(),
            "stream": report,
        }
        arguments.json.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
