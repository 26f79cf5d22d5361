"""A URDF file as pinocchio reads it: continuous joints bounded, joints held, every frame with a name of its own."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import pinocchio as pin

from qpsafe.errors import RobotFileError
from qpsafe.robot.joint_choice import HINGE, SLIDE, Coupling, FoundJoint
from qpsafe.robot.models.mjcf import ENDLESS
from qpsafe.robot.models.names import unique_name
from qpsafe.robot.models.urdf_check import check_urdf, package_folders

_KINDS = {"revolute": HINGE, "continuous": HINGE, "prismatic": SLIDE}


class UrdfFile:
    """A URDF file, checked.

    Attributes:
        notes: What is doubtful, in words.
        joints: Its joints, fixed ones not among them.
        endless: Names of those that turn without end.
    """

    def __init__(self, path: Path, root: Element) -> None:
        """Check and prepare.

        Raises:
            RobotFileError: Names the element that is wrong.
        """
        self.notes = tuple(check_urdf(path, root))
        self._path = path
        elements = {joint.get("name", ""): joint for joint in root.findall("joint")}
        self.endless = [name for name, joint in elements.items() if joint.get("type") == "continuous"]
        for element in elements.values():
            _state_limits(element)
        self.joints = _found(elements)
        for link in root.findall("link"):
            for picture in link.findall("visual"):  # not needed, and a mistake in it would be the whole file's
                link.remove(picture)
        taken = {link.get("name", "") for link in root.findall("link")} | {"universe"}
        self._names = {name: unique_name(name, "joint", taken) for name in elements}
        for name, element in elements.items():
            element.set("name", self._names[name])
            mimic = element.find("mimic")
            if mimic is not None:
                element.remove(mimic)
        self._text = ElementTree.tostring(root, encoding="unicode")

    def build(self, held: Mapping[str, float]) -> Any:
        """pinocchio's model without the joints that are held at these values [rad or m].

        Raises:
            RobotFileError: pinocchio cannot read the file.
        """
        full = self._full()
        ids, values = self._held(full, held)
        model = pin.buildReducedModel(full, ids, values) if ids else full
        back = {unique: name for name, unique in self._names.items()}
        for i in range(1, model.njoints):
            model.names[i] = back[model.names[i]]
        return model

    def geometry(self, held: Mapping[str, float]) -> Any:
        """pinocchio's collision geometry for the same model."""
        full = self._full()
        folders = [str(self._path.parent), *package_folders(self._path)]
        geometry = pin.buildGeomFromUrdfString(full, self._text, pin.GeometryType.COLLISION, package_dirs=folders)
        ids, values = self._held(full, held)
        return pin.buildReducedModel(full, geometry, ids, values)[1] if ids else geometry

    def _full(self) -> Any:
        try:
            return pin.buildModelFromXML(self._text)
        except (ValueError, RuntimeError, IndexError) as error:
            expected = f"a model that pinocchio can read ({error})"
            raise RobotFileError(self._path, "file", self._path.name, expected) from error

    def _held(self, full: Any, held: Mapping[str, float]) -> tuple[list[int], Any]:
        """pinocchio's numbers of the joints that are held, and a configuration in which they are."""
        values, ids = pin.neutral(full), []
        for name, value in held.items():
            ids.append(full.getJointId(self._names[name]))
            joint = full.joints[ids[-1]]
            if joint.nq == 1:
                values[joint.idx_q] = value
        return ids, values


def _state_limits(joint: Element) -> None:
    """Make a continuous joint a revolute one of many turns; without a <limit> the reader would refuse the whole file.

    What a <limit> leaves out or calls infinite becomes 0, "not stated".
    """
    limit = joint.find("limit")
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit")
        limit.set("lower", repr(-ENDLESS))
        limit.set("upper", repr(ENDLESS))
    if limit is not None:
        for key in ("velocity", "effort"):
            if not math.isfinite(float(limit.get(key, "inf"))):
                limit.set(key, "0")


def _found(elements: Mapping[str, Element]) -> list[FoundJoint]:
    ends = {name: (_link(joint, "parent"), _link(joint, "child")) for name, joint in elements.items()}
    by_child = {child: name for name, (_, child) in ends.items()}

    def above(name: str) -> str | None:
        joint = by_child.get(ends[name][0])
        while joint is not None and elements[joint].get("type") == "fixed":
            joint = by_child.get(ends[joint][0])
        return joint

    found = []
    for name, joint in elements.items():
        kind = joint.get("type", "")
        if kind == "fixed":
            continue
        limit, mimic = joint.find("limit"), joint.find("mimic")
        lower = upper = 0.0
        if limit is not None and kind in _KINDS:
            lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        follows = None
        if mimic is not None:
            values = float(mimic.get("offset", "0")), float(mimic.get("multiplier", "1"))
            follows = Coupling(mimic.get("joint", ""), values)
        found.append(FoundJoint(name, _KINDS.get(kind, kind), above(name), ends[name][0], lower, upper, 0.0, follows))
    return found


def _link(joint: Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")
