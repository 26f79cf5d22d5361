"""Random scenes, robots and people that the tests of the engine are done with."""

from __future__ import annotations

import mujoco
import numpy as np

import qpsafe
from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.people.anatomy import Body
from qpsafe.sim.people.person import Board, Person
from qpsafe.sim.people.posture import Arm, Posture, Stoop
from qpsafe.sim.world.scene import build_scene
from qpsafe.sim.world.surroundings import SCENERY

PEOPLE = (Person(board=Board()), Person(board=None, body=Body.of_height(1.9)))


def random_encounters(scene, count, seed, radii=(0.1, 1.6)):
    """Robot anywhere, people anywhere near it, in MuJoCo and as tracks: (data, state, tracks), `count` times."""
    rng, data, robot = np.random.default_rng(seed), scene.make_data(), scene.robot
    for _ in range(count):
        q = rng.uniform(robot.lower, robot.upper)
        data.qpos[scene.q_addresses] = q
        poses = []
        for person in scene.people:
            azimuth, radius = rng.uniform(-np.pi, np.pi), rng.uniform(*radii)
            facing = azimuth + np.pi + 0.5 * rng.normal()
            posture = None if person.board else reaching(rng)
            poses.append(person.pose(radius * np.cos(azimuth), radius * np.sin(azimuth), facing, posture=posture))
        scene.place_people(data, poses)
        yield data, robot.at(q), PersonTracks.of(scene.people, [poses], 0.004)


def reaching(rng):
    """Hands anywhere before the body, in reach or not, the back bent."""
    left, right = rng.uniform((0.1, -0.6, 0.3), (0.9, 0.6, 1.8), (2, 3))
    arms = Arm(goal=tuple(left.tolist())), Arm(goal=tuple(right.tolist()))
    return Posture(arms=arms, stoop=Stoop(rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.2)))


def add_shapes(rng, count=6, spread=0.9, group=SCENERY):
    """A `furnish` that adds shapes of every kind, turned and placed at random; among the meshes one is not convex."""

    def furnish(spec):
        kind = mujoco.mjtGeom
        spec.add_mesh(name="hull", uservert=rng.normal(0.0, 0.15, (30, 3)).ravel())
        spec.add_mesh(name="star", uservert=STAR[0].ravel(), userface=STAR[1].ravel())
        kinds = (kind.mjGEOM_SPHERE, kind.mjGEOM_CAPSULE, kind.mjGEOM_ELLIPSOID, kind.mjGEOM_CYLINDER, kind.mjGEOM_BOX)
        for i in range(count):
            for k in (*kinds, "hull", "star"):
                quaternion = rng.normal(size=4)
                looks = {"pos": rng.uniform(-spread, spread, 3), "quat": quaternion / np.linalg.norm(quaternion)}
                looks |= {"group": group, "contype": 0, "conaffinity": 0}
                if isinstance(k, str):
                    spec.worldbody.add_geom(name=f"{k} {i}", type=kind.mjGEOM_MESH, meshname=k, **looks)
                else:
                    spec.worldbody.add_geom(name=f"{k} {i}", type=k, size=rng.uniform(0.02, 0.25, 3), **looks)

    return furnish


def scene_of_shapes(seed, **options):
    """The first robot among shapes of every kind, nobody there."""
    furnish = add_shapes(np.random.default_rng(seed), **options)
    return build_scene(qpsafe.load_robot("irb140"), people=(), furnish=furnish)


def _star():
    """A box with pyramids pressed into its sides: no face of it is flat, and it is not convex."""
    corners = 0.2 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    vertices, faces = list(corners), []
    for side in sides:
        tip = len(vertices)
        vertices.append(0.4 * corners[list(side)].mean(axis=0))
        faces += [(a, b, tip) for a, b in zip(side, (*side[1:], side[0]), strict=True)]
    return np.array(vertices), np.array(faces)


STAR = _star()
