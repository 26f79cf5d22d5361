"""What watches a run: film, viewer, recorder, progress."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment, Observer
    from qpsafe.sim.recording.run_file import StateRecorder


@contextmanager
def observed(
    experiment: FixedExperiment,
    path: Path,
    video: bool,
    view: bool,
    screen: Console,
    progress: Progress,
    label: str,
    states: StateRecorder | None = None,
) -> Iterator[tuple[Observer, bool]]:
    """What to call at every tick to film, show, keep and count it, and whether it is filmed; says in a line why not.

    After a run without a film, one of an earlier run is removed from its folder.

    Args:
        experiment: What is watched.
        path: Of the video.
        video: Whether to film.
        view: Whether to open MuJoCo's viewer.
        screen: Where to say why there is no video or viewer.
        progress: Where ticks are counted.
        label: What the bar says.
        states: Keeps states for a run file; None keeps none.
    """
    from qpsafe.danger.thresholds import robot_activation
    from qpsafe.errors import MissingExtraError
    from qpsafe.sim.drawing.film import Film, Viewer
    from qpsafe.sim.drawing.gl import gl_available
    from qpsafe.sim.ranging.sets import lines_of_sight

    spots = lines_of_sight(experiment.sensor, experiment.robot)
    activation = robot_activation(experiment.robot)
    with ExitStack() as stack:
        observers: list[Any] = [] if states is None else [states.observe]
        filmed = False
        if video and not view:
            available, reason = gl_available()
            try:
                if available:
                    film = Film(path, experiment.scene, spots, activation)
                    observers.append(stack.enter_context(film).observe)
                    filmed = True
            except MissingExtraError as error:
                available, reason = False, str(error)
            if not available:
                screen.print(f"no video: {reason}", style="yellow")
        if view:
            viewer = Viewer(experiment.scene, spots, activation)
            stack.callback(viewer.close)
            observers.append(viewer.observe)
        task = progress.add_task(label, total=round(experiment.duration / 0.004))

        def observe(*state: Any) -> None:
            for observer in observers:
                observer(*state)
            progress.advance(task)

        yield observe, filmed
        if not filmed:
            forget(path, screen)


def forget(path: Path, screen: Console) -> None:
    """Remove a file that this run does not write: one of an earlier run would be taken for its.

    Args:
        path: Of the file, if there is one.
        screen: Where it is said.
    """
    if path.is_file():
        path.unlink()
        screen.print(f"removed {path.name}: it was of an earlier run", style="yellow", markup=False)
