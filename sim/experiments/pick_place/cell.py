"""The third experiment's cell: two tables, a support that screws stand in, a box, and the screws themselves.

Screws are free bodies: they stand in the holes, hang on the gripper and lie in the box by contact and weld alone. Only
screws, support, box, tables and floor touch each other; robot and people pass through them, so that a run cannot hide
a collision behind a push. A screw that rests is put to sleep by MuJoCo and costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise, product
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.world.scene import ROBOT_COLLISION, Scene
from qpsafe.sim.world.surroundings import SCENERY, add_camera

Array = NDArray[np.float64]

TABLE_TOP = 0.33  # above the robot's base; 0.88 m above the floor, for people who stand [m]
CAMERA = "cell"
PROGRAM = Path(__file__).with_name("pick_place.toml")  # the work done in it
WOOD, ALUMINIUM, BLUE, BRASS = (
    (0.80, 0.72, 0.60, 1),
    (0.62, 0.64, 0.67, 1),
    (0.20, 0.34, 0.52, 1),
    (0.85, 0.62, 0.18, 1),
)
PARTS = 1  # bit of what touches


class Screw:
    """Measures of a screw; its frame lies in the middle of the head's top, z along the axis away from the tip [m]."""

    HEAD_RADIUS, HEAD = 0.010, 0.008
    SHANK_RADIUS, SHANK = 0.0045, 0.030
    MASS = 0.02  # [kg]


class Support(NamedTuple):
    """The plate with the holes [m].

    Attributes:
        centre: On the table (2,).
        columns, rows: Of holes, along x and y.
        pitch: Between holes.
        hole: Width of the square holes.
        thickness: Of the plate.
        margin: Beyond the outer holes.
    """

    centre: tuple[float, float] = (0.44, 0.40)
    columns: int = 5
    rows: int = 2
    pitch: float = 0.05
    hole: float = 0.010
    thickness: float = 0.036
    margin: float = 0.03


class Box(NamedTuple):
    """The box that screws are dropped into: inner measures [m]."""

    centre: tuple[float, float] = (0.44, -0.40)
    length: float = 0.20
    width: float = 0.18
    height: float = 0.07
    wall: float = 0.008


class Table(NamedTuple):
    """Top of a table, two panels carry it [m]."""

    name: str
    centre: tuple[float, float]
    length: float = 0.38
    width: float = 0.32
    thickness: float = 0.04


@dataclass(frozen=True)
class Cell:
    """Layout of the cell; pass `furnish` to `build_scene`.

    Attributes:
        support, box, tables: What stands where.
        full: How many holes have a screw at the beginning.
        carried: How many screws people bring along.
        top: Height of the tables above the robot's base [m].
    """

    support: Support = field(default_factory=Support)
    box: Box = field(default_factory=Box)
    tables: tuple[Table, ...] = (Table("left table", (0.49, 0.43)), Table("right table", (0.49, -0.43)))
    full: int = 10
    carried: int = 0
    top: float = TABLE_TOP

    @property
    def holes(self) -> Array:
        """Where the head of a screw in each hole has its top, (holes, 3) [m], row by row."""
        s = self.support
        x, y = (s.pitch * (np.arange(count) - 0.5 * (count - 1)) for count in (s.columns, s.rows))
        z = self.top + s.thickness + Screw.HEAD
        return np.array([(s.centre[0] + dx, s.centre[1] + dy, z) for dy, dx in product(y, x)])

    @property
    def screws(self) -> int:
        """Number of screws."""
        return self.full + self.carried

    def in_box(self, points: Array) -> NDArray[np.bool_]:
        """Which of some points (k, 3) lie in the box, (k,)."""
        b = self.box
        inside = np.abs(points[:, :2] - b.centre) <= (0.5 * b.length, 0.5 * b.width)
        height = points[:, 2] - self.top
        return inside.all(axis=1) & (height > 0.0) & (height < b.height + Screw.HEAD)

    def furnish(self, spec: Any) -> None:
        """Put everything into a scene that has the robot in it already."""
        option = spec.option
        option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
        for geom in spec.geoms:
            if geom.group == ROBOT_COLLISION:
                geom.contype = geom.conaffinity = 0
        add_camera(spec.worldbody, CAMERA, [3.3, -0.75, 1.75], [0.30, 0.0, 0.26], 34.0)
        for table in self.tables:
            _add_table(spec.worldbody, table, self.top, self._floor(spec))
        _add_support(spec.worldbody, self)
        _add_box(spec.worldbody, self.box, self.top)
        for k in range(self.screws):
            place = self.holes[k] if k < self.full else (-3.0 - 0.1 * k, 0.0, self._floor(spec) + 0.05)
            _add_screw(spec, k, place)

    @staticmethod
    def _floor(spec: Any) -> float:
        return float(spec.geom("floor").pos[2])


