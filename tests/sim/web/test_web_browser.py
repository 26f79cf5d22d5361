"""In a real browser: pages load and stay well, who is dragged near is evaded, switches work, connections may break."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from browser import WIDE, Program, Tab

import qpsafe
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.recording.run_file import StateRecorder, read_run, write_run
from qpsafe.sim.replay.replay import replay
from qpsafe.sim.replay.settings import settings_of

pytestmark = pytest.mark.web

Open = Callable[..., Tab]
Start = Callable[..., Program]

WEB = ("web", "--no-shadows", "--port", "0")
ARROW = (1.85, 0.5, 0.0)  # on the arrow along x of who stands at (1.6, 0.5)


def test_who_is_dragged_to_the_robot_is_evaded(tab: Open, program: Start) -> None:
    shown = tab(program(*WEB).address, WIDE)
    shown.until(lambda: shown.text("qp-phase") == "following")
    before, joints = shown.number("qp-distance"), shown.joints()
    shown.drag(ARROW, (0.75, 0.5, 0.0))  # so near that danger moves it though nobody moves any more
    shown.until(lambda: shown.number("qp-distance") < before - 400.0)
    shown.until(lambda: shown.number("qp-cdf") > 5.0)
    shown.until(lambda: float(np.abs(np.subtract(shown.joints(), joints)).max()) > 0.02)
    shown.open("People")
    shown.choose("drag with the mouse", "away")
    shown.until(lambda: float(np.abs(np.subtract(shown.joints(), joints)).max()) < 0.005)  # and it comes back


def test_switches_work(tab: Open, program: Start) -> None:
    shown = tab(program(*WEB).address)
    shown.open("In words")
    shown.until(lambda: "QP of weight" in shown.text("qp-words"))
    shown.open("Control")
    shown.choose("law", "nullspace")
    shown.until(lambda: "QP of weight" not in shown.text("qp-words"))
    shown.choose("law", "weighted")
    shown.choose("projection", "paper")
    shown.choose("sensors", "sharp")
    for box in ("gate", "barrier"):
        shown.page.get_by_label(box, exact=True).click()
    shown.until(lambda: shown.settled())
    assert shown.text("qp-note") == ""
    shown.open("Run")
    shown.choose("robot", "iiwa14")
    shown.until(lambda: len(shown.joints()) == 7)
    shown.choose("people", "straight at the robot")
    shown.until(lambda: shown.number("qp-time") < 2.0)
    shown.open("Show")
    for box in ("sensors' rays", "danger vectors", "links coloured by danger", "dark"):
        shown.page.get_by_label(box, exact=True).click()
    later = shown.number("qp-time") + 1.0
    shown.until(lambda: shown.number("qp-time") > later)


def test_the_clock_stands_steps_and_goes_on(tab: Open, program: Start) -> None:
    shown = tab(program(*WEB).address)
    shown.page.get_by_role("button", name="pause").click()
    shown.until(lambda: shown.text("qp-state") == "paused")
    shown.page.wait_for_timeout(400)
    stood = shown.text("qp-exact")
    shown.page.wait_for_timeout(700)
    assert shown.text("qp-exact") == stood
    shown.page.get_by_role("button", name="step").click()
    shown.until(lambda: shown.text("qp-exact") != stood)
    assert float(shown.text("qp-exact")) == pytest.approx(float(stood) + 0.004)
    shown.page.get_by_role("button", name="pause").click()
    shown.until(lambda: float(shown.text("qp-exact")) > float(stood) + 1.0)


def test_what_is_recorded_replays(tab: Open, program: Start) -> None:
    serving = program(*WEB)
    shown = tab(serving.address)
    shown.page.get_by_role("button", name="record").click()
    shown.until(lambda: shown.text("qp-state") == "recording" and shown.number("qp-time") > 1.0)
    shown.page.get_by_role("button", name="stop recording").click()
    shown.until(lambda: "written to" in shown.text("qp-note"))
    (path,) = (serving.log.parent / "out" / "web").glob("*.npz")
    assert replay(read_run(path)).same


def test_two_tabs_show_the_same_and_either_one_switches(tab: Open, program: Start) -> None:
    address = program(*WEB).address
    one, other = tab(address), tab(address)
    one.open("Control")
    other.open("Control")
    one.choose("law", "weighted")
    other.until(lambda: other.page.get_by_label("law", exact=True).first.input_value() == "weighted")
    other.choose("law", "nullspace")
    one.until(lambda: one.page.get_by_label("law", exact=True).first.input_value() == "nullspace")
    one.until(lambda: one.settled() and other.text("qp-wish") == one.text("qp-wish"))


def test_a_reload_finds_the_same_run(tab: Open, program: Start) -> None:
    shown = tab(program(*WEB).address)
    at = shown.number("qp-time")
    shown.page.reload()
    shown.page.wait_for_selector("#qp-distance")
    assert shown.number("qp-time") > at
    assert shown.text("qp-status") == "ok"


@contextmanager
def wire_to(port: int) -> Iterator[tuple[int, Callable[[], None]]]:
    """A port that leads to another one, and what cuts all connections over it."""
    server, links = socket.create_server(("127.0.0.1", 0)), list[socket.socket]()

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(data)
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def accept() -> None:
        with suppress(OSError):
            while True:
                near, _ = server.accept()
                far = socket.create_connection(("127.0.0.1", port))
                links.extend((near, far))
                for pair in ((near, far), (far, near)):
                    threading.Thread(target=pump, args=pair, daemon=True).start()

    def cut() -> None:
        for link in links:
            with suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
        links.clear()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield server.getsockname()[1], cut
    finally:
        cut()
        server.close()


def test_a_connection_that_drops_comes_back_by_itself(tab: Open, program: Start) -> None:
    serving = program(*WEB)
    port = int(serving.address.rpartition(":")[2].strip("/"))
    with wire_to(port) as (own, cut):
        shown = tab(f"http://127.0.0.1:{own}/")
        for _ in range(2):
            cut()
            at = shown.number("qp-time")
            shown.until(lambda at=at: shown.number("qp-time") > at + 1.0)  # type: ignore[misc]
        shown.open("Control")
        shown.choose("law", "weighted")
        shown.until(shown.settled)
        assert serving.process.poll() is None


def test_ctrl_c_ends_it_cleanly_and_the_port_is_free_again(tab: Open, program: Start) -> None:
    serving = program(*WEB)
    port = serving.address.rpartition(":")[2].strip("/")
    tab(serving.address).page.close()
    assert serving.interrupt() == 0
    assert "Traceback" not in serving.said
    again = program(*WEB[:-1], port)
    assert again.interrupt() == 0


def test_a_recorded_run_has_a_slider(tab: Open, program: Start, tmp_path: Path) -> None:
    experiment = FixedExperiment(qpsafe.load_robot("irb140"), duration=6.0)
    states = StateRecorder()
    write_run(tmp_path / "run.npz", experiment.run(states.observe), settings_of(experiment), experiment.robot, states)
    shown = tab(program("replay", str(tmp_path / "run.npz"), "--web", "--web-port", "0").address)
    shown.until(lambda: shown.number("qp-time") > 0.5)
    shown.page.get_by_role("button", name="play or pause").click()
    field = shown.page.locator("input[inputmode='decimal']").first

    def stands() -> bool:
        """Moves of the slider that are on their way still would replace what is typed."""
        before = field.input_value()
        shown.page.wait_for_timeout(1_000)
        return before == field.input_value()

    shown.until(stands)
    for at in (4.0, 1.2):
        field.fill(str(at))
        field.press("Enter")
        shown.until(lambda at=at: abs(shown.number("qp-time") - at) < 0.05)  # type: ignore[misc]
        shown.page.wait_for_timeout(300)
        assert abs(shown.number("qp-time") - at) < 0.05


def test_a_drag_reaches_the_robot(tab: Open, program: Start) -> None:
    """From when Chromium got the move to the end of the first tick that counts with it, single moves, on loopback.

    How long that takes depends on who draws: a graphics card, or the processor. It is printed, and bounded by what no
    machine should need; benchmarks/bench_web.py is the measurement.
    """
    shown = tab(program(*WEB).address, WIDE)
    median = float(np.median(shown.drag_delays(ARROW, (1.2, 0.5, 0.0), 25)))
    print(f"a drag reaches the robot within {1e3 * median:.0f} ms, median")
    assert median < 1.0


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> str:
    """A port that nobody listens at."""
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def test_a_stream_is_shown_and_has_nothing_to_be_changed(tab: Open, program: Start, tmp_path: Path) -> None:
    robot, sensors = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    ports = ["--port", robot, "--sensor-port", sensors]
    words = ["--experiment", "fixed", "--events", "", "--web", "--web-port", free_port()]
    # beside a browser, two processes that should be in time may not be: no watchdog may end the stream, and with it the
    # page; a robot that has fallen silent is stopped, and the page shows that
    serving = program("stream", "--watchdog", "0", *words, *ports)
    simulated = Program(["irc5-sim", "--event-port", "0", "--duration", "1e4", *ports], tmp_path, serves=False)
    try:
        shown = tab(serving.address)
        at = shown.number("qp-time")
        shown.until(lambda: shown.number("qp-time") > at + 1.0 or shown.text("qp-state") == "stopped")
        assert shown.number("qp-time") > 0.0
        assert shown.text("qp-distance") == "not known"
        assert len(shown.joints()) == 6
        assert [t.strip() for t in shown.page.get_by_role("tab").all_text_contents()] == ["Plots", "In words", "Show"]
    finally:
        simulated.process.kill()
        serving.interrupt()
