"""Snapshots like the paper's Fig. 14 (a) to (h): found by what happened in a run, drawn into one picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qpsafe.sim.experiments.pick_place.experiment import STATES, PickPlaceExperiment, PickRun
from qpsafe.sim.recording.log import RunLog

if TYPE_CHECKING:
    from qpsafe.sim.drawing.render import Camera

APART = 2.0  # two visits have at least this much time without detection in between [s]
COLOURS = {"low": "#2e8b4a", "medium": "#c99700", "high": "#c0392b"}


class Moment(NamedTuple):
    """A snapshot: its letter in the paper's figure, its tick, and what it shows."""

    letter: str
    tick: int
    what: str


class Visit(NamedTuple):
    """Ticks from the first to the last detection of a person, and the number of the person, -1 if nothing was done."""

    first: int
    last: int
    person: int


def visits(run: PickRun) -> list[Visit]:
    """Stretches of a run in which somebody is detected, with who took or placed a screw in them."""
    seen = np.flatnonzero(run.log.cdf_n > 0.0)
    if not len(seen):
        return []
    breaks = np.flatnonzero(np.diff(seen) > round(APART / run.log.dt))
    firsts, lasts = [seen[0], *seen[breaks + 1]], [*seen[breaks], seen[-1]]
    found = []
    for first, last in zip(firsts, lasts, strict=True):
        who = [e.person for e in run.events if e.kind in ("take", "place") and first <= e.tick <= last]
        found.append(Visit(int(first), int(last), who[0] if who else -1))
    return found


def moments(run: PickRun) -> list[Moment]:
    """The moments of Fig. 14 that a run has, in the order of their letters."""
    found: list[Moment] = []

    def add(letter: str, tick: int | None, what: str) -> None:
        if tick is not None:
            found.append(Moment(letter, tick, what))

    def event(kind: str, after: int = 0, before: int = 10**9) -> int | None:
        return next((e.tick for e in run.events if e.kind == kind and after <= e.tick <= before), None)

    add("a", event("grip"), "takes a screw from the support")
    add("b", event("release"), "drops the screw into the box")
    there = visits(run)
    first = next((v for v in there if event("take", v.first, v.last) is not None), None)
    if first is not None:
        taken = event("take", first.first, first.last)
        assert taken is not None
        add("c", taken, "a person takes a screw")
        add("d", _peak(run.log, first), "evasive action, danger highest")
        add("e", event("release", first.last), "resumes its task, drops the screw")
        others = [v for v in there if v.first > first.last and v.person not in (first.person, -1)]
        if others:
            second = others[0]
            add("f", second.first, "another person comes")
            add("g", _peak(run.log, second), "evasive action, danger highest")
            add("h", _resumed(run.log, second), "the person leaves, the task goes on")
    return found


def _peak(log: RunLog, visit: Visit) -> int:
    inside = slice(visit.first, visit.last + 1)
    return visit.first + int(np.argmax(np.nan_to_num(log.cdf_n[inside])))


def _resumed(log: RunLog, visit: Visit) -> int | None:
    """When the path goes on for good after a visit."""
    away = np.flatnonzero((log.phase != "following") | (log.regime != "low"))
    away = away[(away >= visit.first) & (away <= visit.last + round(APART / log.dt))]
    tick = int(away[-1]) + 1 if len(away) else None
    return tick if tick is not None and tick < len(log.time) else None


def draw(experiment: PickPlaceExperiment, run: PickRun, path: Path) -> list[Moment]:
    """Draw the moments of a run into one picture; needs OpenGL (`qpsafe.sim.drawing.gl.gl_available`).

    Args:
        experiment: Of the run.
        run: The run.
        path: PNG or PDF to write, whole or not at all.

    Returns:
        What is shown.
    """
    import matplotlib

    from qpsafe.sim.drawing.plots import STYLE
    from qpsafe.sim.drawing.render import Camera
    from qpsafe.sim.experiments.pick_place.cell import CAMERA
    from qpsafe.text.figure_file import save

    found = moments(run)
    if not found:
        return found
    camera = Camera(experiment.scene, (640, 480), camera=CAMERA)
    try:
        frames = [picture(experiment, run, moment.tick, camera) for moment in found]
    finally:
        camera.close()
    from matplotlib.figure import Figure

    rows, columns = -(-len(found) // 4), min(4, len(found))
    with matplotlib.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(2.6 * columns, 2.5 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for axis in axes[len(found) :]:
            axis.set_visible(False)
        for axis, moment, frame in zip(axes, found, frames, strict=False):
            regime = str(run.log.regime[moment.tick])
            axis.imshow(frame)
            axis.set(xticks=[], yticks=[])
            axis.set_title(f"({moment.letter}) {run.log.time[moment.tick]:.1f} s: {moment.what}", fontsize=7.5)
            axis.set_xlabel(f"{regime} danger, {run.log.phase[moment.tick]}", fontsize=7.5, color=COLOURS[regime])
            for side in axis.spines.values():
                side.set(color=COLOURS[regime], linewidth=2.0)
        save(figure, path)
    return found


def picture(experiment: PickPlaceExperiment, run: PickRun, tick: int, camera: Camera) -> Any:
    """The scene as it was at a tick (within `STATES` ticks), (height, width, 3) RGB.

    Args:
        experiment: What was run.
        run: Its log and states.
        tick: Which.
        camera: What it is seen by.
    """
    state = min(tick // STATES, len(run.states) - 1)
    data = experiment.scene.make_data()
    data.qpos[:] = run.states[state]
    time = state * STATES * run.log.dt
    experiment.scene.place_people(data, [person.pose(time) for person in experiment.people])
    return np.ascontiguousarray(camera.picture(data))
