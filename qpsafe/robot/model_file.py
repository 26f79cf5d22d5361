"""Reading MJCF and URDF files with pinocchio, and describing a robot from such a file alone."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import RobotFileError
from qpsafe.robot.spec import RobotSpec

DEFAULT_MAX_ACCELERATION = 10.0  # rad/s^2; neither MJCF nor URDF can state one


def read_model(path: Path) -> Any:
    """The pinocchio model of an MJCF or URDF file with one-degree-of-freedom revolute joints.

    Raises:
        RobotFileError: The file is neither, cannot be parsed, or has other kinds of joints.
    """
    try:
        tag = ElementTree.parse(path).getroot().tag
    except (OSError, ElementTree.ParseError) as error:
        raise RobotFileError(path, "file", path.name, f"an MJCF or URDF file ({error})") from error
    builders = {"mujoco": pin.buildModelFromMJCF, "robot": pin.buildModelFromUrdf}
    if tag not in builders:
        raise RobotFileError(path, "root element", tag, "<mujoco> (MJCF) or <robot> (URDF)")
    try:
        model = builders[tag](str(path))
    except (ValueError, RuntimeError) as error:
        raise RobotFileError(path, "file", path.name, f"a model that pinocchio can read ({error})") from error
    if model.nq == 0:
        raise RobotFileError(path, "joints", 0, "at least one joint")
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if not joint.shortname().startswith("JointModelR") or joint.nq != 1:
            raise RobotFileError(path, name, joint.shortname(), "a revolute joint with one number for its position")
    return model


def spec_from_model(path: Path, model: Any, given: dict[str, ArrayLike]) -> RobotSpec:
    """Describe a robot from its model file alone.

    Frames are all frames of the model. The wire runs from the base through the joints' origins to the model's last
    frame. What the file does not state must be `given`, except accelerations (10 rad/s^2) and the home pose (zero,
    moved inside the limits).

    Args:
        path: The model file.
        model: Its pinocchio model.
        given: Overrides: lower, upper, max_velocity, max_acceleration, home; each one number or (n,).

    Raises:
        RobotFileError: A limit is neither in the file nor given, or makes no sense.
    """
    names = tuple(model.names)[1:]
    from_file = {
        "lower": model.lowerPositionLimit,
        "upper": model.upperPositionLimit,
        "max_velocity": model.velocityLimit,
        "max_acceleration": DEFAULT_MAX_ACCELERATION,
    }
    values = {key: _per_joint(path, key, given.get(key, default), model.nq) for key, default in from_file.items()}
    for key, array in values.items():
        for name, value in zip(names, array, strict=True):
            if not (np.isfinite(value) and abs(value) < 1e6):  # URDF readers write huge numbers for "no limit"
                expected = f"a finite limit; the file states none: pass {key}=... to load_robot"
                raise RobotFileError(path, f"{name}.{key}", float(value), expected)
            if key.startswith("max_") and not value > 0:
                raise RobotFileError(path, f"{name}.{key}", float(value), "a number above zero")
    for name, low, high in zip(names, values["lower"], values["upper"], strict=True):
        if not low < high:
            raise RobotFileError(path, f"{name}.lower", float(low), f"less than upper = {float(high)!r} rad")
    home = np.clip(np.zeros(model.nq), values["lower"], values["upper"])
    home = _per_joint(path, "home", given.get("home", home), model.nq)
    for name, value, low, high in zip(names, home, values["lower"], values["upper"], strict=True):
        if not low <= value <= high:
            raise RobotFileError(path, f"{name}.home", float(value), f"within {low:g} to {high:g} rad")

    frames = [frame.name for frame in model.frames]
    chain = ["universe", *names]
    if frames[-1] != chain[-1]:
        chain.append(frames[-1])
    return RobotSpec(
        name=model.name or path.stem,
        title=model.name or path.stem,
        folder=path.parent,
        model_path=path,
        joint_names=names,
        home=home,
        frames={name: name for name in frames},
        wire_frames=tuple(pairwise(chain)),
        lower=values["lower"],
        upper=values["upper"],
        max_velocity=values["max_velocity"],
        max_acceleration=values["max_acceleration"],
    )


def _per_joint(path: Path, key: str, value: ArrayLike, n: int) -> NDArray[np.float64]:
    """One number for every joint, or one for each, as an array (n,)."""
    try:
        return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)))
    except (TypeError, ValueError):
        raise RobotFileError(path, key, value, f"one number or {n} numbers") from None
