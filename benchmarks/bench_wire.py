"""The closed loop over the wire, with two processes, against the same loop in one process.

python benchmarks/bench_wire.py [--experiment fixed] [--duration 60] [--real-time] [--out FILE]
python benchmarks/bench_wire.py --experiment pick-and-place --cycles 10 --duration 200 [--only-lock-step]

In lock-step the robot waits for every answer, so that the wire has no delay. In real time an answer acts one cycle
after the packet that it answers, so the run in one process is given the same delay; what is left are cycles without
an answer in time.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from qpsafe.cli.outputs import try_file
from qpsafe.irc5.process.realtime import fifo
from qpsafe.robot.loader import load_robot
from qpsafe.sim.irc5.compare import Course, agreement, in_one_process, over_the_wire
from qpsafe.sim.irc5.motion import EgmSettings
from qpsafe.text.json_text import json_text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--experiment", default="fixed")
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--cycles", type=int, default=0, help="pick-and-place: end after so many screws")
    parser.add_argument("--real-time", action="store_true", help="SCHED_FIFO for both processes")
    parser.add_argument("--only-lock-step", action="store_true", help="nothing that needs an idle computer")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if arguments.out:
        try_file("bench_wire", "--out", arguments.out)
    name, duration, cycles = arguments.experiment, arguments.duration, arguments.cycles
    robot, settings = load_robot("irb140"), EgmSettings(ramp_in=0.05)
    here = in_one_process(name, robot, duration, settings, cycles=cycles)
    late = in_one_process(name, robot, duration, settings, delay=1, cycles=cycles)
    wire, seen, _ = over_the_wire(name, robot, duration, settings, lockstep=True, cycles=cycles)
    exact = agreement(wire.q, here.q)
    print(f"{name}, {0.004 * len(wire.q):.1f} s, joints move by up to {exact.moved:.3f} rad")
    tell("in one process", here)
    tell("in one process, one cycle of delay built in", late)
    print(f"lock-step, {seen.counts['answered']} answers: largest difference {exact.largest:.3g} rad")
    tell("lock-step", wire)
    content: dict[str, Any] = {
        "experiment": name,
        "lock_step": exact._asdict() | {"answers": seen.counts["answered"]} | fate(wire),
        "one_process": fate(here),
        "one_process_late": agreement(late.q, here.q)._asdict() | fate(late),
    }
    if not arguments.only_lock_step:
        if arguments.real_time:
            print(fifo(70).line)
        options = ["--real-time"] if arguments.real_time else []
        wire, seen, report = over_the_wire(name, robot, duration, settings, *options, lockstep=False, cycles=cycles)
        free = agreement(wire.q, late.q, most=25)
        straight = agreement(wire.q, here.q, most=25)
        counts = (
            f"{seen.counts['answered']} answered, {seen.counts['missed']} missed, {seen.late} cycles late themselves"
        )
        print(f"in real time ({counts}):")
        for text, found in (("one cycle of delay built in", free), ("no delay", straight)):
            print(
                f"  against one process, {text}: largest {found.largest:.3g} rad, rms {found.rms:.3g} rad,"
                f" moved by {found.shift} cycles"
            )
        tell("in real time", wire)
        content |= {
            "real_time": free._asdict() | fate(wire),
            "real_time_against_no_delay": straight._asdict(),
            "robot": seen.to_dict(),
            "stream": report,
        }
    if arguments.out:
        arguments.out.write_text(json_text(content) + "\n", encoding="utf-8")


def fate(course: Course) -> dict[str, Any]:
    """How long it took [s], and what became of the screws."""
    return {"duration": 0.004 * len(course.q), "deeds": course.deeds, "parts": course.parts}


def tell(text: str, course: Course) -> None:
    """Print it, if there were any."""
    if course.deeds:
        deeds = ", ".join(f"{kind} {count}" for kind, count in course.deeds.items())
        print(f"  {text}, {0.004 * len(course.q):.1f} s: {deeds}")


if __name__ == "__main__":
    main()