@dataclass(frozen=True)
class Parts:
    """Where a scene keeps its screws.

    Attributes:
        bodies: (k,).
        q_addresses: First of seven in `qpos`, (k,).
        v_addresses: First of six in `qvel`, (k,).
        welds: Equality that holds each in the gripper, (k,).
        trees: Kinematic tree of each, which is what sleeps, (k,).
    """

    bodies: NDArray[np.intp]
    q_addresses: NDArray[np.intp]
    v_addresses: NDArray[np.intp]
    welds: NDArray[np.intp]
    trees: NDArray[np.intp]

    @classmethod
    def of(cls, scene: Scene, count: int) -> Parts:
        """The screws of a scene furnished by a cell with so many."""
        model, names = scene.model, [f"screw {k}" for k in range(count)]
        joints = [model.joint(name).id for name in names]
        bodies = np.array([model.body(name).id for name in names], np.intp)
        return cls(
            bodies,
            model.jnt_qposadr[joints].astype(np.intp),
            model.jnt_dofadr[joints].astype(np.intp),
            np.array([model.equality(name).id for name in names], np.intp),
            model.body_treeid[bodies].astype(np.intp),
        )

    def positions(self, data: Any) -> Array:
        """Top of each head, (k, 3) [m]."""
        return data.qpos[self.q_addresses[:, None] + np.arange(3)]

    def axes(self, data: Any) -> Array:
        """Direction of each screw from its tip to its head, (k, 3)."""
        w, x, y, z = data.qpos[self.q_addresses[:, None] + np.arange(3, 7)].T
        return np.stack((2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z), axis=1)

    def speeds(self, data: Any) -> Array:
        """Of each head, (k,) [m/s]."""
        return np.linalg.norm(data.qvel[self.v_addresses[:, None] + np.arange(3)], axis=1)

    def put(self, data: Any, k: int, position: Array) -> None:
        """Place a screw upright and at rest, its head's top at a position (3,) [m].

        Args:
            data: MuJoCo's state.
            k: Which screw.
            position: (3,) [m].
        """
        q, v = self.q_addresses[k], self.v_addresses[k]
        data.qpos[q : q + 7] = (*position, 1.0, 0.0, 0.0, 0.0)
        data.qvel[v : v + 6] = 0.0

    def hold(self, data: Any, k: int) -> None:
        """Weld a screw to the gripper."""
        data.eq_active[self.welds[k]] = 1

    def drop(self, data: Any, k: int) -> None:
        """Let go of a screw. One that hung still for long would fall asleep in the air: it is given time to fall."""
        data.eq_active[self.welds[k]] = 0
        data.tree_asleep[self.trees[k]] = -(1 + mujoco.mjMINAWAKE)


_GEOM = mujoco.mjtGeom
_FIXED = {"group": SCENERY, "contype": PARTS, "conaffinity": PARTS, "friction": [0.6, 0.005, 0.0001]}


def _add_block(world: Any, name: str, low: Any, high: Any, colour: tuple[float, ...]) -> None:
    """A box from its lowest to its highest corner."""
    low, high = np.asarray(low), np.asarray(high)
    world.add_geom(
        name=name, type=_GEOM.mjGEOM_BOX, size=0.5 * (high - low), pos=0.5 * (low + high), rgba=colour, **_FIXED
    )


