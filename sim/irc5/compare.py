"""The same experiment over the wire, with two processes, and in one: how far apart do the joints run?"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import QpsafeError
from qpsafe.irc5.transport.axes import axes_of_robot
from qpsafe.robot.robot import Robot
from qpsafe.sim.experiments.by_name import experiment_loop
from qpsafe.sim.experiments.pick_place.pick_loop import PickLoop
from qpsafe.sim.irc5.in_process import Here
from qpsafe.sim.irc5.irc5_loop import Exchange, Irc5Loop
from qpsafe.sim.irc5.motion import EgmSettings
from qpsafe.sim.irc5.process import RobotRun, farewell, run_robot
from qpsafe.sim.irc5.udp import UdpExchange

Array = NDArray[np.float64]

_LISTENS = re.compile(r"waiting for (distances|the robot) at ([\d.]+):(\d+)")


@dataclass
class StreamProcess:
    """A `qpsafe stream` beside this process.

    Attributes:
        process: Of the system.
        addresses: Where it listens for ``the robot`` and, if it does, for ``distances``.
        report: What it wrote with ``--json``, after it has ended.
        said: Lines of its standard error.
    """

    process: subprocess.Popen[str]
    addresses: dict[str, tuple[str, int]] = field(default_factory=dict)
    report: dict[str, Any] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)


@contextlib.contextmanager
def stream_process(*options: str, patience: float = 120.0) -> Iterator[StreamProcess]:
    """Run `qpsafe stream` with ports that the system chooses; at the end of the block it is asked to leave.

    Raises:
        QpsafeError: It did not come up.
    """
    command = [sys.executable, "-c", "from qpsafe.cli.main import main; main()", "stream", "--json"]
    command += ["--port", "0", "--sensor-port", "0", *options]
    pipe = subprocess.PIPE
    environment = os.environ | {"NO_COLOR": "1", "COLUMNS": "300", "PYTHONUNBUFFERED": "1"}
    found = StreamProcess(subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment))
    process, ready = found.process, threading.Event()

    def listen() -> None:
        assert process.stderr is not None
        for line in process.stderr:
            found.said.append(line.rstrip())
            match = _LISTENS.search(line)
            if match:
                found.addresses[match[1]] = match[2], int(match[3])
            if "the robot" in found.addresses:
                ready.set()
        ready.set()

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    try:
        if not ready.wait(patience) or "the robot" not in found.addresses:
            raise QpsafeError("qpsafe stream did not come up: " + " / ".join(found.said[-5:]))
        try:
            yield found
        except QpsafeError as error:  # it may know why
            _leave(found, listener)
            error.add_note(f"qpsafe stream: {found.said[-10:]}, {found.report.get('transitions', found.report)}")
            raise
        _leave(found, listener)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()


def _leave(stream: StreamProcess, listener: threading.Thread) -> None:
    """Ask it to leave if it has not left, and take its report; standard error has its own reader."""
    process = stream.process
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    assert process.stdout is not None
    output = process.stdout.read()
    process.wait(timeout=60.0)
    listener.join(10.0)
    stream.report = json.loads(output) if output.strip() else {}


class Course(NamedTuple):
    """How an experiment went.

    Attributes:
        q: Measured joint positions, every cycle from the first answer (N, n) [rad].
        deeds: How often what happened to a screw, by its kind, see `PickEvent`; empty without screws.
        parts: How many screws are where at the end.
    """

    q: Array
    deeds: Counter[str]
    parts: Counter[str]


def _course(run: Irc5Loop, q: list[Array]) -> Course:
    loop = run.loop
    if not isinstance(loop, PickLoop):
        return Course(np.array(q), Counter(), Counter())
    return Course(np.array(q), Counter(event.kind for event in loop.events), Counter(loop.whereabouts()))


def _over(run: Irc5Loop, cycles: int) -> bool:
    return cycles > 0 and isinstance(run.loop, PickLoop) and run.loop.done(cycles)


def in_one_process(
    name: str, robot: Robot, duration: float, settings: EgmSettings, delay: int = 0, cycles: int = 0
) -> Course:
    """An experiment with session and controller in this process.

    Args:
        name: Of the experiment.
        robot: The robot.
        duration: At most [s].
        settings: Of EGM.
        delay: Cycles that an answer is under way: 0 as in lock-step, 1 as on a wire without delays of its own.
        cycles: Of the third experiment: end when so many screws have been carried; 0: at the duration.
    """
    loop, _ = experiment_loop(name, robot)
    exchange: Exchange = Here(loop.controller) if delay == 0 else _Late(Here(loop.controller), delay)
    run = Irc5Loop(experiment_loop(name, robot)[0], exchange, settings)
    found: list[Array] = []
    while len(found) < round(duration / run.irc5.dt) and not _over(run, cycles):
        run.step()
        if run.running:
            found.append(run.plant.q)
        run.advance()
    return _course(run, found)


class _Late:
    """Answers that come some cycles later."""

    def __init__(self, here: Here, delay: int) -> None:
        self._here = here
        self._late: list[Any] = [((), ())] * delay

    def swap(self, packet: Any, distances: Array) -> Any:
        self._late.append(self._here.swap(packet, distances))
        return self._late.pop(0)


def over_the_wire(
    name: str, robot: Robot, duration: float, settings: EgmSettings, *options: str, lockstep: bool, cycles: int = 0
) -> tuple[Course, RobotRun, dict[str, Any]]:
    """The same with `qpsafe stream` in a process of its own: its course, what the robot saw, the stream's report.

    Args:
        name: Of the experiment.
        robot: The robot.
        duration: [s].
        settings: Of the simulated controller.
        options: More of `qpsafe stream`.
        lockstep: Whether a packet waits for its answer.
        cycles: Of the third experiment.
    """
    with contextlib.closing(UdpExchange(axes_of_robot(robot), None, lockstep=60.0 if lockstep else 0.0)) as exchange:
        events = "{}:{}".format(*exchange.events)
        # who waits for each other keeps no real time: on a busy machine either may be late
        timeless = ["--watchdog", "0", "--silence", "60"] if lockstep else []
        with stream_process("--experiment", name, "--events", events, *timeless, *options) as stream:
            exchange.aim(stream.addresses["the robot"], stream.addresses["distances"])
            run = Irc5Loop(experiment_loop(name, robot)[0], exchange, settings)
            over = partial(_over, run, cycles)
            seen = run_robot(run, exchange, duration, lockstep=lockstep, keep=True, over=over)
            course = _course(run, seen.q[: round(duration / run.irc5.dt)])
            farewell(run, exchange, lockstep)
    return course, seen, stream.report


class Agreement(NamedTuple):
    """How far two runs are apart.

    Attributes:
        shift: Cycles by which the second was moved to fit best.
        largest: Largest distance of any joint at any time [rad].
        rms: Root mean square [rad].
        moved: Largest way that a joint went in the first run [rad].
    """

    shift: int
    largest: float
    rms: float
    moved: float


def agreement(a: Array, b: Array, most: int = 0) -> Agreement:
    """Compare `a` with `b`, moved by up to `most` cycles so that the root mean square is least.

    Args:
        a: Course (ticks, n).
        b: Another one.
        most: Cycles.
    """
    found = []
    for shift in range(most + 1):
        n = min(len(a), len(b) - shift)
        difference = np.abs(a[:n] - b[shift : shift + n])
        rms = float(np.sqrt((difference**2).mean()))
        found.append(Agreement(shift, float(difference.max()), rms, float(np.ptp(a, axis=0).max())))
    return min(found, key=lambda item: item.rms)
