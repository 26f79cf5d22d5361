"""`qpsafe stream` and a simulated IRC5 as two processes on loopback, on ports that the system chooses."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import QpsafeError
from qpsafe.irc5.messages import RobotPacket, SensorPacket, encode_robot
from qpsafe.irc5.records.log import read_references
from qpsafe.robot.loader import load_robot
from qpsafe.sim.experiments.by_name import experiment_loop
from qpsafe.sim.experiments.path.experiment import PROGRAM as PROGRAM_FILE
from qpsafe.sim.irc5.compare import StreamProcess, agreement, in_one_process, over_the_wire, stream_process
from qpsafe.sim.irc5.irc5_loop import Irc5Loop
from qpsafe.sim.irc5.link import WireFaults
from qpsafe.sim.irc5.motion import EgmSettings
from qpsafe.sim.irc5.process import happenings, run_robot
from qpsafe.sim.irc5.udp import NoAnswerError, UdpExchange

PROGRAM = [sys.executable, "-c", "from qpsafe.cli.main import main; main()"]


@pytest.mark.slow
def test_over_the_wire_as_in_one_process(tmp_path: Path) -> None:
    """In lock-step, to the bit: the wire loses nothing of any number."""
    robot, settings = load_robot("irb140"), EgmSettings()
    log = tmp_path / "references.qpref"
    wire, seen, report = over_the_wire("path", robot, 2.0, settings, "--log", str(log), lockstep=True)
    here = in_one_process("path", robot, 2.0, settings)
    found = agreement(wire.q, here.q)
    assert found.moved > 0.01
    assert found.largest == 0.0
    assert (seen.counts["answered"], seen.counts["missed"], seen.rejected) == (len(wire.q), 0, 0)
    # and the stream's own account of it
    assert report["good"] is True
    assert report["state"] == "stopped"
    assert report["stop_category"] == 1
    assert report["answered"] >= len(wire.q)
    assert report["sensors"]["used"] >= len(wire.q)
    assert report["response"]["count"] == report["answered"]
    references = read_references(log).references
    assert len(references) > 0.5 * len(wire.q)
    steps = np.diff([reference.q for reference in references], axis=0)
    assert (np.abs(steps) <= robot.max_velocity * 0.004 * (1 + 1e-9)).all()


@pytest.mark.slow
def test_fourteen_joints_go_over_the_wire_as_six_and_eight_external_ones() -> None:
    """The IRB 14000, both arms, evading: equal to the last bit to the same in one process."""
    robot, settings = load_robot("irb14000"), EgmSettings()
    wire, seen, report = over_the_wire("fixed", robot, 6.5, settings, "--robot", "irb14000", lockstep=True)
    assert wire.q.shape[1] == 14
    assert (np.ptp(wire.q, axis=0) > 1e-3).all()
    assert agreement(wire.q, in_one_process("fixed", robot, 6.5, settings).q).largest == 0.0
    assert (seen.counts["answered"], seen.counts["missed"], seen.rejected) == (len(wire.q), 0, 0)
    assert report["good"] is True


@pytest.mark.slow
def test_the_third_experiment_grips_over_the_wire() -> None:
    """Pick and place with two processes: a screw is gripped when the program's event arrives, and held."""
    robot, settings = load_robot("irb140"), EgmSettings()
    wire, seen, report = over_the_wire("pick-and-place", robot, 4.0, settings, lockstep=True)
    assert [name for _, name in seen.events] == ["grip"]
    assert seen.counts["missed"] == 0
    assert report["good"] is True
    here = in_one_process("pick-and-place", robot, 4.0, settings)
    assert agreement(wire.q, here.q).largest == 0.0
    assert wire.deeds == here.deeds
    assert wire.parts == here.parts
    assert wire.parts["gripper"] == 1


@pytest.mark.slow
def test_the_robot_does_not_evade_its_own_load_when_answers_are_late() -> None:
    """Ada's first visit makes the arm fold up with a screw in its gripper; it goes on when she leaves."""
    found = in_one_process("pick-and-place", load_robot("irb140"), 45.0, EgmSettings(), delay=1, cycles=3)
    assert found.deeds == {"grip": 3, "release": 3, "delivered": 3, "take": 1}
    assert found.parts["elsewhere"] == 0


