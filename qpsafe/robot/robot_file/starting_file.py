"""A first robot.toml for a model file, for a person to correct."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

from qpsafe.robot.robot import Robot


def starting_robot_toml(
    robot: Robot,
    folder: Path,
    *,
    spots: str | None = None,
    assumed: Sequence[str] | None = None,
) -> str:
    """The text of a robot.toml that says what was found in a bare model file and what was assumed.

    Args:
        robot: Loaded from the model file alone.
        folder: Where the file will stand; the model is named relative to it where it is below.
        spots: File of distance sensors beside it, if there is one.
        assumed: What was assumed and chosen, in words; by default the robot's notes.
    """
    model = robot.model_path.resolve()
    name = os.path.relpath(model, folder.resolve()) if folder.resolve() in model.parents else str(model)
    lines = [
        f"# {robot.title}: written by `qpsafe robots add` from {robot.model_path.name}. Check every value, above all:",
        *(f"# - {note}" for note in (robot.notes if assumed is None else assumed)),
        "",
        f"name = {_text(robot.name)}",
        f"title = {_text(robot.title)}",
        f"model = {_text(name)}",
        '# spots = "spots.toml"             # distance sensors, if it carries any'
        if spots is None
        else f"spots = {_text(spots)}",
        f"home = [{', '.join(map(_figure, robot.home, robot.sliding))}]",
        "",
        "[units]",
        'length = "m"',
        'angle = "deg"',
        'mass = "kg"',
        'time = "s"',
        "",
    ]
    limits = {key: getattr(robot, key) for key in ("lower", "upper", "max_velocity", "max_acceleration")}
    for i, joint in enumerate(robot.joint_names):
        lines += [f"[joints.{_text(joint)}]"]
        for key in limits:
            lines += [f"{key} = {_figure(limits[key][i], robot.sliding[i])}"]
        lines += [""]
    if robot.held:
        lines += ["# Joints that are held in place, and where (angle or length).", "[hold]"]
        lines += [f"{_text(name)} = {_figure(*joint)}" for name, joint in robot.held.items()]
        lines += [""]
    lines += ["# Name in qpsafe -> site, body or link of the model. Rename as you like.", "[frames]"]
    lines += [f"{_text(frame)} = {_text(frame)}" for frame in robot.frame_names]
    lines += [
        "",
        "# The segments whose motion makes the danger field, eq. (4), along the joint tree.",
        "[wire]",
        "links = [",
    ]
    lines += [f"    [{_text(start)}, {_text(end)}]," for start, end in robot.wire_frames]
    lines += ["]", ""]
    several = len(robot.tool_frames) > 1
    for frame in robot.tool_frames:
        mount = _mount(robot, frame)
        offset = _offset(robot, mount, frame)
        lines += [
            "# Assumed: the tool ends where the wire ends. Its mass is for people only.",
            "[[tool]]" if several else "[tool]",
            f"frame = {_text(frame)}",
            f"mounted_on = {_text(mount)}",
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


def _figure(value: float, sliding: bool) -> str:
    """Degrees, or metres where a joint slides."""
    return repr(round(float(value), 9) + 0.0) if sliding else repr(round(math.degrees(value), 6) + 0.0)


def _text(value: str) -> str:
    """A TOML string (also fine as a key)."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
