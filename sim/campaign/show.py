"""One trial played again, in the whole scene: a video, and a table of every tick."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.closest import closest
from qpsafe.sim.campaign.contact import part_name
from qpsafe.sim.campaign.measures import measures
from qpsafe.sim.campaign.meeting import meeting
from qpsafe.sim.campaign.servo import DT
from qpsafe.sim.campaign.trial import recorded
from qpsafe.sim.drawing.film import Film
from qpsafe.sim.world.scene import build_scene

if TYPE_CHECKING:
    from qpsafe.sim.campaign.meeting import Case, Meeting
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.recording import Recording
    from qpsafe.tick import Tick

Array = NDArray[np.float64]


def show(
    plan: Plan, what: int | Case, controller: str, out: Path, *,
    video: bool = True, progress: Callable[[float], None] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Play a trial again: a table of its ticks, a video, and its row with every bit that it had in the campaign.

    Video and table are of a run tick by tick; a campaign's own, where it is compiled as a whole, is the same within
    1e-9 rad.

    Args:
        plan: The campaign.
        what: Number of a trial from 0, or a case that the search for the worst has found.
        controller: Name of one.
        out: Folder of the files, which is made if need be.
        video: Whether to draw.
        progress: Told the share that is done.

    Raises:
        MissingExtraError: A video without the extra "video".
    """
    met = meeting(plan, what)
    out.mkdir(parents=True, exist_ok=True)
    place = f"trial-{what}" if isinstance(what, int) else "case"
    name = f"{place}-{controller.replace(':', '-').replace('/', '-')}"
    answers: list[tuple[float, float, float, str]] = []

    def note(k: int, q: Array, tick: Tick) -> None:
        answers.append((tick.cdf_n, tick.m, tick.f, tick.regime))
        if progress is not None:
            progress((k + 1) / len(met.tracks))

    if video:
        run = _filmed(plan, met, controller, out / f"{name}.mp4", note)
    else:
        run = recorded(plan, met, controller, note)
    _write_table(out / f"{name}.csv", met, run, answers)
    return measures(plan, met, controller, recorded(plan, met, controller))


def _filmed(plan: Plan, met: Meeting, controller: str, path: Path, note: Callable[..., None]) -> Recording:
    """Play it before the camera."""
    place, story = met.station, met.story
    furnish = None if place.cell is None else place.cell.furnish
    scene = build_scene(place.robot, pedestal=place.pedestal, people=story.persons, furnish=furnish)
    data, usual = scene.make_data(place.start), place.controller()
    assert usual.spots is not None
    with Film(path, scene, usual.spots, usual.activation) as film:

        def observe(k: int, q: Array, tick: Tick) -> None:
            note(k, q, tick)
            if k % film.every == 0:
                data.qpos[scene.q_addresses] = q
                scene.place_people(data, story.poses(k * DT))
                film.observe(tick, scene, SimpleNamespace(scene=scene, data=data, q=q))  # type: ignore[arg-type]

        return recorded(plan, met, controller, observe)


def _write_table(path: Path, met: Meeting, run: Recording, answers: list[tuple[float, float, float, str]]) -> None:
    """Every tick as a row, the file whole or not at all."""
    near = closest(met.station, run.q, met.tracks)
    joints = met.station.robot.joint_names
    head = ["time [s]", "distance [m]", "body", "part", "points seen", "cdf_n", "m", "f", "regime", "phase", "status",
            "path time [s]", *(f"q {j} [rad]" for j in joints), *(f"qd {j} [rad/s]" for j in joints)]  # fmt: skip
    part = path.with_name(path.name + ".part")
    try:
        with part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(head)
            for k, (cdf_n, m, f, regime) in enumerate(answers):
                figures = (f"{value:.9g}" for value in (*run.q[k], *run.qd[k]))
                writer.writerow(
                    [f"{k * run.dt:.3f}", f"{near.distance[k]:.6f}", met.station.body_name(int(near.body[k])),
                     part_name(met.tracks, int(near.segment[k])), len(run.points[k]), f"{cdf_n:.6g}", f"{m:.6g}",
                     f"{f:.6g}", regime, run.phase[k], run.status[k], f"{run.path_time[k]:.6f}", *figures]
                )  # fmt: skip
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