@pytest.mark.slow
def test_bad_wire_restart_and_motors_off_over_real_sockets() -> None:
    """Everything at once, in real time: the stream goes on, and ends at rest."""
    robot = load_robot("irb140")
    spoilt = WireFaults(loss=0.1, delay=0.004, reorder=0.1, duplicate=0.1, garbage=0.2)
    with stream_process("--no-sensors", "--watchdog", "5", "--experiment", "path") as stream:
        exchange = UdpExchange(robot.nq, stream.addresses["the robot"], strangers=0.0)
        try:
            run = Irc5Loop(experiment_loop("path", robot)[0], exchange, EgmSettings())
            todo = happenings([1.2], [(2.0, 0.2)], [(2.6, 0.2)], spoilt, (0.3, 0.5), 0.3)
            seen = run_robot(run, exchange, 3.6, todo=todo)
        finally:
            exchange.close()
    report = stream.report
    assert report["failure"] == ""
    assert report["datagrams"]["wrong_sender"] > 0
    assert report["datagrams"]["garbage"] > 0
    assert report["datagrams"]["answered"] > 100
    causes = " ".join(item["cause"] for item in report["transitions"])
    assert "motors off" in causes
    assert "RAPID stopped" in causes
    assert seen.counts["restarts"] == 1
    assert seen.speed <= robot.max_velocity.max()
    assert report["state"] == "stopped"


def _signals(*numbers: int) -> Callable[[StreamProcess], None]:
    def send(stream: StreamProcess) -> None:
        for number in numbers:
            stream.process.send_signal(number)
            time.sleep(0.01)

    return send


def _kill_watchdog(stream: StreamProcess) -> None:
    pid = stream.process.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    assert len(children) == 1
    os.kill(int(children[0]), signal.SIGKILL)


def _fill_disk(stream: StreamProcess) -> None:
    """No file of its may grow beyond what the log has by now."""
    resource.prlimit(stream.process.pid, resource.RLIMIT_FSIZE, (30000, resource.RLIM_INFINITY))


ENDS: dict[str, tuple[Callable[[StreamProcess], None], int, str]] = {
    "Ctrl-C": (_signals(signal.SIGINT), 0, "Ctrl-C"),
    "signals": (_signals(signal.SIGHUP, signal.SIGQUIT, signal.SIGINT, signal.SIGTERM, signal.SIGHUP), 0, "SIGHUP"),
    "watchdog": (_kill_watchdog, 1, "watchdog: its process has ended (killed by SIGKILL)"),
    "log": (_fill_disk, 1, "log: [Errno 27] File too large"),
}


@pytest.mark.slow
@pytest.mark.parametrize("end", ENDS)
def test_whatever_ends_the_stream_the_last_answers_are_a_pose_at_rest(end: str, tmp_path: Path) -> None:
    do, code, words = ENDS[end]
    robot = load_robot("irb140")
    options = ["--no-sensors", "--watchdog", "5", "--experiment", "path", "--log", str(tmp_path / "run.qpref")]
    answers: list[SensorPacket] = []
    with stream_process(*options) as stream:
        exchange = UdpExchange(robot.nq, stream.addresses["the robot"], lockstep=5.0)
        receive = exchange._wait

        def kept(*sent: Any) -> list[SensorPacket]:
            came = receive(*sent)
            answers.extend(came)
            return came

        exchange._wait = kept  # type: ignore[method-assign]
        run = Irc5Loop(experiment_loop("path", robot)[0], exchange, EgmSettings())
        _go(run, 400)
        do(stream)
        exchange._lockstep = 0.5  # type: ignore[misc]
        with pytest.raises(NoAnswerError):
            _go(run, 3000)
        exchange.close()
    found = answers
    assert (found[-1].qd_ref == 0.0).all()
    assert (found[-1].q_ref == found[-40].q_ref).all()  # the pose at rest was sent for a while
    changes = np.abs(np.diff([answer.qd_ref for answer in found], axis=0))
    assert (changes <= robot.max_acceleration * 0.004 * (1.0 + 1e-6)).all()
    assert stream.process.returncode == code
    assert stream.report["at_rest"] is True
    assert stream.report["good"] is (code == 0)
    any_of = ("SIGHUP", "SIGQUIT", "Ctrl-C", "SIGTERM")  # all are pending at once: any of them may come first
    assert stream.report["causes"][0] in (any_of if end == "signals" else (words,))
    assert code == 0 or stream.report["troubles"] == [words]
    assert not any("Traceback" in line for line in stream.said)
    ending = ".qpref.part" if end == "log" else ".qpref"
    assert len(read_references(tmp_path / f"run{ending}").references) > 200


