"""A first robot.toml for a model file, for a person to correct."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qpsafe.robot.robot import Robot
from qpsafe.text.toml_string import toml_string


def starting_robot_toml(
    robot: Robot,
    folder: Path,
    *,
    spots: str | None = None,
    assumed: Sequence[str] | None = None,
) -> str:
    """The text of a robot.toml that says what was found in a bare model file and what was assumed.

    Figures are rounded for a person, in degrees; all are whole, in radians, where a range or a speed would vanish.

    Args:
        robot: Loaded from the model file alone.
        folder: Where the file will stand; the model is named relative to it where it is below.
        spots: File of distance sensors beside it, if there is one.
        assumed: What was assumed and chosen, in words; by default the robot's notes.
    """
    model = robot.model_path.resolve()
    name = os.path.relpath(model, folder.resolve()) if folder.resolve() in model.parents else str(model)
    limits = {key: getattr(robot, key) for key in ("lower", "upper", "max_velocity", "max_acceleration")}
    figure = _rounded if _readable(limits, robot.sliding) else _whole
    lines = [
        _comment(f"{robot.title}: written by `qpsafe robots add` from {robot.model_path.name}."),
        "# Check every value, above all:",
        *(_comment(f"- {note}") for note in (robot.notes if assumed is None else assumed)),
        "",
        f"name = {toml_string(robot.name)}",
        f"title = {toml_string(robot.title)}",
        f"model = {toml_string(name)}",
        '# spots = "spots.toml"             # distance sensors, if it carries any'
        if spots is None
        else f"spots = {toml_string(spots)}",
        f"home = [{', '.join(map(figure, robot.home, robot.sliding))}]",
        "",
        "[units]",
        'length = "m"',
        f"angle = {toml_string('deg' if figure is _rounded else 'rad')}",
        'mass = "kg"',
        'time = "s"',
        "",
    ]
    for i, joint in enumerate(robot.joint_names):
        lines += [f"[joints.{toml_string(joint)}]"]
        for key in limits:
            lines += [f"{key} = {figure(limits[key][i], robot.sliding[i])}"]
        lines += [""]
    if robot.held:
        lines += ["# Joints that are held in place, and where (angle or length).", "[hold]"]
        lines += [f"{toml_string(name)} = {figure(*joint)}" for name, joint in robot.held.items()]
        lines += [""]
    lines += ["# Name in qpsafe -> site, body or link of the model. Rename as you like.", "[frames]"]
    lines += [f"{toml_string(frame)} = {toml_string(frame)}" for frame in robot.frame_names]
    lines += [
        "",
        "# The segments whose motion makes the danger field, eq. (4), along the joint tree.",
        "[wire]",
        "links = [",
    ]
    lines += [f"    [{toml_string(start)}, {toml_string(end)}]," for start, end in robot.wire_frames]
    lines += ["]", ""]
    several = len(robot.tool_frames) > 1
    for frame in robot.tool_frames:
        mount = _mount(robot, frame)
        offset = _offset(robot, mount, frame)
        lines += [
            "# Assumed: the tool ends where the wire ends. Its mass is for people only.",
            "[[tool]]" if several else "[tool]",
            f"frame = {toml_string(frame)}",
            f"mounted_on = {toml_string(mount)}",
            f"offset = [{', '.join(repr(round(value, 9) + 0.0) for value in offset)}]",
            "mass = 0.0",
            "",
        ]
    return "\n".join(lines)


def _mount(robot: Robot, frame: str) -> str:
    """The frame that a wire's end keeps its distance from: where its link starts, unless a joint slides in between."""
    start = next((start for start, end in robot.wire_frames if end == frame), frame)
    body = robot.mounting(frame)[0]
    return frame if body != robot.mounting(start)[0] and robot.sliding[body - 1] else start


def _offset(robot: Robot, mount: str, frame: str) -> list[float]:
    """The tip in the frame that it is mounted on [m]."""
    pose = robot.pose(mount, robot.home)
    offset = pose[:3, :3].T @ (robot.pose(frame, robot.home)[:3, 3] - pose[:3, 3])
    return [float(value) for value in offset]


def _readable(limits: Mapping[str, NDArray[np.float64]], sliding: NDArray[np.bool_]) -> bool:
    """Whether ranges, speeds and accelerations are still there after rounding."""
    read = {
        key: np.array([float(_rounded(*joint)) for joint in zip(values, sliding, strict=True)])
        for key, values in limits.items()
    }
    spans = (read["upper"] - read["lower"], read["max_velocity"], read["max_acceleration"])
    return all(bool((span > 0.0).all()) for span in spans)


def _rounded(value: float, sliding: bool) -> str:
    """Degrees, or metres where a joint slides."""
    return repr(round(float(value), 9) + 0.0) if sliding else repr(round(math.degrees(value), 6) + 0.0)


def _whole(value: float, _sliding: bool) -> str:
    """Radians, or metres where a joint slides, to the last digit."""
    return repr(float(value) + 0.0)


def _comment(words: str) -> str:
    """A comment in one line, whatever names stand in it."""
    return "# " + re.sub(r"[\x00-\x1f\x7f]", " ", words)