def _add_table(world: Any, table: Table, top: float, floor: float) -> None:
    x, y, half, side = *table.centre, 0.5 * table.length, 0.5 * table.width
    under = top - table.thickness
    _add_block(world, table.name, (x - half, y - side, under), (x + half, y + side, top), WOOD)
    for name, at in (("near", x - half + 0.02), ("far", x + half - 0.06)):
        low, high = (at, y - side + 0.03, floor), (at + 0.04, y + side - 0.03, under)
        _add_block(world, f"{table.name} {name} panel", low, high, ALUMINIUM)


def _add_support(world: Any, cell: Cell) -> None:
    """A plate of strips that leave the holes free: long ones between the rows, short ones between the holes."""
    s = cell.support
    body = world.add_body(name="support", pos=[*s.centre, cell.top])
    x, y = (s.pitch * (np.arange(count) - 0.5 * (count - 1)) for count in (s.columns, s.rows))
    edge_x, edge_y = np.abs(x).max() + s.margin, np.abs(y).max() + s.margin
    gaps_x, gaps_y = (_gaps(centres, s.hole, edge) for centres, edge in ((x, edge_x), (y, edge_y)))
    for i, (a, b) in enumerate(gaps_y):
        _add_block(body, f"support strip {i}", (-edge_x, a, 0.0), (edge_x, b, s.thickness), ALUMINIUM)
    for j, centre in enumerate(y):
        for i, (a, b) in enumerate(gaps_x):
            low, high = (a, centre - 0.5 * s.hole, 0.0), (b, centre + 0.5 * s.hole, s.thickness)
            _add_block(body, f"support bridge {j} {i}", low, high, ALUMINIUM)


def _gaps(centres: NDArray, width: float, edge: float) -> list[tuple[float, float]]:
    """What is left of (-edge, edge) without stretches of a width about some centres."""
    ends = [-edge, *np.ravel([(c - 0.5 * width, c + 0.5 * width) for c in centres]), edge]
    return [(float(a), float(b)) for a, b in list(pairwise(ends))[::2]]


def _add_box(world: Any, box: Box, table: float) -> None:
    x, y, a, b, wall = *box.centre, 0.5 * box.length, 0.5 * box.width, box.wall
    z, top = table, table + box.height
    sides = {
        "floor": ((x - a, y - b, z), (x + a, y + b, z + wall)),
        "near": ((x - a - wall, y - b - wall, z), (x - a, y + b + wall, top)),
        "far": ((x + a, y - b - wall, z), (x + a + wall, y + b + wall, top)),
        "left": ((x - a, y + b, z), (x + a, y + b + wall, top)),
        "right": ((x - a, y - b - wall, z), (x + a, y - b, top)),
    }
    for name, (low, high) in sides.items():
        _add_block(world, f"box {name}", low, high, BLUE)


def _add_screw(spec: Any, k: int, place: Any) -> None:
    name = f"screw {k}"
    body = spec.worldbody.add_body(name=name, pos=list(place))
    body.add_freejoint(name=name)
    looks = {**_FIXED, "rgba": BRASS, "mass": 0.5 * Screw.MASS}
    head, shank = 0.5 * Screw.HEAD, 0.5 * Screw.SHANK
    body.add_geom(type=_GEOM.mjGEOM_CYLINDER, size=[Screw.HEAD_RADIUS, head, 0], pos=[0, 0, -head], **looks)
    middle = -Screw.HEAD - shank
    straight = shank - Screw.SHANK_RADIUS  # a round tip, on which nothing stands
    body.add_geom(type=_GEOM.mjGEOM_CAPSULE, size=[Screw.SHANK_RADIUS, straight, 0], pos=[0, 0, middle], **looks)
    # the gripper's frame looks along the axis into the head: half a turn about y
    body.add_site(name=f"{name} grip", quat=[0.0, 0.0, 1.0, 0.0], group=5)
    weld = spec.add_equality(name=name, type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_SITE)
    weld.name1, weld.name2, weld.active = "robot/tcp", f"{name} grip", False
    weld.solref = [0.01, 1.0]