@pytest.mark.slow
@pytest.mark.parametrize("where", ["full disk", "full pipe", "closed pipe"])
def test_a_stream_that_nobody_can_hear_brakes_and_says_so_by_its_exit_code(where: str) -> None:
    """Its words do not hold up its answers; when something must be told and cannot be, the robot is braked."""
    robot = load_robot("irb140")
    back, there = os.pipe()
    error = os.open("/dev/full", os.O_WRONLY) if where == "full disk" else there
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        address = probe.getsockname()
    command = [*PROGRAM, "stream", "--json", "--no-sensors", "--experiment", "path", "--watchdog", "5"]
    command += ["--port", str(address[1]), "--events", ""]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=error, text=True)
    if where == "closed pipe":
        os.close(back)
    exchange = UdpExchange(robot.nq, address, lockstep=5.0, patience=120.0)
    run = Irc5Loop(experiment_loop("path", robot)[0], exchange, EgmSettings())
    if where == "full pipe":
        _fill(there)
    with pytest.raises(NoAnswerError):
        _go(run, 3000)
    assert process.stdout is not None
    report = json.loads(process.stdout.read())
    assert process.wait(timeout=60.0) == 1
    exchange.close()
    assert report["at_rest"] is True
    assert report["good"] is False
    assert report["answered"] > 0
    assert "standard error" in report["troubles"][0]
    os.close(error)


def _fill(pipe: int) -> None:
    os.set_blocking(pipe, False)
    for size in (4096, 1):
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(pipe, b"x" * size)
    os.set_blocking(pipe, True)


def _go(run: Irc5Loop, cycles: int) -> None:
    for _ in range(cycles):
        run.step()
        run.advance()


@pytest.mark.slow
def test_a_hanging_loop_is_ended_by_the_watchdog() -> None:
    """SIGSTOP stands for a loop that hangs: its process is killed, the robot hears nothing more."""
    robot = load_robot("irb140")
    with stream_process("--no-sensors", "--watchdog", "0.3") as stream:
        exchange = UdpExchange(robot.nq, stream.addresses["the robot"])
        run = Irc5Loop(experiment_loop("fixed", robot)[0], exchange, EgmSettings())
        run_robot(run, exchange, 0.2)
        stream.process.send_signal(signal.SIGSTOP)
        assert stream.process.wait(timeout=60.0) == -signal.SIGKILL
        exchange.close()
    assert stream.report == {}
    assert any("no heartbeat" in line for line in stream.said)


@pytest.mark.slow
def test_ctrl_c_without_a_robot_leaves_at_once() -> None:
    with stream_process("--watchdog", "0") as stream:
        started = time.monotonic()
    assert time.monotonic() - started < 60.0
    assert stream.process.returncode == 1  # nobody was streamed to
    assert stream.report["answered"] == 0
    assert stream.report["good"] is False


