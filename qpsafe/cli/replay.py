"""`qpsafe replay`: a recorded run once more, compared bit by bit, looked at or filmed."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import console, print_json, progress_bar
from qpsafe.cli.outputs import output_file
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.recording.run_file import RunFile
    from qpsafe.sim.replay.replay import Replay
    from qpsafe.sim.web.player import Kept


def replay(
    file: Annotated[Path, typer.Argument(help="A run.npz written by a demo.")],
    video: Annotated[
        Path | None, typer.Option(help="Also film the recorded run to this mp4.", callback=output_file(".mp4"))
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Also show it in MuJoCo's viewer; needs a display.")] = False,
    web: Annotated[bool, typer.Option("--web", help="Then show the run in the browser, with a time slider.")] = False,
    web_host: Annotated[
        str, typer.Option(help="Address of the page; any but this computer's own requires a token.")
    ] = ("127.0.0.1"),
    web_port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0 for any free one.")] = 8080,
    web_token: Annotated[str | None, typer.Option(help="Token that the page asks for; generated where needed.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Run the controller again on a run's recorded inputs and compare every answer with the recorded one, bit by bit.

    Exit code 0 if all are the same, 1 at the first bit that differs: which tick, which answer, by how much, and which
    versions, code or robot files have changed since.
    """
    screen = console(json)
    if web:
        from qpsafe.sim.web.server import check_port, need_viser

        need_viser()
        check_port(web_host, web_port)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.sim.recording.run_file import read_run
    from qpsafe.sim.replay.replay import replay as run_again
    from qpsafe.sim.replay.settings import experiment_of

    run = read_run(file)
    experiment = experiment_of(run.header["settings"])
    with progress_bar(screen) as progress, ExitStack() as stack:
        watchers: list[Any] = []
        if video is not None or view:
            watchers += _watchers(run, experiment, video, view, stack)
        if web:
            from qpsafe.sim.web.player import Kept

            kept = Kept(run, experiment)
            watchers.append(kept.watch)
        task = progress.add_task(file.name, total=run.ticks)

        def watch(*state: Any) -> None:
            for watcher in watchers:
                watcher(*state)
            progress.advance(task)

        found = run_again(run, watch, experiment)
    if json:
        print_json({"file": str(file), **found.to_dict()})
    else:
        _show(found, run, screen)
        if video is not None:
            screen.print(f"written to {video}")
    if web:
        _serve(kept, web_host, web_port, web_token, screen)
    if not found.same:
        raise typer.Exit(1)


def _serve(kept: Kept, host: str, port: int, token: str | None, screen: Console) -> None:
    """Show the run in the browser until Ctrl-C."""
    from qpsafe.cli.web import announce, asked_to_leave
    from qpsafe.sim.web.player import Player
    from qpsafe.sim.web.server import Page, token_for

    page = Page(host, port, "qpsafe replay", token_for(host, token))
    try:
        player = Player(kept, page)
        announce(screen, host, page.address)
        with asked_to_leave() as leave:
            player.serve(leave)
    finally:
        page.close()


def _watchers(run: RunFile, experiment: Any, video: Path | None, view: bool, stack: ExitStack) -> list[Any]:
    """What draws the recorded states."""
    from qpsafe.danger.activation import Activation
    from qpsafe.sensing.skin.spots import load_spots
    from qpsafe.sim.drawing.film import Film, Viewer
    from qpsafe.sim.drawing.gl import gl_available
    from qpsafe.sim.recording.run_file import RunFileError
    from qpsafe.sim.replay.stage import Stage

    stage = Stage(run, experiment)
    spots = load_spots(experiment.robot)
    assert spots is not None
    observers: list[Any] = []
    if video is not None:
        available, reason = gl_available()
        if not available:
            raise RunFileError(f"no video: {reason}")
        observers.append(stack.enter_context(Film(video, experiment.scene, spots, Activation())).observe)
    if view:
        viewer = Viewer(experiment.scene, spots, Activation())
        stack.callback(viewer.close)
        observers.append(viewer.observe)

    def watch(k: int, tick: Any) -> None:
        if stage.show(k):
            for observer in observers:
                observer(tick, experiment.scene, stage)

    return [watch]


def _show(found: Replay, run: RunFile, screen: Console) -> None:
    from rich.text import Text

    recorded = run.header["versions"].get("qpsafe", "?")
    if found.same:
        all_of_it = f": all {counted(found.ticks, 'tick')}, every bit (recorded with qpsafe {recorded})"
        screen.print(Text.assemble(("same", "green"), all_of_it))
    else:
        first = found.first
        assert first is not None
        screen.print(
            Text.assemble(
                ("different", "red"),
                f": {found.different} of {counted(found.ticks, 'tick')}; the first is tick {first.tick} "
                f"at {first.time:.3f} s: {first.what} was {first.recorded}, is {first.replayed} "
                f"(difference {first.largest:.3g}); largest difference of q_ref {found.largest:.3g} rad",
            )
        )
    for change in found.changed:
        screen.print(f"changed since: {change}", style="yellow")
