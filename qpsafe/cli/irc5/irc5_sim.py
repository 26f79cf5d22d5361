"""`qpsafe irc5-sim`: a simulated IRC5 at the other end of the wire."""

from __future__ import annotations

import math
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import Lag, RobotName, SensorName, console, load_named, print_json, write_text
from qpsafe.cli.irc5.stream import Experiment
from qpsafe.cli.outputs import output_file
from qpsafe.errors import ConfigurationError
from qpsafe.text.json_text import json_text
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.irc5.process import RobotRun

WHERE = "qpsafe irc5-sim"


def irc5_sim(
    experiment: Annotated[
        Experiment, typer.Option(help="Experiment that is played around the robot.")
    ] = Experiment.fixed,
    robot: RobotName = "irb140",
    host: Annotated[str, typer.Option(help="Address at which qpsafe stream listens.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Its port.")] = 6510,
    sensor_port: Annotated[int, typer.Option(min=0, max=65535, help="Port to send distances to; 0: none.")] = 6511,
    event_port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port at which names of events arrive; 0: any free one.")
    ] = 6512,
    sensor: Annotated[SensorName, typer.Option(help="Perfect distances, or simulated Sharp sensors.")] = (
        SensorName.ideal
    ),
    duration: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=1e9, help="Length of the run, from the first answer [s]; by default the experiment's."
        ),
    ] = (None),
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="Seed of people and faults; 0 is nominal.")] = 0,
    lockstep: Annotated[
        bool, typer.Option("--lock-step", help="Wait for every answer, so that every run is the same.")
    ] = False,
    gain: Annotated[float, typer.Option(min=0.0, max=20.0, help="Gain k of the motion law [1/s].")] = 5.0,
    lowpass: Annotated[float, typer.Option(min=0.0, max=100.0, help="LpFilter [Hz]; 0: none.")] = 20.0,
    max_speed_deviation: Annotated[float, typer.Option(min=0.1, help="MaxSpeedDeviation [deg/s].")] = 450.0,
    comm_timeout: Annotated[float, typer.Option(min=0.004, help="CommTimeout [s].")] = 1.0,
    cond_time: Annotated[float, typer.Option(min=0.004, help="CondTime [s]; by default infinite.")] = math.inf,
    robot_ramp_in: Annotated[float, typer.Option(min=0.0, help="RampInTime [s].")] = 0.05,
    lag: Lag = 0.012,
    retry: Annotated[
        float, typer.Option(min=0.0, help="Time after which RAPID restarts EGM when it has timed out [s].")
    ] = 1.0,
    loss: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of datagrams lost, each way.")] = 0.0,
    delay: Annotated[float, typer.Option(min=0.0, max=10.0, help="Delay each way, rounded to whole cycles [s].")] = 0.0,
    reorder: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of datagrams that arrive after the next one.")
    ] = 0.0,
    duplicate: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of datagrams that arrive twice.")] = 0.0,
    garbage: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of datagrams followed by garbage.")] = 0.0,
    wrong_sender: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of cycles with a datagram from another sender.")
    ] = 0.0,
    faulty: Annotated[str, typer.Option(metavar="START:LENGTH", help="Period in which the wire is bad [s].")] = "0:inf",
    restart: Annotated[
        list[float] | None, typer.Option(help="Time at which RAPID restarts [s]; may be repeated.")
    ] = None,
    motors_off: Annotated[
        list[str] | None, typer.Option(metavar="START:LENGTH", help="Period with motors off [s].")
    ] = None,
    rapid_stop: Annotated[
        list[str] | None, typer.Option(metavar="START:LENGTH", help="Period with RAPID stopped [s].")
    ] = None,
    real_time: Annotated[bool, typer.Option("--real-time", help="Request SCHED_FIFO, to keep cycles on time.")] = False,
    log: Annotated[
        Path | None, typer.Option(help="CSV of measured and referenced joint positions.", callback=output_file())
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Simulate an IRC5 under EGM that drives the MuJoCo plant, for qpsafe stream in another process.

    Faults are counted from the first answer. Distances of the simulated spots are sent along.
    """
    bad = span("--faulty", faulty)
    screen = console(json)
    screen.print("Loading ...", style="dim")
    from qpsafe.irc5.process import realtime

    realtime.one_thread()
    from qpsafe.cli.demos.any_robot import ready_name
    from qpsafe.irc5.process.requests import Requests
    from qpsafe.irc5.transport.addresses import host_address
    from qpsafe.irc5.transport.axes import axes_of_robot
    from qpsafe.sim.experiments.by_name import experiment_loop
    from qpsafe.sim.irc5.irc5_loop import Irc5Loop
    from qpsafe.sim.irc5.link import WireFaults
    from qpsafe.sim.irc5.motion import EgmSettings
    from qpsafe.sim.irc5.process import farewell, happenings, run_robot
    from qpsafe.sim.irc5.udp import UdpExchange

    address = host_address(WHERE, "--host", host)
    settings = EgmSettings(
        gain=gain,
        lowpass=lowpass,
        max_speed_deviation=math.radians(max_speed_deviation),
        comm_timeout=comm_timeout,
        cond_time=cond_time,
        ramp_in=robot_ramp_in,
        lag=lag,
        retry=retry,
    )
    faults = WireFaults(loss, delay, reorder, duplicate, garbage)
    todo = happenings(
        [moment("--restart", time) for time in restart or ()],
        [span("--motors-off", text) for text in motors_off or ()],
        [span("--rapid-stop", text) for text in rapid_stop or ()],
        faults,
        bad,
        wrong_sender,
    )
    if lockstep and todo:
        raise ConfigurationError(WHERE, "--lock-step", "with faults", "no faults: it waits for answers")
    found = load_named(ready_name(WHERE, robot, screen, 6, sensors=True), screen)
    loop, period = experiment_loop(experiment.value, found, seed=seed, sensor=sensor.value)
    length = period if duration is None else duration
    requests = Requests()
    exchange = UdpExchange(
        axes_of_robot(found),
        (address, port),
        (address, sensor_port) if sensor_port else None,
        event_port=event_port,
        seed=seed,
        lockstep=10.0 if lockstep else 0.0,  # who waits for the other keeps no real time
        patience=180.0,  # the other end may still have to compile
        over=lambda: bool(requests.leave),
    )
    again = None if experiment is Experiment.pick_and_place else period  # screws that were delivered stay there
    run = Irc5Loop(loop, exchange, settings, again)
    if real_time:
        screen.print(realtime.fifo(70).line, style="dim")
    realtime.fine_timers()
    realtime.freeze_garbage()
    with requests.heard(), closing(exchange):
        screen.print(f"sending to {host}:{port}; Ctrl-C ends")
        result = run_robot(
            run,
            exchange,
            length,
            lockstep=lockstep,
            keep=log is not None,
            todo=todo,
            progress=status if sys.stderr.isatty() and not json else None,
            over=lambda: bool(requests.leave),
        )
        parts = Counter(loop.whereabouts()) if hasattr(loop, "whereabouts") else None
        farewell(run, exchange, lockstep)
    if log is not None:
        write_text(log, table(result, found.joint_names))
    if json:
        print_json(result.to_dict() | {"parts": parts})
    else:
        show(result, screen)
        if parts is not None:
            screen.print("screws: " + ", ".join(f"{place} {n}" for place, n in parts.items()))
    if result.counts["answered"] == 0:
        raise typer.Exit(1)


def moment(option: str, time: float) -> float:
    """A time of the run [s]."""
    if not 0.0 <= time < math.inf:
        raise ConfigurationError(WHERE, option, time, "a time in seconds, 0 or later, e.g. 5")
    return time


def span(option: str, text: str) -> tuple[float, float]:
    """Start and length from "START:LENGTH" [s]."""
    start, _, length = text.partition(":")
    try:
        found = float(start), float(length)
    except ValueError:
        found = math.nan, math.nan
    if not (0.0 <= found[0] < math.inf and found[1] >= 0.0):
        raise ConfigurationError(WHERE, option, text, "START:LENGTH in seconds, e.g. 5:0.5")
    return found


def status(run: RobotRun) -> None:
    """Overwrite the status line, twice a second."""
    if run.cycles % 125 == 0:
        sys.stderr.write(f"\r{0.004 * run.cycles:8.1f} s  {counted(run.cycles, 'cycle')}, {run.late} of them late ")
        sys.stderr.flush()


def table(run: RobotRun, names: tuple[str, ...]) -> str:
    """Measured positions and references, a row a cycle, as CSV."""
    header = ["time [s]", *(f"q {name} [rad]" for name in names), *(f"q_ref {name} [rad]" for name in names)]
    rows = [
        ",".join(format(value, ".17g") for value in (0.004 * k, *q, *q_ref))
        for k, (q, q_ref) in enumerate(zip(run.q, run.reference, strict=True))
    ]
    return "\n".join([",".join(header), *rows]) + "\n"


def show(run: RobotRun, screen: Console) -> None:
    """Print what the robot's end saw."""
    counts: dict[str, Any] = run.counts
    screen.print()
    if run.counts["answered"] == 0:
        screen.print("nobody answered", style="yellow")
    screen.print(f"{counted(run.cycles, 'cycle')}, {run.late} of them more than 4 ms late themselves")
    screen.print(json_text(counts | {"rejected": run.rejected}, indent=None))
    screen.print(f"fastest joint: {math.degrees(run.speed):.1f} deg/s")