@pytest.mark.slow
def test_a_robot_that_cannot_be_understood_is_counted_and_named_while_waiting_and_at_the_end() -> None:
    udp = socket.AF_INET, socket.SOCK_DGRAM
    with stream_process("--no-sensors", "--watchdog", "0") as stream, socket.socket(*udp) as robot:
        for k in range(1000):
            data = encode_robot(RobotPacket(k, 4 * k, np.zeros(5), clock=1.0 + 0.004 * k))
            robot.sendto(data, stream.addresses["the robot"])
            time.sleep(0.001)  # not more at once than a socket's buffer holds
        end = time.monotonic() + 60.0
        while not any("datagrams refused" in line for line in stream.said) and time.monotonic() < end:
            time.sleep(0.05)
    line = next(line for line in stream.said if "datagrams refused" in line)
    assert "wrong_joint_count" in line
    assert "feedBack.joints: 5 numbers, expected 6" in line
    assert stream.process.returncode == 1
    assert stream.report["answered"] == 0
    assert stream.report["datagrams"]["wrong_joint_count"] > 500
    assert "feedBack.joints: 5 numbers, expected 6" in stream.report["refused"]


@pytest.mark.slow
def test_the_stream_ends_when_the_simulated_robot_has_and_says_which_events_happened() -> None:
    with stream_process(
        "--no-sensors", "--watchdog", "5", "--experiment", "pick-and-place", "--patience", "1"
    ) as stream:
        command = [
            *PROGRAM,
            "irc5-sim",
            "--experiment",
            "pick-and-place",
            "--port",
            str(stream.addresses["the robot"][1]),
        ]
        command += ["--sensor-port", "0", "--event-port", "0", "--duration", "4", "--lock-step", "--json"]
        subprocess.run(command, capture_output=True, timeout=200, check=True)
        assert stream.process.wait(timeout=60.0) in (0, 1)  # by itself
    assert stream.report["at_rest"] is True
    assert "RAPID stopped" in " ".join(stream.report["causes"])
    assert stream.report["events"]["counts"] == {"grip": 1}
    assert stream.report["events"]["last"][0]["name"] == "grip"


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["stream", "--host", "0.0.0.0"], "host"),
        (["stream", "--program", "no-such.toml"], "no-such.toml"),
        (["stream", "--cell", "no-such.toml"], "no-such.toml"),
        (["stream", "--experiment", "fixed", "--program", "x.toml"], "--program"),
        (["stream", "--events", "nowhere"], "HOST:PORT"),
        (["stream", "--robot", "r2d2"], "r2d2"),
        (["irc5-sim", "--motors-off", "soon"], "START:LENGTH"),
        (["irc5-sim", "--lock-step", "--restart", "1"], "lock-step"),
    ],
)
def test_what_is_configured_wrongly_is_named(arguments: list[str], word: str) -> None:
    """`main` prints these errors in one line, see tests/cli."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert isinstance(result.exception, QpsafeError)
    assert word in str(result.exception)


@pytest.mark.parametrize("command", ["stream", "irc5-sim", "irc5-faults"])
def test_help(command: str) -> None:
    assert CliRunner().invoke(app, [command, "--help"]).exit_code == 0


@pytest.mark.slow
def test_a_simulated_robot_that_nobody_answers_says_so() -> None:
    arguments = ["irc5-sim", "--port", "9", "--sensor-port", "0", "--event-port", "0", "--json"]
    process = subprocess.Popen([*PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    while "sending" not in (line := process.stderr.readline()):
        assert line
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Traceback" not in errors
    assert json.loads(output)["counts"]["answered"] == 0


def test_a_program_moves_the_frame_that_it_names(tmp_path: Path) -> None:
    from qpsafe.cli.irc5.stream import _controller

    text = PROGRAM_FILE.read_text(encoding="utf-8").replace('"tcp"', '"flange"')
    path = tmp_path / "flange.toml"
    path.write_text(text.replace("0.54", "0.60"), encoding="utf-8")
    named = _controller("irb140", path, None, None, None)
    assert [task.frame for task in named.tasks] == ["flange", "flange"]  # type: ignore[attr-defined]
    by_default = _controller("irb140", None, None, None, None)
    assert [task.frame for task in by_default.tasks] == ["tcp", "tcp"]  # type: ignore[attr-defined]
    there = by_default.tasks[0].trajectory.sample(0.0).pose
    assert np.allclose(there, named.robot.pose("tcp", named.robot.home))
