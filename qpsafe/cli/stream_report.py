"""What `qpsafe stream` tells: transitions as they come, a status line, and the report at the end."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

from qpsafe.words import counted, growth

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.irc5.distances import SensorInput
    from qpsafe.irc5.loop import StreamLoop
    from qpsafe.irc5.realtime import Grant
    from qpsafe.irc5.run import StreamRun
    from qpsafe.irc5.streamer import EgmStreamer
    from qpsafe.irc5.watchdog import Watchdog
    from qpsafe.supervisor import Transition

PERIOD = 0.004  # an answer that takes longer comes after the robot's next packet [s]


def say(transition: Transition) -> None:
    """One line for a transition, with the time of the day."""
    text = str(transition)[13:].strip()
    sys.stderr.write(f"\r{time.strftime('%H:%M:%S')}  {text}\n")
    sys.stderr.flush()


def status_line(run: StreamRun, loop: StreamLoop) -> None:
    """Overwrite the status line."""
    late = run.latency.above(PERIOD)
    sys.stderr.write(f"\r{loop.supervisor.state:9s} {run.duration:8.0f} s  {run.latency.count} answers, {late} late ")
    sys.stderr.flush()


def result_of(
    run: StreamRun,
    loop: StreamLoop,
    streamer: EgmStreamer,
    inlet: SensorInput | None,
    dog: Watchdog | None,
    grants: list[Grant],
) -> dict[str, Any]:
    """The report, as JSON shows it."""
    counts, supervisor = streamer.counts, loop.supervisor
    late = run.latency.above(PERIOD)
    lost = counts["missed"] + counts["superseded"]
    asked = any("watchdog" in cause for cause in supervisor.causes)
    good = run.at_rest and not run.failure and not asked
    return {
        "good": good,
        "failure": run.failure,
        "at_rest": run.at_rest,
        "duration": run.duration,
        "packets": counts["accepted"] + counts["missed"],
        "answered": counts["answered"],
        "answered_in_time": counts["answered"] - late,
        "missed": lost + late,
        "missed_parts": {
            "answered after 4 ms": late,
            "superseded by a newer packet": counts["superseded"],
            "lost before": counts["missed"],
        },
        "response": run.latency.summary(),
        "histogram": dict(run.latency.decades()),
        "stamped_by_kernel": streamer.stamped,
        "longest_controller_tick": run.worst_tick,
        "memory": {"steady": run.started, "end": run.ended, "growth": run.ended - run.started if run.started else None},
        "datagrams": dict(sorted(counts.items())),
        "sensors": None if inlet is None else vars(inlet.counts),
        "watchdog": None if dog is None else {"limit": dog.limit, "oldest_heartbeat": dog.worst, "asked": asked},
        "granted": {grant.name: grant.granted for grant in grants},
        "state": supervisor.state.value,
        "stop_category": None if supervisor.category is None else supervisor.category.value,
        "causes": list(supervisor.causes),
        "transitions": [transition._asdict() for transition in supervisor.log],
    }


def show(result: dict[str, Any], screen: Console) -> None:
    """Print the report."""
    from qpsafe.cli.sheet import Sheet

    response = result["response"]
    screen.print()
    if not result["answered"]:
        screen.print("the robot never spoke", style="yellow")
        return
    title = f"{result['duration']:.1f} s, {counted(result['packets'], 'packet')} of the robot"
    sheet = Sheet(title, ("in time", "missed", "share", "p50", "p99", "p99.9", "maximum"), text=())
    share = 100.0 * result["missed"] / max(result["packets"], 1)
    times = (f"{1e3 * response[key]:.3f} ms" for key in ("p50", "p99", "p99.9", "maximum"))
    sheet.add_row(str(result["answered_in_time"]), str(result["missed"]), f"{share:.3f} %", *times)
    screen.print(sheet)
    for name, count in result["missed_parts"].items():
        screen.print(f"  missed, {name}: {count}", highlight=False)
    clock = "arrival in the kernel" if result["stamped_by_kernel"] else "reading"
    screen.print(f"response, from {clock} to the answer:", highlight=False)
    total = max(sum(result["histogram"].values()), 1)
    for label, count in result["histogram"].items():
        bar = "#" * round(40 * count / total)
        screen.print(f"  {label:>16s} {count:9d} {bar}", highlight=False)
    memory = result["memory"]
    if memory["growth"] is not None:
        screen.print(f"memory: {memory['steady'] / 1e6:.1f} MB, {growth(memory['growth'])} since")
    if result["failure"]:
        screen.print(f"the loop failed: {result['failure']}", style="red")
    if result["watchdog"] is not None and result["watchdog"]["asked"]:
        screen.print("the watchdog asked for a stop", style="red")
    if not result["at_rest"]:
        screen.print("the stream fell silent before the robot was at rest", style="red")
