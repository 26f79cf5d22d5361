"""Reading MJCF and URDF files: one robot of revolute and prismatic joints, and what had to be assumed for it.

pinocchio reads URDF; MJCF is compiled by MuJoCo (`qpsafe.robot.models.mjcf`), and pinocchio's model is built from that.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence, Set
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import pinocchio as pin

from qpsafe.errors import RobotFileError
from qpsafe.robot.joint_choice import HINGE, SLIDE, Choice, FoundJoint, HeldJoint, choose_joints
from qpsafe.robot.models.hulls import BodyHull, hulls_of_mjcf, hulls_of_pinocchio
from qpsafe.robot.models.urdf import UrdfFile


class ModelFile(NamedTuple):
    """A model file as it was understood.

    Attributes:
        model: pinocchio's model: joints of one number each, frames of different names.
        notes: What is missing or doubtful in the file, and what was assumed, in words.
        held: Joints that are held, and where.
        hulls: Reads the hulls of its collision geometry.
        home: Name of a joint -> its value in the keyframe "home" of an MJCF; empty where there is none.
        roots: Name of a joint that hangs on a fixed body -> the root of its tree, where that is off the world's origin.
    """

    model: Any
    notes: tuple[str, ...] = ()
    held: Mapping[str, HeldJoint] = {}
    hulls: Callable[[], list[BodyHull]] = list
    home: Mapping[str, float] = {}
    roots: Mapping[str, str] = {}


def read_model(
    path: Path,
    hold: Mapping[str, float] | None = None,
    units: tuple[float, float] = (1.0, 1.0),
    wanted: Set[str] = frozenset(),
) -> ModelFile:
    """Read an MJCF or URDF file. What is held besides `hold` is said in `qpsafe.robot.joint_choice`.

    Args:
        path: The file.
        hold: Joints that are held, and their values.
        units: Radians and metres in one of the units of `hold`.
        wanted: Joints that shall move, though they look like fingers.

    Raises:
        RobotFileError: The file is neither, cannot be parsed, or something in it is wrong; names the place.
    """
    root = _parse(path)
    read = _read_urdf if root.tag == "robot" else _read_mjcf
    return read(path, root, {} if hold is None else hold, units, wanted)


def is_urdf(path: Path) -> bool:
    """Whether a model file is URDF, whatever its name ends in.

    Raises:
        RobotFileError: It is neither URDF nor MJCF.
    """
    return _parse(path).tag == "robot"


def read_bundled(path: Path) -> ModelFile:
    """The MJCF of a bundled robot by pinocchio's own reader: no MuJoCo is needed to control a robot.

    These files keep to what that reader understands; tests compare it with MuJoCo and with `read_model`.
    """
    model = pin.buildModelFromMJCF(str(path))
    return ModelFile(model, hulls=partial(hulls_of_pinocchio, path, partial(_bundled_geometry, path, model)))


def _bundled_geometry(path: Path, model: Any) -> Any:
    return pin.buildGeomFromMJCF(model, str(path), pin.GeometryType.COLLISION)


def _parse(path: Path) -> Element:
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError, ValueError) as error:
        expected = f"an MJCF or URDF file ({error})"
        if path.suffix == ".xacro":
            expected = f"plain URDF: run xacro first (xacro {path.name} > plain.urdf): {error}"
        raise RobotFileError(path, "file", path.name, expected) from error
    if root.tag not in ("mujoco", "robot"):
        raise RobotFileError(path, "root element", root.tag, "<mujoco> (MJCF) or <robot> (URDF)")
    return root


def _read_mjcf(
    path: Path, root: Element, hold: Mapping[str, float], units: tuple[float, float], wanted: Set[str]
) -> ModelFile:
    from qpsafe.robot.models.mjcf import ENDLESS, compile_mjcf
    from qpsafe.robot.models.mjcf_build import build_model, check_same

    compiled = compile_mjcf(path, root)
    choice = choose_joints(path, compiled.joints, hold, units, wanted)
    built = build_model(compiled, choice.held)
    check_same(path, compiled, built, choice.held)
    endless = [j.name for j in compiled.joints if j.upper == ENDLESS and j.kind == HINGE and j.name not in choice.held]
    notes = (*compiled.notes, *choice.notes, *_said_of_endless(endless))
    hulls = partial(hulls_of_mjcf, path, compiled, built.bodies)
    return ModelFile(built.model, notes, _held(compiled.joints, choice), hulls, compiled.home, built.roots)


def _read_urdf(
    path: Path, root: Element, hold: Mapping[str, float], units: tuple[float, float], wanted: Set[str]
) -> ModelFile:
    file = UrdfFile(path, root)
    choice = choose_joints(path, file.joints, hold, units, wanted)
    kinds = {joint.name: joint.kind for joint in file.joints}
    held = {
        name: choice.held.get(name, 0.0) for name in kinds if name in choice.held or kinds[name] not in (HINGE, SLIDE)
    }
    model = file.build(held)
    endless = [name for name in file.endless if name not in held]
    notes = (*file.notes, *choice.notes, *_said_of_endless(endless))
    return ModelFile(
        model, notes, _held(file.joints, choice), partial(hulls_of_pinocchio, path, partial(file.geometry, held))
    )


def _said_of_endless(names: list[str]) -> list[str]:
    return [f"joints that turn without end get a range of ±1000 turns: {', '.join(names)}"] if names else []


def _held(joints: Sequence[FoundJoint], choice: Choice) -> dict[str, HeldJoint]:
    sliding = {joint.name: joint.kind == SLIDE for joint in joints}
    return {name: HeldJoint(value, sliding[name]) for name, value in choice.held.items()}
