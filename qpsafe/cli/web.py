"""`qpsafe web`: a robot among people, in the browser."""

from __future__ import annotations

import signal
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpsafe.cli.common import console, print_json
from qpsafe.cli.outputs import output_folder

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.web.watch import Watch

LOCAL_WARNING = (
    "WARNING: everybody who reaches {host} and knows the token can use this page; nothing on the way is encrypted"
)


def web(
    robot: Annotated[
        str, typer.Option(help="A bundled robot, a robot folder, a URDF or an MJCF file, or PACKAGE:MODEL.")
    ] = "irb140",
    program: Annotated[
        Path | None, typer.Option(help="TOML file of the program; by default the tool keeps its home pose.")
    ] = None,
    story: Annotated[
        Path | None, typer.Option(help="TOML file of a story: people who come besides the dragged one.")
    ] = None,
    cell: Annotated[
        Path | None, typer.Option(help="TOML file of the furniture around the robot, which the controller knows.")
    ] = None,
    host: Annotated[str, typer.Option(help="Address to serve at; any but this computer's own requires a token.")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0 for any free one.")] = 8080,
    token: Annotated[
        str | None, typer.Option(help="Token that the page asks for; generated where one is needed.")
    ] = None,
    dark: Annotated[bool, typer.Option("--dark", help="Use a dark theme.")] = False,
    shadows: Annotated[bool, typer.Option(help="Draw shadows, which is slow without a graphics card.")] = True,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in this computer's browser.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for recordings.", callback=output_folder)] = Path("out/web"),
    json: Annotated[bool, typer.Option("--json", help="Write the address as JSON to standard output.")] = False,
) -> None:
    """Watch and play in the browser: drag a person towards the robot, change law and parameters, record.

    The simulation runs at 250 Hz in a process of its own. Ctrl-C ends both.
    """
    from qpsafe.irc5.process import realtime

    realtime.one_thread()
    from qpsafe.sim.web.server import Page, check_port, need_viser, token_for

    need_viser()
    check_port(host, port)
    screen = console(json)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.sim.web.app import TITLE, App
    from qpsafe.sim.web.setup import HOLD, NOBODY, Setup
    from qpsafe.sim.web.view import Looks

    robot = ready_robot(robot, screen)
    task, people = HOLD if program is None else str(program), NOBODY if story is None else str(story)
    setup = Setup(robot, task, people, "" if cell is None else str(cell))
    setup.experiment().start  # noqa: B018  what is wrong is said before anything is served
    page = Page(host, port, TITLE, token_for(host, token))
    try:
        app = App(setup, page, out, Looks(dark, shadows))
        try:
            announce(screen, host, page.address)
            if json:
                print_json({"address": page.address})
                sys.stdout.flush()
            if open_:
                with suppress(webbrowser.Error):
                    webbrowser.open(page.address)
            with asked_to_leave() as leave:
                app.serve(leave)
        finally:
            app.close()
    finally:
        page.close()


def ready_robot(name: str, screen: Console) -> str:
    """Name of a robot that can be shown: a bare model gets a folder with a home posture and sensors, see `any_robot`.

    Args:
        name: What was typed.
        screen: Where it is said what was chosen.
    """
    from qpsafe.cli.demos.any_robot import ready_name

    return ready_name("qpsafe web", name, screen, 4)


@contextmanager
def asked_to_leave() -> Iterator[Callable[[], bool]]:
    """Tells whether Ctrl-C has come; a second one meanwhile ends the program as ever."""
    asked = threading.Event()
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in signals]

    def put_back() -> None:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)

    def ask(*_: object) -> None:
        asked.set()
        put_back()

    for number in signals:
        signal.signal(number, ask)
    try:
        yield asked.is_set
    finally:
        put_back()


def announce(screen: Console, host: str, address: str) -> None:
    """Say where the page is, and who can open it.

    Args:
        screen: Where to.
        host: Served at.
        address: To open.
    """
    from qpsafe.sim.web.server import LOCAL

    if host not in LOCAL:
        screen.print(LOCAL_WARNING.format(host=host), style="bold yellow")
    screen.print(f"open {address} in a browser; Ctrl-C ends it", soft_wrap=True)


def watch_stream(
    robot: str, experiment: str | None, cell: Path | None, at: tuple[str, int, str | None], screen: Console
) -> Watch:
    """The page of a stream, which only reads; waits until it answers: a browser may be opened before the robot moves.

    Args:
        robot: Name or path.
        experiment: That is streamed, for its scene.
        cell: File of the furniture, if there is one.
        at: Host, port and token, if there is one.
        screen: Where its address is said.
    """
    from qpsafe.sim.web.server import address_of, token_for
    from qpsafe.sim.web.watch import Watch

    host, port, token = at
    token = token_for(host, token)
    watch = Watch(robot, experiment, cell, host, port, token)
    if watch.wait():
        announce(screen, host, address_of(host, port, token))
    else:
        screen.print("no page: its process does not answer", style="yellow")
    return watch
