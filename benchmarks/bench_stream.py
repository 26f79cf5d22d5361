"""`qpsafe stream` against `qpsafe irc5-sim` on loopback, two processes, 250 Hz: how often is an answer late?

python benchmarks/bench_stream.py [--duration 600] [--busy 0 2] [--real-time no yes] [--out FILE]

The first experiment is played over and over. "missed": answered more than 4 ms after the packet arrived in the kernel,
superseded by a newer packet before it was answered, or lost. Memory: of the stream's process, from 5 s after the
first answer to the end.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from qpsafe.bench.clock import machine
from qpsafe.cli.outputs import try_file
from qpsafe.sim.irc5.compare import stream_process
from qpsafe.text.json_text import json_text
from qpsafe.text.words import growth

MAIN = "from qpsafe.cli.main import main; main()"
BUSY = "import numpy as np\nx = np.ones(10000)\nwhile True:\n    x = x * 1.0000001 + sum(range(1000)) * 1e-12"


def run(duration: float, busy: int, real_time: bool) -> dict[str, Any]:
    with ExitStack() as stack:
        stream = stack.enter_context(
            stream_process("--experiment", "fixed", "--real-time" if real_time else "--no-real-time")
        )
        for _ in range(busy):
            process = subprocess.Popen([sys.executable, "-c", BUSY])
            stack.callback(process.wait)
            stack.callback(process.kill)
        ports = [str(stream.addresses[name][1]) for name in ("the robot", "distances")]
        options = ["--port", ports[0], "--sensor-port", ports[1], "--event-port", "0", "--duration", str(duration)]
        options += ["--json", "--real-time"] if real_time else ["--json"]
        command = [sys.executable, "-c", MAIN, "irc5-sim", *options]
        robot = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            output, _ = robot.communicate(timeout=duration + 300.0)
        finally:
            robot.send_signal(signal.SIGTERM)
            robot.wait(timeout=60.0)
    return {
        "duration": duration,
        "busy": busy,
        "real_time": real_time,
        "stream": stream.report,
        "robot": json.loads(output),
    }


def show(result: dict[str, Any]) -> None:
    stream, robot = result["stream"], result["robot"]
    response, parts = stream["response"], stream["missed_parts"]
    granted = ", ".join(name for name, given in stream["granted"].items() if given)
    share = 100.0 * stream["missed"] / max(stream["packets"], 1)
    change = stream["memory"]["growth"]
    print(f"{result['duration']:g} s, {result['busy']} busy processes; granted: {granted}")
    answered, missed, packets = stream["answered_in_time"], stream["missed"], stream["packets"]
    print(f"  answered in time {answered} of {packets}, missed {missed}: {share:.4f} %")
    print("  " + ", ".join(f"{name}: {count}" for name, count in parts.items()))
    times = (f"{key} {1e3 * response[key]:.3f} ms" for key in ("p50", "p99", "p99.9", "maximum"))
    print("  response: " + ", ".join(times))
    counts = robot["counts"]
    print(
        f"  robot: {counts['sent']} cycles, {counts['missed']} without an answer, {robot['late']} began more than 4 ms"
        f" late themselves (latest {1e3 * robot['latest']:.1f} ms)"
    )
    print("  memory: " + ("unknown" if change is None else growth(change)))
    beat, tick = stream["watchdog"]["oldest_heartbeat"], stream["longest_controller_tick"]
    print(f"  oldest heartbeat {1e3 * beat:.1f} ms, longest controller tick {1e3 * tick:.2f} ms, {stream['causes']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=600.0, help="of each run [s]")
    parser.add_argument("--busy", type=int, nargs="+", default=[0, 2], help="busy processes beside it")
    parser.add_argument("--real-time", choices=("no", "yes"), nargs="+", default=["no", "yes"])
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if arguments.out:
        try_file("bench_stream", "--out", arguments.out)
    results = []
    print("; ".join(f"{key}: {value}" for key, value in machine().items() if key in ("processor", "system", "python")))
    for real_time in arguments.real_time:
        for busy in arguments.busy:
            results.append(run(arguments.duration, busy, real_time == "yes"))
            show(results[-1])
            sys.stdout.flush()
    if arguments.out:
        content = {"machine": machine(), "results": results}
        arguments.out.write_text(json_text(content) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
