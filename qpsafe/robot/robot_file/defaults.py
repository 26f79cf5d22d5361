"""Describing a robot from its model file alone, with defaults that are said."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import RobotFileError
from qpsafe.robot.models.model_file import ModelFile, is_urdf
from qpsafe.robot.robot_file.spec import WORLD, RobotSpec

#: Full speed is reached in this time where no acceleration is stated [s]; neither MJCF nor URDF can state one.
FULL_SPEED_TIME = 0.25
#: Speed limit of a joint that turns where the file states none [rad/s]: slow, about 57 deg/s.
DEFAULT_MAX_VELOCITY = 1.0
#: The same of a joint that slides [m/s].
DEFAULT_MAX_SPEED = 0.25
#: How the note of a robot begins whose file states no home pose.
HOMELESS = "no home pose is stated"
#: How far from the world's origin a joint that stands on the world itself is reported [m].
FAR_FROM_ORIGIN = 1.0
_NO_LIMIT = 1e6  # readers write huge numbers, or zero, for "no limit"


def spec_from_model(path: Path, file: ModelFile, given: dict[str, ArrayLike]) -> RobotSpec:
    """Describe a robot from its model file alone.

    Frames are all frames of the model. The wire follows the joint tree: a link from what the first joint stands on,
    from each joint's origin to the next ones, and from every last joint to the frame farthest from it. Where the file
    states no speed, 1 rad/s or 0.25 m/s is taken; accelerations reach full speed in 0.25 s; home is the keyframe "home"
    of an MJCF, else zero, moved inside the limits.

    Args:
        path: The model file.
        file: What was read from it.
        given: Overrides: lower, upper, max_velocity, max_acceleration, home; each one number or (n,).

    Raises:
        RobotFileError: A limit makes no sense.
    """
    model, notes = file.model, list(file.notes)
    names = tuple(model.names)[1:]
    speed = np.array(model.velocityLimit)
    unstated = ~(np.isfinite(speed) & (speed > 0.0) & (speed < _NO_LIMIT))
    slides = np.array([joint.shortname().startswith("JointModelP") for joint in list(model.joints)[1:]])
    usual = np.where(slides, DEFAULT_MAX_SPEED, DEFAULT_MAX_VELOCITY)
    for kind, speed_taken in ((~slides, f"{DEFAULT_MAX_VELOCITY:g} rad/s"), (slides, f"{DEFAULT_MAX_SPEED:g} m/s")):
        which = ", ".join(np.array(names)[unstated & kind])
        if which and "max_velocity" not in given:
            notes.append(f"no speed limit in the file, {speed_taken} is taken: {which}")
    values = {
        "lower": _per_joint(path, "lower", given.get("lower", model.lowerPositionLimit), model.nq),
        "upper": _per_joint(path, "upper", given.get("upper", model.upperPositionLimit), model.nq),
        "max_velocity": _per_joint(
            path, "max_velocity", given.get("max_velocity", np.where(unstated, usual, speed)), model.nq
        ),
    }
    if "max_acceleration" not in given:
        notes.append(f"no accelerations can be stated in the file: full speed in {FULL_SPEED_TIME:g} s is taken")
    default = values["max_velocity"] / FULL_SPEED_TIME
    values["max_acceleration"] = _per_joint(path, "max_acceleration", given.get("max_acceleration", default), model.nq)
    _check_limits(path, names, values)
    stated = np.array([file.home.get(name, 0.0) for name in names])
    home = np.clip(stated, values["lower"], values["upper"])
    home = _per_joint(path, "home", given.get("home", home), model.nq)
    for name, value, low, high in zip(names, home, values["lower"], values["upper"], strict=True):
        if not low <= value <= high:
            raise RobotFileError(path, f"{name}.home", float(value), f"within {low:g} to {high:g} rad")
    if "home" not in given and not file.home:
        notes.append(f"{HOMELESS}: all joints at zero, moved inside their limits")
    wire = wire_from_tree(model, _roots_of_urdf(model) if is_urdf(path) else file.roots)
    notes += _said_of_origin(model)
    return RobotSpec(
        name=model.name or path.stem,
        title=model.name or path.stem,
        folder=path.parent,
        model_path=path,
        joint_names=names,
        home=home,
        frames={frame.name: frame.name for frame in model.frames},
        wire_frames=wire,
        notes=tuple(notes),
        lower=values["lower"],
        upper=values["upper"],
        max_velocity=values["max_velocity"],
        max_acceleration=values["max_acceleration"],
        held=file.held,
        hulls=file.hulls,
    )


def wire_from_tree(model: Any, roots: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Links of the wire along the joint tree of a model: from each joint to its children, and to the tips.

    The tip of a joint that carries no other is the frame that moves with it and lies farthest from its origin.

    Args:
        model: pinocchio's.
        roots: Joint -> the frame where the wire of its tree begins, if that is not the world's origin.
    """
    origins = {frame.parentJoint: frame for frame in model.frames if frame.type == pin.FrameType.JOINT}
    links = []
    for i in range(1, model.njoints):
        above = model.parents[i]
        start = origins[above].name if above else roots.get(model.names[i], "universe")
        links.append((start, origins[i].name))
    for i in range(1, model.njoints):
        if i in list(model.parents)[1:]:
            continue
        far, tip = 2e-9, None
        for frame in model.frames:
            distance = float(np.linalg.norm(frame.placement.translation))
            if frame.parentJoint == i and frame.name != origins[i].name and distance >= far - 1e-9:
                far, tip = distance, frame.name
        if tip is not None:
            links.append((origins[i].name, tip))
    return tuple(links)


