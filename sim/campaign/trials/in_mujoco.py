"""The same trial in MuJoCo, tick by tick: its rays, distances or dynamics in place of the engine's.

What is shared is the controller and where people are; shapes, rays and distances are MuJoCo's own here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.opponents.registry import opponent
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.rays import cast
from qpsafe.sim.world.scene import Scene, build_scene

if TYPE_CHECKING:
    from qpsafe.sensing.skin.spots import SpotArray
    from qpsafe.sim.campaign.trials.meeting import Meeting

Array = NDArray[np.float64]

RING = 6  # rays on the mantle of a cone


class Reference(NamedTuple):
    """A run in MuJoCo, T ticks.

    Attributes:
        q: Measured (T, n) [rad].
        reference_q: What was asked for (T, n) [rad].
        readings: Of the spots (T, k) [m].
        distance: Robot to people at every `every`th tick, +inf beyond `far` [m].
    """

    q: Array
    reference_q: Array
    readings: Array
    distance: Array


def reference(
    met: Meeting, controller: str, *, dynamics: bool = False, every: int = 1, far: float = 1.0, ticks: int | None = None
) -> Reference:
    """Run a controller that is told what ideal spots read.

    Args:
        met: The encounter.
        controller: Its name.
        dynamics: Whether torques move the robot, see `Plant`; else it is where it was told to be.
        every: Ticks between two measurements of the distance.
        far: Larger distances are not measured [m].
        ticks: T; by default all.
    """
    place, story = met.station, met.story
    furnish = None if place.cell is None else place.cell.furnish
    scene = build_scene(place.robot, pedestal=place.pedestal, people=story.persons, furnish=furnish)
    plant = Plant(scene, q=place.start)
    data, controls, poses = plant.data, opponent(controller).make(place), PosesAhead(story.people, DT)
    spots = place.controller().spots
    assert spots is not None
    count, n = len(met.tracks) if ticks is None else ticks, place.robot.nq
    measured, asked, readings = np.empty((count, n)), np.empty((count, n)), np.empty((count, len(spots)))
    distance = np.empty(len(range(0, count, every)))
    q, qd = place.start, np.zeros(n)
    bodies = _bodies(scene, spots)
    for k in range(count):
        if dynamics:
            q, qd = plant.q, plant.qd
        else:
            data.qpos[scene.q_addresses] = q
        scene.place_people(data, poses(k))
        measured[k], readings[k] = q, _readings(scene, data, spots, bodies, q)
        if k % every == 0:
            distance[k // every] = _distance(scene, data, far)
        tick = controls.step(q, qd, readings[k])
        asked[k] = tick.reference.q
        if dynamics:
            plant.apply(tick.reference.q - DT * tick.reference.qd, tick.reference.qd)
            plant.advance()
        else:
            q, qd = tick.reference.q, tick.reference.qd
    return Reference(measured, asked, readings, distance)


def _bodies(scene: Scene, spots: SpotArray) -> NDArray[np.intp]:
    from qpsafe.sim.engine.spot_table import scene_body

    return np.array([scene_body(scene, frame) for frame in spots.frames], dtype=np.intp)


def _readings(scene: Scene, data: Any, spots: SpotArray, bodies: NDArray[np.intp], q: Array) -> Array:
    """The nearest surface along the axis and the mantle of each cone, by `mj_multiRay`."""
    origins, axes = spots.rays(scene.robot.at(q))
    u = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.8, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v, angle = np.cross(axes, u), 2.0 * np.pi / RING * np.arange(RING)[None, :, None]
    slant = np.tan(0.5 * spots.field_of_view)[:, None, None]
    mantle = axes[:, None] + slant * (np.cos(angle) * u[:, None] + np.sin(angle) * v[:, None])
    rays = np.concatenate((axes[:, None], mantle), axis=1)
    return cast(scene, data, origins, rays, spots.range_max, bodies=bodies).min(axis=1)


def _distance(scene: Scene, data: Any, far: float) -> float:
    """Smallest distance of the robot's geoms to people and boards by `mj_geomDistance` [m]; +inf beyond `far`."""
    model, robot = scene.model, scene.robot_geoms
    others = np.concatenate((scene.person_geoms, scene.board_geoms))
    gaps = np.linalg.norm(data.geom_xpos[robot][:, None] - data.geom_xpos[others][None], axis=2)
    gaps -= model.geom_rbound[robot][:, None] + model.geom_rbound[others]
    best, segment = far, np.empty(6)
    for i in np.argsort(gaps, axis=None):
        r, o = divmod(int(i), len(others))
        if gaps[r, o] > max(best, 0.0):
            break
        best = min(best, mujoco.mj_geomDistance(model, data, robot[r], others[o], far, segment))
    return best if best < far else np.inf
