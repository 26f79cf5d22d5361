"""One trial played again, in the whole scene: a video, and a table of every tick."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import MissingExtraError
from qpsafe.reference import JointReference
from qpsafe.sim.campaign.digests import file_name_of
from qpsafe.sim.campaign.trials.closest import closest
from qpsafe.sim.campaign.trials.contact import part_name
from qpsafe.sim.campaign.trials.measures import measures
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.trials.trial import recorded
from qpsafe.sim.drawing.film import Film
from qpsafe.sim.world.scene import CAMERA, Scene, build_scene
from qpsafe.text.whole_file import whole_file

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.trials.meeting import Case, Meeting
    from qpsafe.sim.campaign.trials.recording import Recording
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

NEAR = 2.0  # people within so much of the robot are to be seen [m]
WIDE = 36.0  # angle of view [deg]


class Shown(NamedTuple):
    """What came of it.

    Attributes:
        row: Of the trial.
        files: That were written.
    """

    row: dict[str, Any]
    files: tuple[Path, ...]


def show(
    plan: Plan, what: int | Case, controller: str, out: Path, *, label: str = "case", video: bool = True,
    notice: Callable[[str], None] = warnings.warn, progress: Callable[[int, int], None] | None = None,
) -> Shown:  # fmt: skip
    """Play a trial again: a table of its ticks, a video, and its row with every bit that it had in the campaign.

    Video and table are of a run tick by tick; a campaign's own, where it is compiled as a whole, is the same within
    1e-9 rad.

    Args:
        plan: The campaign.
        what: Number of a trial from 0, or a case that the search for the worst has found.
        controller: Name of one.
        out: Folder of the files, which is made if need be.
        label: Begins the files' names where `what` is no number.
        video: Whether to draw.
        notice: Told in a line why there is no video.
        progress: Told how many ticks are done, and of how many.
    """
    met = meeting(plan, what)
    out.mkdir(parents=True, exist_ok=True)
    name = f"trial-{what}" if isinstance(what, int) else label
    name += "-" + file_name_of(controller)
    answers: list[tuple[float, float, float, str]] = []

    def note(k: int, q: Array, tick: Tick) -> None:
        answers.append((tick.cdf_n, tick.m, tick.f, tick.regime))
        if progress is not None:
            progress(k + 1, len(met.tracks))

    video_file, table_file = out / f"{name}.mp4", out / f"{name}.csv"
    film = _film(met, video_file, notice) if video else None
    with nullcontext() if film is None else film as observe:

        def seen(k: int, q: Array, tick: Tick) -> None:
            note(k, q, tick)
            if observe is not None:
                observe(k, q, tick)

        run = recorded(plan, met, controller, seen)
    _write_table(table_file, met, run, answers)
    files = (table_file,) if film is None else (video_file, table_file)
    return Shown(measures(plan, met, controller, recorded(plan, met, controller)), files)


def _film(
    met: Meeting, path: Path, notice: Callable[[str], None]
) -> AbstractContextManager[Callable[[int, Array, Tick], None]] | None:  # fmt: skip
    """What films an encounter; None where that is not possible here."""
    from qpsafe.sim.drawing.gl import gl_available

    available, reason = gl_available()
    if available:
        place = met.station
        furnish = None if place.cell is None else place.cell.furnish
        scene = build_scene(place.robot, pedestal=place.pedestal, people=met.story.persons, furnish=furnish)
        _look_across(scene, met)
        usual = place.controller()
        assert usual.spots is not None
        try:
            return _filming(Film(path, scene, usual.spots, usual.activation), scene, met)
        except MissingExtraError as error:
            reason = str(error)
    notice(f"no video: {reason}")
    return None


@contextmanager
def _filming(film: Film, scene: Scene, met: Meeting) -> Iterator[Callable[[int, Array, Tick], None]]:
    data = scene.make_data(met.station.start)

    def observe(k: int, q: Array, tick: Tick) -> None:
        if k % film.every:
            return
        data.qpos[scene.q_addresses] = q
        scene.place_people(data, met.story.poses(k * DT))
        # a controller may count its ticks in its own way, and need not know of danger vectors
        vectors = tick.vectors if len(tick.vectors) == len(tick.points) else np.zeros_like(tick.points)
        said = tick.reference
        reference = JointReference(k, k * DT, said.q, said.qd, said.active)
        film.observe(replace(tick, reference=reference, vectors=vectors), scene, _Seen(scene, data, q))  # type: ignore[arg-type]

    with film:
        yield observe


class _Seen(NamedTuple):
    """Of a plant what a film needs."""

    scene: Scene
    data: Any
    q: Array


def _look_across(scene: Scene, met: Meeting) -> None:
    """Turn the camera about the robot's base to where people come from the side, not from behind the camera."""
    centres = met.tracks.balls[::25, :, :2].reshape(-1, 2)
    ways = np.linalg.norm(centres, axis=1)
    near = ways < max(NEAR, float(ways.min()) + 0.5)
    people = np.arctan2(centres[near, 1], centres[near, 0])
    camera = scene.model.camera(CAMERA)
    eye = float(np.arctan2(camera.pos[1], camera.pos[0]))
    turns = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    # people at an angle φ from the camera's own direction: best at the side and a little behind the robot
    best = min(turns, key=lambda turn: float((np.abs(np.cos(people - eye - turn) + 0.3)).max()))
    half = np.array((np.cos(0.5 * best), 0.0, 0.0, np.sin(0.5 * best)))
    cosine, sine = np.cos(best), np.sin(best)
    x, y, z = camera.pos
    camera.pos[:] = cosine * x - sine * y, sine * x + cosine * y, z
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, half, camera.quat.copy())
    camera.quat[:] = turned
    camera.fovy[:] = WIDE


def _write_table(path: Path, met: Meeting, run: Recording, answers: list[tuple[float, float, float, str]]) -> None:
    """Every tick as a row, the file whole or not at all."""
    near = closest(met.station, run.q, met.tracks)
    joints = met.station.robot.joint_names
    head = ["time [s]", "distance [m]", "body", "part", "points seen", "cdf_n", "m", "f", "regime", "phase", "status",
            "path time [s]", *(f"q {j} [rad]" for j in joints), *(f"qd {j} [rad/s]" for j in joints)]  # fmt: skip
    with whole_file(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(head)
        for k, (cdf_n, m, f, regime) in enumerate(answers):
            figures = (f"{value:.9g}" for value in (*run.q[k], *run.qd[k]))
            writer.writerow(
                [f"{k * run.dt:.3f}", f"{near.distance[k]:.6f}", met.station.body_name(int(near.body[k])),
                 part_name(met.tracks, int(near.segment[k])), len(run.points[k]), f"{cdf_n:.6g}", f"{m:.6g}",
                 f"{f:.6g}", regime, run.phase[k], run.status[k], f"{run.path_time[k]:.6f}", *figures]
            )  # fmt: skip