def _roots_of_urdf(model: Any) -> dict[str, str]:
    """First joint -> the link it stands on, where that is off the origin; of an MJCF `ModelFile.roots` says the same.

    Between the world's origin and that link nothing of the robot need stand.
    """
    roots = {}
    for joint, link in _first_joints(model):
        if np.linalg.norm(link.placement.translation) > 1e-9:
            roots[model.names[joint]] = link.name
    return roots


def _said_of_origin(model: Any) -> list[str]:
    """Joints that stand on the world itself, far from its origin, where the wire begins for want of another frame."""
    notes = []
    for joint, link in _first_joints(model):
        far = float(np.linalg.norm(model.jointPlacements[joint].translation))
        if link.name in WORLD and far > FAR_FROM_ORIGIN:
            name = model.names[joint]
            notes.append(
                f"{name} stands on no link or body that is fixed, so the wire begins {far:.3g} m away, at the world's "
                f"origin: put one where {name} is, unless the robot's base reaches that far"
            )
    return notes


def _first_joints(model: Any) -> list[tuple[int, Any]]:
    """Joints that no other one moves, and the frames of what they stand on."""
    frames = [frame for frame in model.frames if frame.type == pin.FrameType.JOINT]
    return [(f.parentJoint, model.frames[f.parentFrame]) for f in frames if model.parents[f.parentJoint] == 0]


def _check_limits(path: Path, names: tuple[str, ...], values: dict[str, NDArray[np.float64]]) -> None:
    for key, array in values.items():
        for name, value in zip(names, array, strict=True):
            if not (np.isfinite(value) and abs(value) < _NO_LIMIT):
                expected = f"a finite limit: state it ({key}=...) or hold {name}"
                raise RobotFileError(path, f"{name}.{key}", float(value), expected)
            if key.startswith("max_") and not value > 0:
                raise RobotFileError(path, f"{name}.{key}", float(value), "a number above zero")
    for name, low, high in zip(names, values["lower"], values["upper"], strict=True):
        if not low < high:
            raise RobotFileError(path, f"{name}.lower", float(low), f"less than upper = {float(high)!r} rad")


def _per_joint(path: Path, key: str, value: ArrayLike, n: int) -> NDArray[np.float64]:
    """One number for every joint, or one for each, as an array (n,)."""
    try:
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)))
    except (TypeError, ValueError):
        raise RobotFileError(path, key, value, f"one number or {n} numbers") from None
