"""Writes arms in URDF that mix what the format can say, drawn from a seed; meshes as STL files of their own."""

from __future__ import annotations

import struct
from itertools import product
from pathlib import Path

import numpy as np

KINDS = ("revolute", "revolute", "revolute", "continuous", "prismatic", "fixed")
WEDGE = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])  # no symmetry: a mirrored one is another


class Writer:
    """One arm.

    Attributes:
        text: The URDF.
        mimic: None, or the follower of a controlled joint, which cannot be read.
        held: Joints that are held without being asked, and where.
        boxes: Link -> lower and upper corner (2, 3) of each collision shape in the link's frame, exact for flat shapes.
    """

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.rng = folder, np.random.default_rng(seed)
        self.same_names = self.rng.random() < 0.4
        self.mimic: str | None = None
        self.held: dict[str, float] = {}
        self.boxes: dict[str, list[np.ndarray]] = {}
        self.parts: list[str] = [self.link("base")]
        tip = self.chain("", "base", int(self.rng.integers(3, 8)))
        if self.rng.random() < 0.25:
            self.chain("right_", "base", int(self.rng.integers(2, 5)))
        extra = self.rng.random()
        if extra < 0.2:
            self.fingers(tip)
        elif extra < 0.4:
            self.gripper(tip)
        elif extra < 0.55:
            self.parallelogram(tip)
        self.rng.shuffle(self.parts)  # no order is promised
        rest = (
            '<material name="m"><color rgba="1 0 0 1"/></material><transmission name="t"><type>x</type></transmission>'
        )
        self.text = f'<robot name="mix" xmlns:xacro="http://wiki.ros.org/xacro">{"".join(self.parts)}{rest}</robot>'

    def write(self) -> Path:
        path = self.folder / "mix.urdf"
        path.write_text(self.text)
        return path

    def chain(self, prefix: str, parent: str, n: int) -> str:
        for i in range(n):
            kind = "revolute" if i < 2 else KINDS[self.rng.integers(len(KINDS))]
            joint = f"{prefix}axis{i}"
            child = joint if self.same_names else f"{prefix}link{i}"
            self.parts += [self.link(child), self.joint(joint, kind, parent, child)]
            parent = child
        self.parts += [self.link(f"{prefix}flange"), self.joint(f"{prefix}mount", "fixed", parent, f"{prefix}flange")]
        return f"{prefix}flange"

    def fingers(self, parent: str) -> None:
        """Two sliding joints side by side."""
        for side in ("left", "right"):
            self.parts += [self.link(f"{side}_pad"), self.joint(f"{side}_finger", "prismatic", parent, f"{side}_pad")]
            self.held[f"{side}_finger"] = 0.0

    def gripper(self, parent: str) -> None:
        """A joint that others mimic on another branch, with an offset."""
        offset, factor = self.rng.uniform(-0.3, 0.3), self.rng.uniform(-2.0, 2.0)
        mimic = f'<mimic joint="knuckle" multiplier="{factor!r}" offset="{offset!r}"/>'
        self.parts += [self.link("knuckle_link"), self.joint("knuckle", "revolute", parent, "knuckle_link")]
        self.parts += [self.link("thumb_link"), self.joint("thumb", "revolute", parent, "thumb_link", mimic)]
        self.held |= {"knuckle": 0.0, "thumb": offset}

    def parallelogram(self, parent: str) -> None:
        """A joint of the chain that another one further on mimics."""
        self.mimic = "level"
        mimic = '<mimic joint="axis0" multiplier="-1"/>'
        self.parts += [self.link("plate"), self.joint("level", "revolute", parent, "plate", mimic)]

    def joint(self, name: str, kind: str, parent: str, child: str, more: str = "") -> str:
        low, high = (float(x) for x in np.sort(self.rng.uniform(-2.5, 2.5, 2)))
        axis = np.eye(3)[self.rng.integers(3)] if self.rng.random() < 0.5 else self.rng.normal(size=3)
        body = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{_words(axis)}"/>{self.origin()}{more}'
        if self.rng.random() < 0.3:
            body += '<dynamics damping="0.1"/><safety_controller k_velocity="1"/>'
        if kind in ("revolute", "prismatic"):
            body += f'<limit lower="{min(low, -0.4)!r}" upper="{max(high, 0.4)!r}" velocity="2" effort="9"/>'
        elif kind == "continuous" and self.rng.random() < 0.5:
            body += '<limit velocity="2" effort="9"/>'
        return f'<joint name="{name}" type="{kind}">{body}</joint>'

    def link(self, name: str) -> str:
        body = ""
        if self.rng.random() < 0.8:
            moments = 'ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="-0.002" iyz="0"'
            body += f'<inertial>{self.origin()}<mass value="1.5"/><inertia {moments}/></inertial>'
        if self.rng.random() < 0.3:
            body += '<visual><geometry><mesh filename="package://nowhere/seen.dae"/></geometry></visual>'
        for _ in range(self.rng.integers(0, 3)):
            body += self.collision(name)
        return f'<link name="{name}">{body}</link>'

    def collision(self, link: str) -> str:
        xyz, rpy = self.rng.uniform(-0.3, 0.3, 3), self.rng.uniform(-3.0, 3.0, 3)
        shape = self.rng.integers(3)
        if shape == 0:
            size = self.rng.uniform(0.02, 0.3, 3)
            points = np.array(list(product((-0.5, 0.5), repeat=3))) * size
            text = f'<box size="{_words(size)}"/>'
        elif shape == 1:
            scale = self.rng.uniform(0.2, 3.0, 3) * self.rng.choice((-1.0, 1.0), 3)
            points = WEDGE * scale
            text = f'<mesh filename="{self.stl(np.float32(WEDGE))}" scale="{_words(scale)}"/>'
        else:
            radius = self.rng.uniform(0.02, 0.2)
            points = None
            text = f'<sphere radius="{radius!r}"/>'
        box = np.array([xyz - radius, xyz + radius]) if points is None else _box(points @ _turn(rpy).T + xyz)
        self.boxes.setdefault(link, []).append(box)
        return f'<collision><origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/><geometry>{text}</geometry></collision>'

    def stl(self, points: np.ndarray) -> str:
        """A tetrahedron as a binary STL file; its name."""
        triangles = [points[list(face)] for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
        data = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in triangles)
        (self.folder / "wedge.stl").write_bytes(bytes(80) + struct.pack("<I", 4) + data)
        return "wedge.stl" if self.rng.random() < 0.5 else f"package://{self.folder.name}/wedge.stl"

    def origin(self) -> str:
        xyz, rpy = self.rng.uniform(-0.4, 0.4, 3), self.rng.uniform(-3.0, 3.0, 3)
        return f'<origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>' if self.rng.random() < 0.9 else ""


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def _box(points: np.ndarray) -> np.ndarray:
    return np.array([points.min(axis=0), points.max(axis=0)])


def _turn(rpy: np.ndarray) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
