"""Reading MJCF and URDF files with pinocchio: one robot of revolute joints, and what had to be assumed for it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from qpsafe.errors import RobotFileError
from qpsafe.robot.mjcf_check import check_mjcf, check_same_kinematics
from qpsafe.robot.urdf_check import check_urdf, package_folders

ENDLESS = 2.0 * math.pi  # rad either way: what a joint without end gets as its range


class ModelFile(NamedTuple):
    """A model file as it was understood.

    Attributes:
        model: pinocchio's model, revolute joints only.
        notes: What is missing or doubtful in the file, and what was assumed, in words.
        held: Names of the other joints, which are held in place.
    """

    model: Any
    notes: tuple[str, ...]
    held: tuple[str, ...]


def read_model(path: Path, trusted: bool = False) -> ModelFile:
    """Read an MJCF or URDF file.

    Joints that are not revolute, and those that mimic others, are held where the file has them; joints that turn
    without end get a range of two turns. Both are said in the notes.

    Args:
        path: The file.
        trusted: Whether to do without MuJoCo's checks of an MJCF: those of the bundled robots are made by the tests.

    Raises:
        RobotFileError: The file is neither, cannot be parsed, or something in it is wrong; names the place.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise RobotFileError(path, "file", path.name, f"an MJCF or URDF file ({error})") from error
    if root.tag not in ("mujoco", "robot"):
        raise RobotFileError(path, "root element", root.tag, "<mujoco> (MJCF) or <robot> (URDF)")
    if root.tag == "robot":
        notes = check_urdf(path, root)
    else:
        notes = [] if trusted else check_mjcf(path, root)
    endless = _bound_endless(root) if root.tag == "robot" else []
    mimics = [joint.get("name", "") for joint in root.findall("joint") if joint.find("mimic") is not None]
    full = _build(path, root)
    if root.tag == "mujoco" and not trusted:
        check_same_kinematics(path, full)
    endless += _bound_unlimited(full)
    if endless:
        notes.append(f"joints that turn without end get a range of ±360°: {', '.join(endless)}")
    names, joints = list(full.names)[1:], list(full.joints)[1:]
    other = {
        name: joint.shortname()
        for name, joint in zip(names, joints, strict=True)
        if not (joint.shortname().startswith("JointModelR") and joint.nq == 1)
    }
    if other:
        listed = ", ".join(f"{name} ({kind.removeprefix('JointModel')})" for name, kind in other.items())
        notes.append(f"joints that are not revolute are held in place: {listed}")
    held = [name for name in names if name in other or name in mimics]
    if len(held) == len(names):
        found = listed if other else 0
        raise RobotFileError(path, "joints", found, "at least one revolute joint with one number for its position")
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in held], pin.neutral(full)) if held else full
    return ModelFile(model, tuple(notes), tuple(held))


def collision_geometry(path: Path, model: Any) -> Any:
    """pinocchio's collision geometry for a model that `read_model` made of a file.

    Raises:
        ValueError, RuntimeError: pinocchio cannot read it.
    """
    root = ElementTree.parse(path).getroot()
    if root.tag == "robot":
        _bound_endless(root)
    full = _build(path, root)
    if root.tag == "robot":
        text = ElementTree.tostring(root, encoding="unicode")
        geometry = pin.buildGeomFromUrdfString(full, text, pin.GeometryType.COLLISION, package_dirs=_mesh_folders(path))
    else:
        geometry = pin.buildGeomFromMJCF(full, str(path), pin.GeometryType.COLLISION)
    kept = set(model.names)
    held = [full.getJointId(name) for name in list(full.names)[1:] if name not in kept]
    if held:
        _, geometry = pin.buildReducedModel(full, geometry, held, pin.neutral(full))
    return geometry


def _build(path: Path, root: Any) -> Any:
    try:
        if root.tag == "robot":
            return pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))
        return pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError, IndexError) as error:
        raise RobotFileError(path, "file", path.name, f"a model that pinocchio can read ({error})") from error


def _mesh_folders(path: Path) -> list[str]:
    return [str(path.parent), *package_folders(path)]


def _bound_endless(root: Any) -> list[str]:
    """Make continuous joints of a URDF revolute ones of two turns; their names.

    What a <limit> leaves out or calls infinite becomes 0, "not stated": the reader would refuse the whole file.
    """
    found = []
    for limit in root.iterfind("joint/limit"):
        for key in ("velocity", "effort"):
            if not math.isfinite(float(limit.get(key, "inf"))):
                limit.set(key, "0")
    for joint in root.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit", velocity="0", effort="0")
            limit.set("lower", repr(-ENDLESS))
            limit.set("upper", repr(ENDLESS))
            found.append(joint.get("name", ""))
    return found


def _bound_unlimited(model: Any) -> list[str]:
    """Give hinges without a range (MJCF) one of two turns; their names."""
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    found = []
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        i = joint.idx_q
        if joint.nq == 1 and not (abs(lower[i]) < 1e6 and abs(upper[i]) < 1e6):
            lower[i], upper[i] = -ENDLESS, ENDLESS
            if joint.shortname().startswith("JointModelR"):
                found.append(name)
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return found
