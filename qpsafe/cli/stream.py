"""`qpsafe stream`: joint references to an IRC5 over EGM, in real time."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import LawName, ProjectionName, console, make_law, print_json
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController
    from qpsafe.irc5.distances import SensorInput
    from qpsafe.irc5.realtime import Grant


class Experiment(StrEnum):
    """Experiments that `qpsafe irc5-sim` plays."""

    fixed = "fixed"
    path = "path"
    pick_and_place = "pick-and-place"


class Acknowledge(StrEnum):
    """What lifts a stop that the robot itself made."""

    robot = "robot"
    manual = "manual"


def stream(
    robot: Annotated[str, typer.Option(help="A bundled name, or a path to a robot folder.")] = "irb140",
    host: Annotated[str, typer.Option(help="Address or interface of this computer that the robot speaks to.")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Its UDP port; 0 for any free one.")] = 6510,
    peer: Annotated[str | None, typer.Option(help="Address of the robot; by default the first that speaks.")] = None,
    program: Annotated[
        Path | None, typer.Option(help="TOML file of what the tool does; by default it keeps the robot's home pose.")
    ] = None,
    cell: Annotated[Path | None, typer.Option(help="TOML file of what stands in the cell by plan.")] = None,
    experiment: Annotated[
        Experiment | None, typer.Option(help="Task and cell of an experiment that irc5-sim plays.")
    ] = None,
    law: Annotated[LawName, typer.Option(help="Control law.")] = LawName.hierarchical,
    projection: Annotated[ProjectionName, typer.Option(help="Of the hierarchical law.")] = ProjectionName.strict,
    sensor_host: Annotated[str, typer.Option(help="Address of this computer at which distances arrive.")] = "127.0.0.1",
    sensor_port: Annotated[int, typer.Option(min=0, max=65535, help="Its UDP port; 0 for any free one.")] = 6511,
    sensors: Annotated[
        bool, typer.Option("--sensors/--no-sensors", help="Without, the robot sees nobody: for tests only.")
    ] = True,
    events: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Where names of the program's events are sent; empty: nowhere.")
    ] = "127.0.0.1:6512",
    duration: Annotated[float | None, typer.Option(min=0.1, help="Leave after this time of streaming [s].")] = None,
    ramp_in: Annotated[float, typer.Option(min=0.01, max=10.0, help="Blending in from the measured pose [s].")] = 0.5,
    ramp_out: Annotated[float, typer.Option(min=0.01, max=10.0, help="Shortest time of braking [s].")] = 0.2,
    acknowledge: Annotated[
        Acknowledge, typer.Option(help="What lifts a stop that the robot made itself: its own start, or SIGUSR1 only.")
    ] = Acknowledge.robot,
    real_time: Annotated[
        bool, typer.Option("--real-time/--no-real-time", help="Ask for SCHED_FIFO and locked memory.")
    ] = False,
    priority: Annotated[int, typer.Option(min=1, max=98, help="Of SCHED_FIFO.")] = 80,
    watchdog: Annotated[
        float, typer.Option(min=0.0, max=10.0, help="Heartbeat's age at which it asks for a stop [s]; 0: none.")
    ] = 0.1,
    log: Annotated[Path | None, typer.Option(help="Log of the references, .csv or .qpref.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """Stream joint references to an IRC5 at its own pace (250 Hz). Ctrl-C ramps out before leaving.

    No safety function: keep the robot's own stops and limits independent of this program. SIGUSR1 acknowledges a stop.
    """
    screen = console(json)
    from qpsafe.irc5 import realtime

    grants = [realtime.one_thread()]
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.cli.stream_report import result_of, say, show, status_line
    from qpsafe.irc5.distances import SensorInput
    from qpsafe.irc5.event_output import EventOutput
    from qpsafe.irc5.loop import LoopRules, StreamLoop
    from qpsafe.irc5.reference_log import ReferenceWriter
    from qpsafe.irc5.rules import SessionRules
    from qpsafe.irc5.run import Requests, run_stream
    from qpsafe.irc5.streamer import EgmStreamer
    from qpsafe.irc5.warm_up import session_limits, warm_up
    from qpsafe.irc5.watchdog import Watchdog
    from qpsafe.supervisor import Supervisor

    controller = _controller(robot, program, cell, experiment, make_law(law, projection))
    blind = not sensors or controller.sensing is None
    with ExitStack() as stack:
        requests = stack.enter_context(Requests().heard())
        writer = None if log is None else stack.enter_context(ReferenceWriter(log, controller.robot.nq))
        output = EventOutput(events) if events else None
        inlet: SensorInput | None = None
        if not blind:
            assert controller.spots is not None
            inlet = SensorInput(len(controller.spots), sensor_host, sensor_port)
            stack.callback(inlet.close)
        names = controller.robot.joint_names
        rules = SessionRules(ramp_in=ramp_in, ramp_out=ramp_out)
        streamer = EgmStreamer(session_limits(controller), host, port, rules, peer, names)
        stack.callback(streamer.close)
        warm_up(controller, blind)
        if requests.leave:
            raise typer.Exit(130)
        dog = stack.enter_context(Watchdog(watchdog, 1.0, priority + 1 if real_time else 0)) if watchdog else None
        grants += _grants(real_time, priority)
        supervisor = Supervisor(on_transition=say)
        loop = StreamLoop(controller, streamer.session, supervisor, LoopRules(manual=acknowledge is Acknowledge.manual))
        _announce(screen, grants, streamer.address, inlet, blind)

        def on_tick(tick: Any) -> None:
            if writer is not None and tick is not None:
                writer.write(tick.reference)

        run = run_stream(
            streamer,
            loop,
            sensors=inlet,
            watchdog=dog,
            duration=duration,
            requests=requests,
            on_tick=None if writer is None else on_tick,
            on_events=None if output is None else output.send,
            on_second=(lambda run: status_line(run, loop)) if sys.stderr.isatty() and not json else None,
        )
        result = result_of(run, loop, streamer, inlet, dog, grants)
    if json:
        print_json(result)
    else:
        show(result, screen)
    if not result["good"]:
        raise typer.Exit(1)


def _controller(
    robot: str, program: Path | None, cell: Path | None, experiment: Experiment | None, law: Any
) -> SafetyController:
    from qpsafe.controller import SafetyController
    from qpsafe.robot.loader import load_robot
    from qpsafe.sensing.cell_file import load_cell
    from qpsafe.tasks.orientation import OrientationTask
    from qpsafe.tasks.position import PositionTask
    from qpsafe.tasks.program_file import load_program
    from qpsafe.tasks.trajectory import FixedPose

    found = load_robot(robot)
    if experiment is not None:
        if program is not None or cell is not None:
            raise ConfigurationError(
                "qpsafe stream", "--experiment", experiment.value, "no --program, no --cell with it"
            )
        from qpsafe.sim.experiments import experiment_loop

        controller: SafetyController = experiment_loop(experiment.value, found, law)[0].controller
        return controller
    known = () if cell is None else load_cell(cell)
    tool = found.tool_frames[0]
    goal: Any = FixedPose(found.pose(tool, found.home))
    if program is not None:
        goal = load_program(program, found)
        tool = goal.frame
    return SafetyController(found, [PositionTask(tool, goal), OrientationTask(tool, goal)], law, known=known)


def _grants(real_time: bool, priority: int) -> list[Grant]:
    from qpsafe.irc5 import realtime

    asked = [realtime.fifo(priority), realtime.lock_memory()] if real_time else []
    return [*asked, realtime.freeze_garbage()]


def _announce(
    screen: Any, grants: list[Grant], address: tuple[str, int], inlet: SensorInput | None, blind: bool
) -> None:
    for grant in grants:
        screen.print(grant.line, style="dim" if grant.granted else "yellow", highlight=False)
    if blind:
        screen.print("no sensors: the robot sees nobody", style="bold yellow")
    else:
        assert inlet is not None
        screen.print(f"waiting for distances at {inlet.address[0]}:{inlet.address[1]}", highlight=False)
    screen.print(f"waiting for the robot at {address[0]}:{address[1]}; Ctrl-C ramps out and leaves", highlight=False)
