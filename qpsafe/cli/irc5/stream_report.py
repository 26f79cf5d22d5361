"""The report of `qpsafe stream` at its end, as JSON and for people."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from qpsafe.cli.irc5.stream_speaker import PERIOD, refused
from qpsafe.text.words import counted, growth

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.irc5.distances import SensorInput
    from qpsafe.irc5.loop import StreamLoop
    from qpsafe.irc5.process.realtime import Grant
    from qpsafe.irc5.process.watchdog import Watchdog
    from qpsafe.irc5.records.log import ReferenceWriter
    from qpsafe.irc5.run import StreamRun
    from qpsafe.irc5.streamer import EgmStreamer


def result_of(
    run: StreamRun,
    loop: StreamLoop,
    streamer: EgmStreamer,
    inlet: SensorInput | None,
    dog: Watchdog | None,
    grants: list[Grant],
    writer: ReferenceWriter | None,
) -> dict[str, Any]:
    """The report, as JSON shows it.

    Args:
        run: What the run was asked to be.
        loop: The loop, after it.
        streamer: The robot's end of it.
        inlet: Where distances came in; None without.
        dog: The watchdog; None if nobody watches.
        grants: What the system granted of real time.
        writer: Of the log; None without.
    """
    counts, supervisor = streamer.counts, loop.supervisor
    late = run.latency.above(PERIOD)
    lost = counts["missed"] + counts["superseded"] + counts["late"]
    asked = dog is not None and dog.asked > 0.0
    return {
        "good": run.good,
        "failure": run.failure,
        "troubles": run.troubles,
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
            "too old when read": counts["late"],
        },
        "response": run.latency.summary(),
        "histogram": dict(run.latency.decades()),
        "stamped_by_kernel": streamer.stamped,
        "longest_controller_tick": run.worst_tick,
        "memory": {"steady": run.started, "end": run.ended, "growth": run.ended - run.started if run.started else None},
        "datagrams": dict(sorted(counts.items())),
        "last_refusal": streamer.session.inbox.refusal,
        "refused": refused(counts, streamer.session.inbox.refusal),
        "sensors": None if inlet is None else vars(inlet.counts) | {"last_refusal": inlet.refusal},
        "events": {
            "counts": dict(run.happened),
            "last": [{"time": round(moment, 3), "name": name} for moment, name in run.events],
        },
        "log": None if writer is None else {"path": str(writer.path), "references": writer.count},
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
    for words in result["troubles"]:
        screen.print(words, style="red")
    if not result["answered"]:
        came = result["refused"]
        words = f"the robot was never answered: {came}" if came else "the robot never spoke"
        screen.print(words, style="yellow")
        return
    title = f"{result['duration']:.1f} s, {counted(result['packets'], 'packet')} of the robot"
    sheet = Sheet(title, ("in time", "missed", "share", "p50", "p99", "p99.9", "maximum"), text=())
    share = 100.0 * result["missed"] / max(result["packets"], 1)
    times = (f"{1e3 * response[key]:.3f} ms" for key in ("p50", "p99", "p99.9", "maximum"))
    sheet.add_row(str(result["answered_in_time"]), str(result["missed"]), f"{share:.3f} %", *times)
    screen.print(sheet)
    for name, count in result["missed_parts"].items():
        screen.print(f"  missed, {name}: {count}")
    clock = "arrival in the kernel" if result["stamped_by_kernel"] else "reading"
    screen.print(f"response, from {clock} to the answer:")
    total = max(sum(result["histogram"].values()), 1)
    for label, count in result["histogram"].items():
        bar = "#" * round(40 * count / total)
        screen.print(f"  {label:>16s} {count:9d} {bar}")
    memory = result["memory"]
    if memory["growth"] is not None:
        screen.print(f"memory: {memory['steady'] / 1e6:.1f} MB, {growth(memory['growth'])} since")
    for name, count in result["events"]["counts"].items():
        screen.print(f"event {name}: {count}")
    if result["failure"]:
        screen.print(f"the loop failed: {result['failure']}", style="red")
    if not result["at_rest"]:
        screen.print("the stream fell silent before the robot was at rest", style="red")
