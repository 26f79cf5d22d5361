"""`qpsafe stream`: joint references to an IRC5 over EGM, in real time."""

from __future__ import annotations

import math
import sys
from contextlib import ExitStack, redirect_stdout
from enum import StrEnum
from io import StringIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, NamedTuple, cast

import typer

from qpsafe.cli.common import LawName, ProjectionName, RobotName, console, load_named, make_law, print_json
from qpsafe.cli.outputs import output_file
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.controller import SafetyController
    from qpsafe.irc5.distances import SensorInput
    from qpsafe.irc5.process.realtime import Grant
    from qpsafe.irc5.records.log import ReferenceWriter
    from qpsafe.sim.web.watch import Watch
    from qpsafe.tick import Tick


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
    robot: RobotName = "irb140",
    host: Annotated[str, typer.Option(help="Address or interface that the robot sends to.")] = ("127.0.0.1"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Its UDP port; 0 for any free one.")] = 6510,
    peer: Annotated[str | None, typer.Option(help="Address of the robot; by default the first sender.")] = None,
    program: Annotated[
        Path | None, typer.Option(help="TOML file of the program; by default the tool keeps its home pose.")
    ] = None,
    cell: Annotated[Path | None, typer.Option(help="TOML file of the furniture in the cell.")] = None,
    unchecked: Annotated[
        bool, typer.Option("--unchecked", help="Stream a program even if `qpsafe check` rejects it.")
    ] = False,
    experiment: Annotated[
        Experiment | None, typer.Option(help="Experiment that irc5-sim plays: its task and its cell.")
    ] = None,
    law: Annotated[LawName, typer.Option(help="Control law.")] = LawName.hierarchical,
    projection: Annotated[
        ProjectionName, typer.Option(help="Projection of the hierarchical law.")
    ] = ProjectionName.strict,
    sensor_host: Annotated[str, typer.Option(help="Address of this computer at which distances arrive.")] = "127.0.0.1",
    sensor_port: Annotated[int, typer.Option(min=0, max=65535, help="Its UDP port; 0 for any free one.")] = 6511,
    sensors: Annotated[
        bool,
        typer.Option("--sensors/--no-sensors", help="Use distances; else the robot sees nobody: tests only."),
    ] = True,
    events: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Address to send the names of events to; empty: none.")
    ] = "127.0.0.1:6512",
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after streaming for this long [s].")] = None,
    patience: Annotated[
        float, typer.Option(min=0.0, help="Stop after this silence of a robot that was answered [s]; 0: never.")
    ] = 15.0,
    silence: Annotated[
        float, typer.Option(min=0.01, max=60.0, help="Hold the robot after this silence of it [s].")
    ] = 0.1,
    ramp_in: Annotated[
        float, typer.Option(min=0.01, max=10.0, help="Time to blend in from the measured pose [s].")
    ] = 0.5,
    ramp_out: Annotated[float, typer.Option(min=0.01, max=10.0, help="Shortest braking time [s].")] = 0.2,
    acknowledge: Annotated[
        Acknowledge, typer.Option(help="What clears a stop by the robot: restart, or SIGUSR1.")
    ] = Acknowledge.robot,
    real_time: Annotated[
        bool, typer.Option("--real-time/--no-real-time", help="Request SCHED_FIFO and locked memory.")
    ] = False,
    priority: Annotated[int, typer.Option(min=1, max=98, help="Priority under SCHED_FIFO.")] = 80,
    watchdog: Annotated[
        float,
        typer.Option(min=0.0, max=10.0, help="Heartbeat age at which a stop is requested [s]; 0: none."),
    ] = 0.1,
    log: Annotated[
        Path | None, typer.Option(help="Log of the references, .csv or .qpref.", callback=output_file(".csv", ".qpref"))
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Show the stream in the browser; the page is read-only.")] = False,
    web_host: Annotated[
        str, typer.Option(help="Address of the page; any but this computer's own requires a token.")
    ] = ("127.0.0.1"),
    web_port: Annotated[int, typer.Option(min=0, max=65535, help="Its port.")] = 8080,
    web_token: Annotated[str | None, typer.Option(help="Token that the page asks for; generated where needed.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """Stream joint references to an IRC5 at its own pace (250 Hz). Ctrl-C ramps out before leaving.

    No safety function: keep the robot's own stops and limits independent of this program. SIGUSR1 acknowledges a stop.
    """
    from qpsafe.irc5.process import realtime
    from qpsafe.irc5.process.outlet import Outlet
    from qpsafe.irc5.process.requests import Requests

    grants = [realtime.one_thread()]
    with ExitStack() as stack:
        requests = stack.enter_context(Requests().heard())
        spoken, written = Outlet.over(sys.stderr, "standard error"), Outlet.over(sys.stdout, "standard output")
        stack.callback(spoken.close)
        stack.callback(written.close)
        screen = console(json)
        screen.file = cast("IO[str]", spoken if json else written)
        screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
        from qpsafe.cli.demos.any_robot import check_stated, ready_name
        from qpsafe.cli.irc5.stream_report import result_of, show
        from qpsafe.cli.irc5.stream_speaker import Speaker
        from qpsafe.irc5.distances import SensorInput
        from qpsafe.irc5.loop import LoopRules, StreamLoop
        from qpsafe.irc5.process.warm_up import session_limits, warm_up
        from qpsafe.irc5.process.watchdog import Watchdog
        from qpsafe.irc5.rules import SessionRules
        from qpsafe.irc5.run import run_stream
        from qpsafe.irc5.streamer import EgmStreamer
        from qpsafe.irc5.supervisor import Supervisor
        from qpsafe.irc5.transport.axes import axes_of_robot
        from qpsafe.irc5.transport.event_output import EventOutput

        checked = _Checked(unchecked, sensors, screen)
        if experiment is None:
            check_stated("qpsafe stream", robot, sensors)
        else:  # a simulation, of what irc5-sim plays
            robot = ready_name("qpsafe stream", robot, screen, 6, sensors=True)
        controller = _controller(robot, program, cell, experiment, make_law(law, projection), checked)
        writer = None if log is None else _writer(log, controller.robot.nq)
        if writer is not None:
            stack.enter_context(writer)
        output = EventOutput(events) if events else None
        inlet: SensorInput | None = None
        if sensors:
            assert controller.spots is not None
            inlet = SensorInput(len(controller.spots), sensor_host, sensor_port)
            stack.callback(inlet.close)
        names = controller.robot.joint_names
        same = max(SessionRules.silence, silence)  # until then it is the same robot
        rules = SessionRules(ramp_in=ramp_in, ramp_out=ramp_out, silence=same)
        axes = axes_of_robot(controller.robot)
        streamer = EgmStreamer(session_limits(controller), host, port, rules, peer, names, axes)
        stack.callback(streamer.close)
        warm_up(controller, not sensors)
        dog = stack.enter_context(Watchdog(watchdog, 1.0, priority + 1 if real_time else 0)) if watchdog else None
        if requests.leave:
            raise typer.Exit(130)
        watch: Watch | None = None
        if web:
            from qpsafe.cli.web import watch_stream

            shown = None if experiment is None else experiment.value
            watch = watch_stream(robot, shown, cell, (web_host, web_port, web_token), screen)
        if watch is not None:  # begun before anything is asked for that it would inherit
            stack.callback(watch.close)
        grants += _grants(real_time, priority, [spoken.thread, written.thread])
        speaker = Speaker(spoken, streamer, inlet, status=sys.stderr.isatty() and not json)
        supervisor = Supervisor(on_transition=speaker.say)
        lets = LoopRules(silence=silence, manual=acknowledge is Acknowledge.manual)
        loop = StreamLoop(controller, streamer.session, supervisor, lets)
        _announce(screen, grants, streamer.address, inlet)

        def on_tick(tick: Tick | None) -> None:
            if writer is not None and tick is not None:
                writer.write(tick.reference)
            if watch is not None:
                watch.observe(tick, loop.measured, str(supervisor.state), streamer.response)

        requests.driving = True
        run = run_stream(
            streamer,
            loop,
            sensors=inlet,
            watchdog=dog,
            helpers=[spoken.trouble, written.trouble, *([] if writer is None else [writer.trouble])],
            duration=duration,
            patience=patience or math.inf,
            requests=requests,
            on_tick=None if writer is None and watch is None else on_tick,
            on_events=None if output is None else output.send,
            on_second=lambda run: speaker.second(run, loop),
        )
        if writer is not None:
            writer.close()
            run.troubles += [words for words in [writer.trouble(0.0)] if words and words not in run.troubles]
        result = result_of(run, loop, streamer, inlet, dog, grants, writer)
        if json:
            with redirect_stdout(StringIO()) as text:
                print_json(result)
            written.write(text.getvalue())
        else:
            show(result, screen)
        if not written.close():
            spoken.write("qpsafe: the report could not be written as a whole\n")
        if not (spoken.close() and written.close() and result["good"]):
            raise typer.Exit(1)


def _writer(path: Path, joints: int) -> ReferenceWriter:
    from qpsafe.irc5.records.log import ReferenceWriter

    try:
        return ReferenceWriter(path, joints, beside=True)
    except OSError as error:
        raise ConfigurationError("qpsafe stream", "--log", str(path), f"a file that can be written ({error})") from None


class _Checked(NamedTuple):
    """How a program is checked: whether what is wrong is only said, whether sensors are in use, where to say it."""

    unchecked: bool = False
    sensors: bool = True
    screen: Any = None


def _controller(
    robot: str,
    program: Path | None,
    cell: Path | None,
    experiment: Experiment | None,
    law: Any,
    checked: _Checked | None = None,
) -> SafetyController:
    from qpsafe.check.check import check_path
    from qpsafe.cli.check import refuse_or_warn
    from qpsafe.controller import SafetyController
    from qpsafe.sensing.cell_file import load_cell
    from qpsafe.tasks.orientation import OrientationTask
    from qpsafe.tasks.position import PositionTask
    from qpsafe.tasks.program_file import load_program
    from qpsafe.tasks.trajectory import FixedPose

    checked = checked or _Checked(screen=console(True))
    found = load_named(robot, checked.screen)
    if experiment is not None:
        if program is not None or cell is not None:
            raise ConfigurationError(
                "qpsafe stream", "--experiment", experiment.value, "no --program, no --cell with it"
            )
        from qpsafe.sim.experiments.by_name import experiment_loop

        controller: SafetyController = experiment_loop(experiment.value, found, law)[0].controller
        return controller
    known = () if cell is None else load_cell(cell)
    tool = found.tool_frames[0]
    goal: Any = FixedPose(found.pose(tool, found.home))
    if program is not None:
        goal = load_program(program, found)
        tool = goal.frame
    if program is not None or known:
        result = check_path(found, goal, frame=tool, known=known, sensors=checked.sensors)
        refuse_or_warn("qpsafe stream", program, result, checked.unchecked, checked.screen)
    return SafetyController(found, [PositionTask(tool, goal), OrientationTask(tool, goal)], law, known=known)


def _grants(real_time: bool, priority: int, threads: list[int]) -> list[Grant]:
    from qpsafe.irc5.process import realtime

    asked = [realtime.fifo(priority), realtime.lock_memory()] if real_time else []
    for thread in threads if real_time else []:  # else others could hold one up while the loop waits for it
        realtime.fifo(priority, thread)
    return [*asked, realtime.freeze_garbage()]


def _announce(screen: Any, grants: list[Grant], address: tuple[str, int], inlet: SensorInput | None) -> None:
    for grant in grants:
        screen.print(grant.line, style="dim" if grant.granted else "yellow", highlight=False)
    if inlet is None:
        screen.print("no sensors: the robot sees nobody", style="bold yellow")
    else:
        screen.print(f"waiting for distances at {inlet.address[0]}:{inlet.address[1]}", highlight=False)
    screen.print(f"waiting for the robot at {address[0]}:{address[1]}; Ctrl-C ramps out and leaves", highlight=False)
