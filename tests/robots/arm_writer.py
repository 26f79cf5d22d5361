"""Writes one robot of one or two arms in URDF and in MJCF, drawn from a seed, wherever it shall stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

BOX = '<geometry><box size="0.2 0.2 0.1"/></geometry>'


class Writer:
    """Arms of three to seven joints of similar speeds.

    Attributes:
        shared: Whether they stand on one table, else each on a stand of its own.
        places: Where each arm stands on the table, or in the robot's own axes.
    """

    def __init__(self, seed: int, arms: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.shared = bool(rng.random() < 0.5)
        self.places = [_pose(rng.uniform(-1.0, 1.0, 3), (0.0, 0.0, rng.uniform(-3.0, 3.0)))]
        if arms == 2 and rng.random() < 0.5:  # that face each other, near enough to reach through the other one
            self.places = [_pose((-rng.uniform(0.2, 0.8), 0.0, 0.0), (0.0, 0.0, 0.0))]
        if arms == 2:
            self.places.append(_pose((0.0, 0.0, 0.0), (0.0, 0.0, np.pi)) @ self.places[0])
        self.joints = []
        for i in range(int(rng.integers(3, 8))):
            offset = np.array([0.0, 0.0, 0.2]) if i < 2 else rng.uniform(0.0, 0.4) * np.eye(3)[rng.choice((0, 0, 2))]
            axis = np.eye(3)[2 if i == 0 else rng.integers(3)] if rng.random() < 0.8 else rng.normal(size=3)
            self.joints.append((offset, axis, float(rng.uniform(1.5, 2.1))))
        self.tip = np.array([rng.uniform(0.05, 0.3), 0.0, 0.0])

    def urdf(self, path: Path, stand: np.ndarray, under: tuple[str, float, np.ndarray] | None = None) -> Path:
        """Write it at a pose.

        Args:
            path: Of the file.
            stand: Pose of the table, or of the robot's own axes, (4, 4) [m].
            under: Kind, speed limit and axis of another joint under the only arm, if there shall be one.
        """
        text = '<link name="world"/>'
        if self.shared:
            text += (
                f'<link name="table"><collision>{BOX}</collision></link>{_joint("s", "fixed", "world", "table", stand)}'
            )
        for k, place in enumerate(self.places):
            parent, there = ("table", place) if self.shared else ("world", stand @ place)
            text += f'<link name="{k}base"><collision>{BOX}</collision></link>'
            text += _joint(f"{k}s", "fixed", parent, f"{k}base", there)
            above = f"{k}base"
            if under is not None:
                text += f'<link name="car"/>{_joint("under", under[0], above, "car", np.eye(4), *under[1:])}'
                above = "car"
            for i, (offset, axis, speed) in enumerate(self.joints):
                text += f'<link name="{k}l{i}"/>'
                text += _joint(f"{k}j{i}", "revolute", above, f"{k}l{i}", _pose(offset), speed, axis)
                above = f"{k}l{i}"
            text += f'<link name="{k}tip"/>{_joint(f"{k}t", "fixed", above, f"{k}tip", _pose(self.tip))}'
        path.write_text(f'<robot name="arms">{text}</robot>')
        return path

    def mjcf(self, path: Path, stand: np.ndarray) -> Path:
        """Write it at a pose.

        Args:
            path: Of the file.
            stand: Pose of the table, or of the robot's own axes, (4, 4) [m].
        """
        arms = ""
        for k, place in enumerate(self.places):
            inside = f'<site name="{k}tip" pos="{_words(self.tip)}"/>'
            for i, (offset, axis, _) in reversed(list(enumerate(self.joints))):
                joint = f'<joint name="{k}j{i}" axis="{_words(axis)}" range="-2.5 2.5"/><geom size="0.03"/>'
                inside = f'<body name="{k}l{i}" pos="{_words(offset)}">{joint}{inside}</body>'
            there = place if self.shared else stand @ place
            arms += f'<body name="{k}base" {_mjcf(there)}><geom size="0.1"/>{inside}</body>'
        if self.shared:
            arms = f'<body name="table" {_mjcf(stand)}><geom size="0.1"/>{arms}</body>'
        compiler = '<compiler angle="radian" eulerseq="XYZ"/>'
        path.write_text(f'<mujoco model="arms">{compiler}<worldbody>{arms}</worldbody></mujoco>')
        return path


def _joint(
    name: str, kind: str, parent: str, child: str, pose: np.ndarray, speed: float = 1.0, axis: np.ndarray | None = None
) -> str:
    text = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{_words(pose[:3, 3])}" rpy="{_rpy(pose)}"/>'
    if axis is not None:
        text += f'<axis xyz="{_words(axis)}"/><limit lower="-2.5" upper="2.5" velocity="{speed!r}" effort="9"/>'
    return f'<joint name="{name}" type="{kind}">{text}</joint>'


def _mjcf(pose: np.ndarray) -> str:
    return f'pos="{_words(pose[:3, 3])}" euler="{_rpy(pose)}"'


def _rpy(pose: np.ndarray) -> str:
    return _words(pin.rpy.matrixToRpy(pose[:3, :3]))


def _pose(xyz: object, rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = pin.rpy.rpyToMatrix(*rpy), xyz
    return pose


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
